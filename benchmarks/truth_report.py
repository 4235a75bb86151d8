"""Tables of ``benchmarks.truth``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import fill
from ibe_rl.evaluation.tables import SPOKEN_ROWS

DOCS = Path(__file__).parent.parent / "docs"
PAGE, PICTURES = DOCS / "QUALITY.md", DOCS / "img"
BLUE, ORANGE, GREY, GREEN, PINK = "#0072B2", "#E69F00", "#8C8C8C", "#009E73", "#CC79A7"
AGENT_COLOURS = {"ppo": BLUE, "dqn": ORANGE}

NOT_TOLD = "-"
SHOWN = {
    "ibe:axis": "axis (default, as refreshed)",
    "refit:axis": "axis, learnt from nothing",
    "refit:axis_soft": "axis, soft membership",
    "refit:axis_direct": "axis, no clusters",
    "refit:axis_quantile": "axis, equal clusters",
    "refit:axis_bisecting": "axis, halved clusters",
    "refit:axis_mean": "axis, mean instruction",
    "refit:lasso": "lasso of m* on Δs",
    "refit:network": "network from Δs to m*",
    "refit:information": "weighted by information",
    "refit:paper_context": "paper, best of each pad",
    "refit:paper_sign": "paper, signs kept",
    "baseline:paper": "the paper's",
    "baseline:present_velocity": "present velocity",
    "baseline:state_regressor": "regression from the state",
    "baseline:direction_to_goal": "direction to the goal",
    "baseline:last_instruction": "last instruction",
    "baseline:constant": "always the same",
    "baseline:predicted_change": "predicted change itself",
    "baseline:true_future": "true future",
    "words_alone": "the words of axis alone",
    "no_explanation": "no explanation",
    "baseline:flipped": "flipped",
    "baseline:shuffled": "shuffled instructions",
    "baseline:random_clusters": "random clusters",
    "baseline:random_names": "names dealt at random",
    "baseline:another_moment": "another moment's future",
}
"""Explainers in the order of the report, and what they are called in it."""
VOCABULARIES = list(SHOWN)[:13]
COLUMNS = {
    "motion_auc": "`motion_auc`",
    "motion_auc_words": "words alone",
    "motion_auc_disobeyed": "disobeyed",
    "motion_spearman": "`spearman`",
    "vocabulary_loss": "`vocabulary_loss`",
    "came_true": "`came_true`",
    "came_true_voted": "voted",
    "observer_error": "`observer_error` %",
    "ece": "`ece`",
    "size_cv": "`size_cv`",
    "size_max": "largest",
}
SPOKEN_COLUMNS = {
    "came_true": "`came_true`",
    "phrase_changes_per_100": "changes in 100 steps",
    "flicker": "`flicker`",
    "lag_steps": "steps late",
    "ece": "`ece`",
}
OURS, SPOKEN = "ours", "spoken"
GOALS = [
    ("`motion_auc_disobeyed`", OURS, "motion_auc_disobeyed", "≥", 0.99),
    ("`came_true` as spoken", SPOKEN, "came_true", "≥", 0.93),
    ("phrase changes in 100 steps as spoken", SPOKEN, "phrase_changes_per_100", "≤", 2.5),
    ("`flicker` as spoken", SPOKEN, "flicker", "≤", 0.10),
    ("`ece` of what is spoken", SPOKEN, "ece", "≤", 0.02),
    ("`vocabulary_loss`", OURS, "vocabulary_loss", "≤", 0.015),
]
"""Title, explainer (``OURS``: the run's own), metric, direction and bound of its interquartile mean."""
ABOVE_REGRESSOR, LATEST_STEPS = 0.001, 5
OBSERVER_SAVES = {"ppo": 0.6, "dqn": 0.4}
"""Least share of the error of an observer without explanation that the explanation saves."""
OF_SEEDS = [
    ("`motion_auc` above present velocity, interval clear of 0 on every seed", "over_velocity", 1),
    ("the 80 % most confident go as predicted more often", "risk", -1),
]
"""Title, key and sign of differences that are clear of 0 on every seed."""


def insert_tables(together: dict[str, Any], page: Path) -> None:
    """Put the tables between their marks in a page; a page that is not there gets the tables only."""
    parts = [part for agent in together["iqm"] for part in _tables(agent, together)]
    fill(page, {"tables": ["\n\n".join(parts)]}, "benchmarks.truth")


def _tables(agent: str, together: dict[str, Any]) -> list[str]:
    runs = [run for run in together["runs"] if run["agent"] == agent]
    iqm = together["iqm"][agent]
    seeds = ", ".join(f"{run['seed']} ({run['success_rate']:.2f})" for run in runs)
    head = f"### {agent.upper()}, seeds (greedy success at the end) {seeds}"
    aloud = [_step_by_step(iqm)] if SPOKEN in iqm else []
    ages = [_ages(runs)] if all(run["changing_policy"] for run in runs) else []
    return [head, _goals(agent, iqm, runs), _explainers(iqm), *aloud, _each(runs), *ages]


def _goals(agent: str, iqm: dict[str, Any], runs: list[dict[str, Any]]) -> str:
    rows = ["| number to reach | IQM [95 %] | each seed | |", "|---|---|---|---|", _above_regressor(runs)]
    rows += [_goal(*goal, iqm, runs) for goal in GOALS]
    rows += [_lag(runs), _saved(agent, iqm, runs)]
    rows += [_paired_row(title, [run[key] for run in runs], sign) for title, key, sign in OF_SEEDS]
    for title, key in (("without explanation", "minus_no_explanation"), ("with the paper's", "minus_paper")):
        less = [run["observers"][run["ours"]][key] for run in runs]
        rows.append(_paired_row(f"observer's error less than {title}", less, -1))
    sides = [run["left_right"] for run in runs]
    even = all(abs(left - right) <= 1 for left, right in sides)
    rows.append(f"| expressions left / right, ± 1 | | {' '.join(f'{a}/{b}' for a, b in sides)} | {_word(even)} |")
    return "\n".join(rows)


def _above_regressor(runs: list[dict[str, Any]]) -> str:
    """By its value, not by its interval: on every seed so much above."""
    above = [run["over_regressor"] for run in runs]
    reached = [one["value"] >= ABOVE_REGRESSOR for one in above]
    title = f"`motion_auc` above the regression from the state by {ABOVE_REGRESSOR:g} on every seed"
    each = " ".join(map(_signed, above))
    return f"| {title} | {sum(reached)} of {len(reached)} seeds | {each} | {_word(all(reached))} |"


def _goal(
    title: str, explainer: str, metric: str, sign: str, bound: float, iqm: dict[str, Any], runs: list[dict[str, Any]]
) -> str:
    """A row of ``GOALS``; of a metric that too many runs lack, nothing is said."""
    name = runs[0][OURS] if explainer == OURS else explainer
    told = iqm.get(name, {}).get(metric)
    reached = told and (told["value"] >= bound if sign == "≥" else told["value"] <= bound)
    each = " ".join(_short(run["values"].get(name, {}).get(metric)) for run in runs)
    return f"| {title} {sign} {bound:g} | {_cell(told)} | {each} | {NOT_TOLD if told is None else _word(reached)} |"


def _lag(runs: list[dict[str, Any]]) -> str:
    steps = [run["values"].get(SPOKEN, {}).get("lag_steps") for run in runs]
    known = [one for one in steps if one is not None]
    middle = float(np.median(known)) if len(known) == len(steps) else None
    each = " ".join(NOT_TOLD if one is None else f"{one:g}" for one in steps)
    told = (NOT_TOLD, NOT_TOLD) if middle is None else (f"median {middle:g}", _word(middle <= LATEST_STEPS))
    return f"| steps late as spoken ≤ {LATEST_STEPS}, median of the seeds | {told[0]} | {each} | {told[1]} |"


def _saved(agent: str, iqm: dict[str, Any], runs: list[dict[str, Any]]) -> str:
    """How much smaller the observer's error is than without explanation."""
    names, goal = (runs[0][OURS], "no_explanation"), OBSERVER_SAVES[agent]
    ours, without = (iqm[name]["observer_error"]["value"] for name in names)
    pairs = [[run["observers"][name]["observer_error"]["value"] for name in names] for run in runs]
    each = " ".join(f"{one:.2f}/{other:.2f}" for one, other in pairs)
    share = 1 - ours / without
    title = f"observer's error at least {goal:.0%} less than without".replace("%", " %")
    return f"| {title} | {share:.0%} less | {each} | {_word(share >= goal)} |"


def _paired_row(title: str, found: list[dict[str, Any]], sign: int) -> str:
    bounds = [each["low"] if sign > 0 else each["high"] for each in found]
    clear = [bound is not None and sign * bound > 0 for bound in bounds]
    each = " ".join(_signed(one) for one in found)
    return f"| {title} | {sum(clear)} of {len(clear)} seeds | {each} | {_word(all(clear))} |"


def _word(reached: bool) -> str:
    return "reached" if reached else "**no**"


def _explainers(iqm: dict[str, Any]) -> str:
    rows = [f"| said by | {' | '.join(COLUMNS.values())} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for name, title in SHOWN.items():
        if name in iqm:
            cells = [_cell(iqm[name].get(metric)) for metric in COLUMNS]
            rows.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _step_by_step(iqm: dict[str, Any]) -> str:
    """What is spoken, what each moment alone says, and what came true."""
    rows = [f"| step by step | {' | '.join(SPOKEN_COLUMNS.values())} |", "|---" * (len(SPOKEN_COLUMNS) + 1) + "|"]
    for name, title in SPOKEN_ROWS.items():
        rows.append(f"| {title} | {' | '.join(_cell(iqm[name][metric]) for metric in SPOKEN_COLUMNS)} |")
    return "\n".join(rows)


def _each(runs: list[dict[str, Any]]) -> str:
    quantiles = [np.nanquantile(np.array(run["shuffled"], float), [0.05, 0.5, 0.95]) for run in runs]
    text = "; ".join(
        f"seed {run['seed']}: {a:.2f} **{b:.2f}** {c:.2f}" for run, (a, b, c) in zip(runs, quantiles, strict=True)
    )
    return f"Instructions shuffled by whole episodes, `motion_auc` of the refits, 5 % **median** 95 %: {text}."


def _ages(runs: list[dict[str, Any]]) -> str:
    """What the last policy loses in the first vocabulary, and in the one before the last."""
    rows = [
        "| seed | own vocabulary | the first one | own minus first | went as predicted, own minus first |",
        "|---|---|---|---|---|",
    ]
    for run in runs:
        ages = run["changing_policy"]
        less = ages[0]["refreshed_minus_this"]
        auc, true = (_signed(less[metric]) for metric in ("motion_auc", "came_true"))
        own, first = (_short(row["motion_auc"]["value"]) for row in (ages[-1], ages[0]))
        rows.append(f"| {run['seed']} | {own} | {first} | {auc} | {true} |")
    return "The last policy in its own vocabulary and in that of the first refresh (`motion_auc`):\n\n" + "\n".join(
        rows
    )


def _signed(told: dict[str, Any]) -> str:
    """With its sign and interval; the value is None where a vocabulary did not know what its words mean."""
    if told["value"] is None:
        return NOT_TOLD
    return f"{told['value']:+.3f} [{told['low']:+.3f}, {told['high']:+.3f}]"


def _cell(told: dict[str, float] | None) -> str:
    if told is None:
        return NOT_TOLD
    of_some = f" ({told['runs']} runs)" if "runs" in told else ""
    return f"{_short(told['value'])} [{_short(told['low'])}, {_short(told['high'])}]{of_some}"


def _short(value: float | None) -> str:
    return NOT_TOLD if value is None else f"{value:.3f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.2f}"
