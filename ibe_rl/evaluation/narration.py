"""One episode in words: rolled out, explained step by step, and printed as a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.advice import advice, lines_of, text_of
from ibe_rl.evaluation.run_predictor import predictor_of
from ibe_rl.evaluation.told_otherwise import answers_table, listening_line
from ibe_rl.evaluation.trained_run import TrainedRun, explainer_state, instructed_by
from ibe_rl.explain.explainer import explain
from ibe_rl.explain.steady import say_steadily
from ibe_rl.ibe.meaning_lines import meaning_lines
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics.quality import episode_scores, outcomes, phrase_accuracy, phrase_hits
from ibe_rl.metrics.stability import FLICKER_STEPS, stability
from ibe_rl.metrics.verdict import NOT_MEASURED, REVERSED, Verdict, in_one_line, verdicts_of, worst, wrong_signs
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, ConfigError, Explanation, Predictor
from ibe_rl.view.clip import FRAMES_PER_S, Clip
from ibe_rl.view.clip_file import check_clip, write_clip
from ibe_rl.view.spoken import NOT_TRUSTED, spoken_rows, spoken_words, titles, without_flicker
from ibe_rl.view.wording import span_name

FIRST_ROWS, MOST_ROWS = 30, 40
"""Of the table: so many rows from its beginning, and in all; the others are of the end."""
SEE_ALL = "viewer=live or viewer=file shows every step."


def check_context(context: str | None, run: TrainedRun) -> None:
    """Refuse a context unknown to the run's environment.

    Raises:
        ConfigError: naming the known contexts, or that there are none.
    """
    if context is not None and not run.task.context_option:
        raise ConfigError(
            f"context={context}: allowed is none, this environment has no option for it (task.context_option)"
        )
    if context is not None and context not in run.task.contexts:
        allowed = ", ".join(run.task.contexts)
        raise ConfigError(f"context={context}: allowed is one of {allowed}, or none to draw one")


def check_episode(cfg: ExplainConfig, run: TrainedRun) -> None:
    """Refuse what an explained episode cannot have: a context, or the file of a clip.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check_context(cfg.context, run)
    if cfg.clip is not None:
        check_clip(Path(cfg.clip), "clip")


def clip_of(run: TrainedRun, watched: RecordedRollout, said: Sequence[Explanation], path: Path) -> Path:
    """Write an explained episode as a moving picture; returns its path.

    Raises:
        ConfigError: if it cannot be written.
    """
    check_clip(path, "clip")
    real = outcomes(watched.episode, run.horizon_steps, run.mapping, run.task.phrases)
    steps_per_s = float(run.make_env().metadata.get("render_fps") or FRAMES_PER_S)
    try:
        write_clip(Clip(run.task, watched, said, real, steps_per_s), path)
    except OSError as error:
        raise ConfigError(f"clip={path}: allowed is a file that can be written ({error.strerror or error})") from None
    return path


def explain_rollout(
    run: TrainedRun, cfg: ExplainConfig, every_steps: int = 1
) -> tuple[RecordedRollout, list[Explanation]]:
    """Roll out one episode, then explain each of its steps, or every so many, as they are spoken."""
    with predictor_of(run, cfg.predictor, cfg.seed) as predictor:
        return explain_rollout_by(predictor, run, cfg, every_steps)


def explain_rollout_by(
    predictor: Predictor, run: TrainedRun, cfg: ExplainConfig, every_steps: int = 1
) -> tuple[RecordedRollout, list[Explanation]]:
    """As ``explain_rollout``, with a predictor that further episodes use too."""
    instructor = make_instructor(stand_in(run.config.instructor, run.folder), run.task)
    watched = record_rollout(run.make_env(), run.policy, instructor, cfg.seed, cfg.context)
    explainer = explainer_state(run, cfg.predictor.futures, cfg.min_confidence, cfg.what_if)
    said = explain(watched.moments[::every_steps], run.policy, predictor, explainer)
    return watched, say_steadily(said, explainer, every_steps)


