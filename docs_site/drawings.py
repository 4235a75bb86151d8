"""The pictures of docs/HOW_IT_WORKS.md, from episodes of the demo run.

python -m docs_site.drawings         half a minute; writes docs/img/how_*.png
"""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import torch

from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.run_predictor import predictor_of
from ibe_rl.evaluation.runs import open_trained
from ibe_rl.evaluation.trained_run import TrainedRun, explainer_state
from ibe_rl.explain.explainer import explain
from ibe_rl.ibe import cut_windows, phrase
from ibe_rl.instructors import make_instructor
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Array
from ibe_rl.view.palette import of_expressions

SIGNS = np.array([-1, 0, 1])
ROOT = Path(__file__).parent.parent
PICTURES = ROOT / "docs" / "img"
EPISODES, SEED, CONTEXT, EXPLAINED_STEP, ARROW_EVERY_STEPS = 24, 1, "right", 37, 24


def main(folder: Path = PICTURES) -> None:
    """Roll the episodes out and draw all three pictures."""
    torch.set_num_threads(1)
    run = open_trained(str(ROOT / "demo"))
    shown = rolled_out(run, SEED, CONTEXT)
    others = [rolled_out(run, seed, None) for seed in range(100, 100 + EPISODES)]
    windows = cut_windows([one.episode for one in others], run.horizon_steps, "clamp")
    draw_windows(run, shown, windows.delta, windows.instruction[:, 0], folder / "how_windows.png")
    draw_words(run, windows.delta, folder / "how_words.png")
    draw_explanation(run, shown, folder / "how_explanation.png")


def rolled_out(run: TrainedRun, seed: int, context: str | None) -> RecordedRollout:
    """One greedy episode, instructed by the rule."""
    return record_rollout(run.make_env(), run.policy, make_instructor(run.config.instructor, run.task), seed, context)


def shades(expressions: Array) -> list[tuple[float, float, float]]:
    """Colours of the live view for expressions ``(N,)`` or ``(N, d)``, as matplotlib takes them."""
    return [tuple(row) for row in (of_expressions(expressions) / 255).tolist()]


def axes_of_game(axes: Any, run: TrainedRun, title: str) -> None:
    """A panel in which the lander is seen from the side; it begins at x = 0, y = 1.4."""
    x, y = run.task.state_names[:2]
    axes.set(title=title, xlabel=f"{x} (half widths)", ylabel=f"{y} (half widths)", xlim=(-0.6, 1.1), ylim=(-0.1, 1.75))


def draw_windows(run: TrainedRun, shown: RecordedRollout, deltas: Array, instructions: Array, path: Path) -> None:
    """Displacements of one episode in the colour of the instruction, and of many by instruction."""
    episode, steps = shown.episode, run.horizon_steps
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    left.plot(*episode.states[:, :2].T, color="0.75", zorder=1)
    for start in range(0, len(episode), ARROW_EVERY_STEPS):
        begin, end = episode.states[start, :2], episode.states[min(start + steps, len(episode)), :2]
        [colour] = shades(episode.instructions[start])
        left.annotate("", tuple(end), tuple(begin), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.8})
    axes_of_game(left, run, f"Displacements over {steps} steps; colour: the instruction at their start")
    right.hist([deltas[instructions == sign, 0] for sign in SIGNS], 40, color=shades(SIGNS), stacked=True)
    right.legend([phrase(np.array([sign]), run.task.phrases) for sign in SIGNS], title="instruction")
    right.set(title=f"All displacements of {EPISODES} episodes", xlabel="change of x (half widths)", ylabel="windows")
    save(figure, path)


def draw_words(run: TrainedRun, deltas: Array, path: Path) -> None:
    """The same displacements in the colour of their clusters, with the words for these."""
    mapping = run.mapping
    cluster = mapping.cluster(deltas)
    order = np.argsort(mapping.expressions[:, 0])
    figure, axes = plt.subplots(figsize=(11, 4), layout="constrained")
    colours = shades(mapping.expressions[order])
    axes.hist([deltas[cluster == each, 0] for each in order], 60, color=colours, stacked=True)
    words = [
        f"{mapping.expressions[each, 0]:+.2f}  {phrase(mapping.expressions[each], run.task.phrases)}" for each in order
    ]
    axes.legend(words, title="expression and phrase of each cluster")
    axes.set(xlabel="change of x (half widths)", ylabel="windows")
    save(figure, path)


def draw_explanation(run: TrainedRun, shown: RecordedRollout, path: Path) -> None:
    """One moment: the path, what is predicted and said, and where it really went."""
    config: ExplainConfig = composed("explain", ["predictor.processes=1"])
    voice = explainer_state(run, config.predictor.futures)
    with predictor_of(run, config.predictor, SEED) as predictor:
        [said] = explain([shown.moments[EXPLAINED_STEP]], run.policy, predictor, voice)
    states, now = shown.episode.states[:, :2], EXPLAINED_STEP
    figure, axes = plt.subplots(figsize=(7, 4.4), layout="constrained")
    axes.plot(*states[: now + 1].T, color="0.6", label="path so far")
    axes.plot(*said.path[:, :2].T, ".", color="tab:cyan", label=f"predicted for the next {run.horizon_steps} steps")
    axes.plot(*states[now : now + run.horizon_steps + 1].T, color="tab:green", label="realised")
    axes.plot(*states[now], "o", color="black")
    instruction = phrase(shown.episode.instructions[now], run.task.phrases)
    axes.annotate(f"instruction: {instruction}", tuple(states[now]), (0.2, states[now, 1] + 0.05))
    axes.annotate(f"says: {said.phrase}", tuple(said.path[-1, :2]), (0.2, said.path[-1, 1]))
    axes.legend(loc="lower right")
    axes_of_game(axes, run, f"Step {now} of one episode")
    save(figure, path)


def save(figure: Any, path: Path) -> None:
    """Write the picture and forget the figure."""
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
