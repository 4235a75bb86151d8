"""One episode in words: rolled out, explained step by step, and printed as a table."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.advice import advice, lines_of, text_of
from ibe_rl.evaluation.run_predictor import predictor_of
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.explain.explainer import ExplainerState, explain
from ibe_rl.ibe.meaning_lines import meaning_lines
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics.quality import episode_scores, outcomes, phrase_accuracy, phrase_hits
from ibe_rl.metrics.verdict import NOT_TOLD, REVERSED, Verdict, in_one_line, verdicts_of, worst, wrong_signs
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, ConfigError, Explanation
from ibe_rl.view.clip import FRAMES_PER_S, Clip
from ibe_rl.view.clip_file import check_clip, write_clip
from ibe_rl.view.film import SILENCE
from ibe_rl.view.sentences import short

NOT_TRUSTED = "(?)"


def check_context(context: str | None, run: TrainedRun) -> None:
    """Refuse a context unknown to the run's environment.

    Raises:
        ConfigError: naming the known contexts, or that there are none.
    """
    if context is not None and not run.task.context_option:
        raise ConfigError(
            f"context={context}: allowed is none, nothing fixes it in this environment (task.context_option)"
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


def refuse_clip(cfg: ExplainConfig) -> None:
    """Refuse a clip where no episode is explained.

    Raises:
        ConfigError: naming the task.
    """
    if cfg.clip is not None and (cfg.task != "episode" or cfg.sweep_dir is not None):
        task = f"task={cfg.task}" if cfg.sweep_dir is None else f"sweep={cfg.sweep_dir}"
        raise ConfigError(f"clip={cfg.clip} with {task}: allowed with it is task=episode, without sweep=")


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


def explainer_state(run: TrainedRun, futures: int = 1, min_confidence: float = 0.0) -> ExplainerState:
    """The explainer of a run: its vocabulary, calibration and settings."""
    return ExplainerState(
        run.mapping, run.horizon_steps, run.task.phrases, run.spans, futures, run.calibration, min_confidence
    )


def explain_rollout(run: TrainedRun, cfg: ExplainConfig) -> tuple[RecordedRollout, list[Explanation]]:
    """Roll out one episode, then explain each of its steps."""
    instructor = make_instructor(stand_in(run.config.instructor), run.task)
    watched = record_rollout(run.make_env(), run.policy, instructor, cfg.seed, cfg.context)
    voice = explainer_state(run, cfg.predictor.futures, cfg.min_confidence)
    with predictor_of(run, cfg.predictor, cfg.seed) as predictor:
        said = explain(watched.moments, run.policy, predictor, voice)
    return watched, said


def print_narration(
    run: TrainedRun, watched: RecordedRollout, said: Sequence[Explanation], console: Console | None = None
) -> None:
    """Print the explanations, one row for consecutive steps with the same words."""
    true = phrase_hits(watched.episode, said, run.mapping, run.task.phrases)
    verdicts = verdicts_of(episode_scores(watched.episode, said, run.task), run.mapping.meanings, run.task)
    console = console or Console(highlight=False)
    console.width = max(console.width, 110)
    for line in _opening(run, verdicts):
        console.print(line, markup=False)
    console.print(_table(run, watched, said, true))
    whose = f"Policy of frame {run.policy_frame:,}, vocabulary of frame {run.mapping_frame:,}."
    if isinstance(run.config.agent, ExternalPolicyConfig):
        whose = f"Agent: {run.config.agent.made_from}; vocabulary from {run.mapping_frame:,} steps."
    console.print(f"{_closing(run, said, true)}; {in_one_line(verdicts)}. {whose}", markup=False)
    if not all(span.trusted for one in said for span in one.all_spans):
        console.print(f"{NOT_TRUSTED}: its predictor does not stand by a path that long.")


def _opening(run: TrainedRun, verdicts: Sequence[Verdict]) -> list[str]:
    """The verdict in plain words, on this episode or else the last refresh, and the meaning of the words."""
    refreshed = verdicts_of(run.scores_of_numbers, run.mapping.meanings, run.task)
    untold = worst(verdicts).why == NOT_TOLD
    lines = ["From this episode it cannot be told whether its words tell which way it goes."] if untold else []
    judged = refreshed if untold and run.scores_of_numbers else verdicts
    if not untold or run.scores_of_numbers:
        lines += lines_of(text_of(judged, run), advice(judged, run))
    if run.scores_of_numbers:
        lines.append(f"At the last refresh, over many episodes, {in_one_line(refreshed)}.")
    wrong = [] if worst(judged).level == REVERSED else wrong_signs(refreshed, run.mapping.meanings, run.task)
    meanings = meaning_lines(run.mapping.meanings, run.task)
    new = [line for line in meanings if not any(line in told for told in lines)]  # may be in the verdict already
    return [*lines, *wrong, *new, ""]


def _closing(run: TrainedRun, said: Sequence[Explanation], true: Array) -> str:
    """Phrase accuracy over the explanations that were given."""
    spoken = np.array([one.known for one in said], bool)
    if not spoken.any():
        return "It said nothing"
    at = "" if spoken.all() else f" (at {spoken.mean():.0%} of the moments)"
    about = f"about its next {run.horizon_steps} steps went as predicted"
    return f"{phrase_accuracy(true[spoken]):.0%} of what it said{at} {about}"


def _spoken(said: Explanation, task: Task) -> list[str]:
    """The phrase of each time span, marked where the predictor does not trust it to the end."""
    spans = said.all_spans
    words = short([one.said for one in spans], task.phrases)
    return [text if one.trusted else f"{text} {NOT_TRUSTED}" for text, one in zip(words, spans, strict=True)]


def _table(run: TrainedRun, watched: RecordedRollout, said: Sequence[Explanation], true: np.ndarray) -> Table:
    episode, words = watched.episode, run.task.phrases
    told = [
        short([phrase(moment.instruction, words)], words)[0] if moment.given else SILENCE for moment in watched.moments
    ]
    outcome = "success" if episode.success else "no success"
    table = Table(box=SIMPLE, title_justify="left", show_edge=False)
    table.title = (
        f"{run.task.name}: {episode.context}, {len(episode)} steps, {outcome}, return {episode.total_reward:.1f}"
    )
    ahead = [f"next {one.horizon_steps} steps" for one in said[0].all_spans]
    for column in ("steps", "is told", *ahead, "number", "sure", "as predicted"):
        table.add_column(column, no_wrap=column not in ahead, justify="right" if column == "steps" else "left")
    spoken = [_spoken(each, run.task) for each in said]
    for (instruction, heard), group in groupby(range(len(said)), key=lambda step: (told[step], spoken[step])):
        steps = list(group)
        span = str(steps[0]) if len(steps) == 1 else f"{steps[0]}-{steps[-1]}"
        table.add_row(span, instruction, *heard, *_figures([said[step] for step in steps], true[steps]))
    return table


def _figures(said: Sequence[Explanation], true: Array) -> tuple[str, str, str]:
    """Expression, confidence and accuracy of steps with the same words; "-" where undefined."""
    meant = said[0].meant
    numbers = " ".join(f"{value:+.2f}" for value in np.mean([one.expression for one in said], axis=0))
    sure = f"{np.mean([one.confidence for one in said]):.0%}" if meant and said[0].calibrated else "-"
    share = phrase_accuracy(true[[one.known for one in said]])
    return numbers if meant else "-", sure, "-" if np.isnan(share) else f"{share:.0%}"