def print_narration(
    run: TrainedRun, watched: RecordedRollout, said: Sequence[Explanation], console: PlainConsole | None = None
) -> None:
    """Print the explanations, one row for consecutive steps with the same words."""
    true = phrase_hits(watched.episode, said, run.mapping, run.task.phrases)
    verdicts = verdicts_of(episode_scores(watched.episode, said, run.task, run.mapping), run.mapping.meanings, run.task)
    console = console or PlainConsole()
    console.width = max(console.width, 120)
    if by := instructed_by(run):
        console.print(f"The instructions (m*) are {by}, not the rule's.")
    for line in _opening(run, verdicts):
        console.print(line)
    _print_table(run, watched, said, true, console)
    whose = f"Policy of frame {run.policy_frame:,}, vocabulary of frame {run.mapping_frame:,}."
    if isinstance(run.config.agent, ExternalPolicyConfig):
        whose = f"Agent: {run.config.agent.made_from}; vocabulary from {run.mapping_frame:,} steps."
    if said[0].what_if:
        console.print()
        console.print(answers_table(said, run.task.phrases))
        console.print(listening_line(said) + "\n")
    changes = stability([one.said for one in said])["phrase_changes_per_100"]
    console.print(f"What it says changes {changes:.1f} times in 100 steps.")
    console.print(f"{_closing(run, said, true)}; {in_one_line(verdicts)}. {whose}")
    if not all(span.trusted for one in said for span in one.all_spans):
        console.print(f"{NOT_TRUSTED}: the predictor does not trust a path that long.")


def _opening(run: TrainedRun, verdicts: Sequence[Verdict]) -> list[str]:
    """The verdict in plain words, on this episode or else the last refresh, and the meaning of the words."""
    refreshed = verdicts_of(run.scores_of_numbers, run.mapping.meanings, run.task)
    unknown = worst(verdicts).why == NOT_MEASURED
    lines = ["The AUC for the direction of motion cannot be measured in this episode."] if unknown else []
    judged = refreshed if unknown and run.scores_of_numbers else verdicts
    if not unknown or run.scores_of_numbers:
        lines += lines_of(text_of(judged, run), advice(judged, run))
    if run.scores_of_numbers:
        lines.append(f"At the last refresh, over many episodes: {in_one_line(refreshed)}.")
    wrong = [] if worst(judged).level == REVERSED else wrong_signs(refreshed, run.mapping.meanings, run.task)
    meanings = meaning_lines(run.mapping.meanings, run.task)
    new = [line for line in meanings if not any(line in other for other in lines)]  # may be in the verdict already
    return [*lines, *wrong, *new, ""]


def _closing(run: TrainedRun, said: Sequence[Explanation], true: Array) -> str:
    """Phrase accuracy over the explanations that were given."""
    spoken = np.array([one.known for one in said], bool)
    if not spoken.any():
        return "It gave no explanation"
    at = "" if spoken.all() else f" (at {spoken.mean():.0%} of the moments)"
    about = f"of the {span_name(run.horizon_steps)} went as predicted"
    return f"{phrase_accuracy(true[spoken]):.0%} of its explanations{at} {about}"


def _print_table(
    run: TrainedRun, watched: RecordedRollout, said: Sequence[Explanation], true: Array, console: PlainConsole
) -> None:
    words = spoken_words(watched.moments, said, run.task.phrases)
    rows = spoken_rows(words, said, true)
    left_out = max(0, len(rows) - MOST_ROWS)
    table = _empty_table(run.task, watched, titles(said))
    for row in rows[:FIRST_ROWS] if left_out else rows:
        table.add_row(*row.cells)
    if left_out:
        table.add_row("...")
        for row in rows[FIRST_ROWS + left_out :]:
            table.add_row(*row.cells)
    console.print(table)
    changed = sum(a != b for a, b in zip(words, without_flicker(words), strict=True))
    if left_out or changed:
        console.print(f"Left out: {_left_out(left_out, changed, len(words))}. {SEE_ALL}")


def _empty_table(task: Task, watched: RecordedRollout, names: Sequence[str]) -> Table:
    episode = watched.episode
    outcome = "success" if episode.success else "no success"
    table = Table(box=SIMPLE, title_justify="left", show_edge=False, padding=(0, 1, 0, 0))
    table.title = f"{task.name}: {episode.context}, {len(episode)} steps, {outcome}, return {episode.total_reward:.1f}"
    for number, name in enumerate(names):
        is_phrase = 1 < number < len(names) - 3
        table.add_column(name, no_wrap=not is_phrase, justify="left" if number else "right")
    return table


def _left_out(rows: int, changed: int, steps: int) -> str:
    """What the table does not show."""
    parts = [f"{rows} rows in the middle"] if rows else []
    if changed:
        parts.append(f"phrases that change for at most {FLICKER_STEPS} steps and back ({changed} of {steps} steps)")
    return "; ".join(parts)
