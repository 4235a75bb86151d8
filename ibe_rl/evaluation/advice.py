"""The verdict of an evaluation or of an episode in plain words, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe.meaning_lines import meaning_lines, positive_phrase
from ibe_rl.metrics.verdict import (
    CHANCE,
    GOOD,
    NO_MEANING,
    NOT_MEASURED,
    REVERSED,
    Verdict,
    in_one_line,
    is_meant,
    short_number,
    verdict,
    worst,
    wrong_signs,
)
from ibe_rl.storage.run_folder import EVALUATION, read_json

ECHO = "baseline:last_instruction"
_AS_REFRESHED = "as_refreshed"
"""In a comparison: the run's own vocabulary."""
ASK_FOR_IT = (
    "a reward for following the instruction: obedience.judge=oracle in training, or a goal of the environment that "
    "the instruction is about"
)


def verdict_of(rows: Sequence[Mapping[str, Any]], ours: str, run: TrainedRun) -> dict[str, Any]:
    """The verdict of an evaluation, as stored in quality.json.

    Args:
        rows: of the evaluation, at all horizons.
        ours: the evaluated explainer.
        run: the evaluated run.

    Returns:
        ``level``, ``text``, ``motion_auc`` with its interval, ``chance``, ``echo`` (the ``motion_auc`` of the last
        instruction) and ``advice``; of several numbers, that with the worst verdict.
    """
    verdicts = verdicts_from(rows, ours, run)
    least = worst(verdicts)
    low, high = least.interval or (None, None)
    return {
        "level": least.level,
        "text": text_of(verdicts, run),
        "motion_auc": {"value": _or_none(least.motion_auc), "low": low, "high": high},
        "chance": CHANCE,
        "echo": _or_none(least.echo_auc),
        "advice": advice(verdicts, run, rows, ours),
        **({"number": least.number} if least.number else {}),
    }


def verdicts_from(rows: Sequence[Mapping[str, Any]], ours: str, run: TrainedRun) -> list[Verdict]:
    """The verdict on each number of the instruction, at the run's own horizon."""
    own = {row["explainer"]: row for row in rows if row["horizon_steps"] == run.horizon_steps}
    names, meanings = run.task.number_names, run.mapping.meanings
    found = []
    for number, name in enumerate(names):
        scores, echo = (_of_number(own.get(each), number) for each in (ours, ECHO))
        known = is_meant(meanings, number)
        interval = None if scores["low"] is None else (float(scores["low"]), float(scores["high"]))
        auc, echo_auc = (math.nan if each["value"] is None else float(each["value"]) for each in (scores, echo))
        found.append(verdict(auc, echo_auc, known, interval, name if len(names) > 1 else ""))
    return found


def _of_number(row: Mapping[str, Any] | None, number: int) -> Mapping[str, Any]:
    if row is None:
        return dict.fromkeys(("value", "low", "high"))
    scores: Mapping[str, Any] = row["each"][number]["motion_auc"] if "each" in row else row["motion_auc"]
    return scores


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def text_of(verdicts: Sequence[Verdict], run: TrainedRun) -> str:
    """The worst verdict over the numbers, in plain words."""
    level = worst(verdicts).level
    number = verdicts.index(worst(verdicts))
    name = run.task.number_names[number]
    words = "a word" if run.task.words is not None else positive_phrase(run.task.phrases[number])
    least = verdicts[number]
    if level == REVERSED:
        return f"REVERSED: {words} is said when {name} falls; {in_one_line(verdicts)}."
    if least.why == NO_MEANING:
        lines = meaning_lines(run.mapping.meanings, run.task)
        return f"UNKNOWN: {lines[number] if run.task.words is None else '; '.join(lines)}."
    if least.why == NOT_MEASURED:
        return f"UNKNOWN: the AUC for the direction of motion cannot be measured, {name} did not move both ways."
    return f"{level.upper()}: {in_one_line(verdicts)}."


def advice(
    verdicts: Sequence[Verdict], run: TrainedRun, rows: Sequence[Mapping[str, Any]] = (), ours: str = ""
) -> list[str]:
    """What to do about a verdict, the likeliest remedy first; empty if it is good.

    Args:
        verdicts: of each number.
        run: its folder may hold a comparison of mappings.
        rows: of an evaluation, to find a better horizon.
        ours: the evaluated explainer in ``rows``.
    """
    least = worst(verdicts)
    if least.level == GOOD:
        return []
    if least.why == NOT_MEASURED:
        return ["judge more or longer episodes (evaluate.episodes), or make env.task.explained_band smaller"]
    ask = [] if run.task.words is not None else [ASK_FOR_IT]  # which compares numbers
    if least.why == NO_MEANING:
        return ask
    signs = _check_sign(verdicts, run) if least.level == REVERSED and run.task.words is None else []
    return [*signs, _compared(run, least), *_horizons(rows, ours, run), *ask]


def _check_sign(verdicts: Sequence[Verdict], run: TrainedRun) -> list[str]:
    return [
        *wrong_signs(verdicts, run.mapping.meanings, run.task),
        "either env.task.explained has the wrong sign (the dimension must rise where the rule says +1: flip the sign "
        "of the rule or of the dimension), or the words were learnt reversed",
    ]


def _compared(run: TrainedRun, ours: Verdict) -> str:
    """The best mapping that ``task=compare`` found for this run, or the advice to run it."""
    paths = sorted((run.folder / EVALUATION).glob("compare*.json"))
    found = {name: auc for path in paths for name, auc in _judged_in(path).items() if name != _AS_REFRESHED}
    if not found:
        return "another mapping: task=compare learns every kind from the same log and judges it"
    name, auc = max(found.items(), key=lambda one: one[1])
    if not auc > ours.motion_auc:
        return f"no other mapping: of those that task=compare judged the best, {name}, has {short_number(auc)}"
    return f"another mapping: task=compare found {short_number(auc)} with mapping={name}"


def _judged_in(path: Path) -> dict[str, float]:
    """Mapping to motion AUC of a comparison; empty for an unreadable file, as this is only advice."""
    try:
        rows = [(str(row["explainer"]), row["motion_auc"]["value"]) for row in read_json(path)["rows"]]
        learnt = [(name, value) for name, value in rows if name.startswith("ibe:") or name == "baseline:paper"]
        return {name.partition(":")[2]: float(value) for name, value in learnt if value is not None}
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        return {}


def _horizons(rows: Sequence[Mapping[str, Any]], ours: str, run: TrainedRun) -> list[str]:
    """A clearly better horizon: its interval lies above that of the run's own."""
    scores = {row["horizon_steps"]: row["motion_auc"] for row in rows if row["explainer"] == ours}
    own = scores.pop(run.horizon_steps, None)
    if own is None or own["high"] is None:
        return []
    better = {steps: each for steps, each in scores.items() if each["low"] is not None and each["low"] > own["high"]}
    if not better:
        return []
    best = max(better, key=lambda steps: float(better[steps]["value"]))
    return [f"another horizon: mapping.horizon_steps={best} has {short_number(float(better[best]['value']))}"]


def lines_of(text: str, steps: Sequence[str]) -> list[str]:
    """The printed lines of a verdict: the text, then what to do."""
    return [text, *(f"  what to do: {step}" if number == 0 else f"  or {step}" for number, step in enumerate(steps))]
