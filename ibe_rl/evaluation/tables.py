"""Tables in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.evaluation.rows import own_columns
from ibe_rl.runtime.console import PlainConsole

TABLE_WIDTH = 110
SHORT = {
    "motion_auc": "motion AUC",
    "motion_auc_disobeyed": "disob.",
    "motion_auc_hard": "hard",
    "motion_spearman": "rank",
    "came_true": "as p.",
    "came_true_voted": "voted",
    "instruction_f1": "F1",
    "ece": "ECE",
    "risk_at_80": "risk80",
    "size_cv": "CV",
    "left_right": "l/r",
    "observer_error": "obs. %",
}
"""Metric to its column heading."""
OF_A_NUMBER = (
    *("motion_auc", "motion_auc_disobeyed", "motion_auc_hard", "motion_spearman"),
    *("vocabulary_loss", "instruction_f1", "left_right"),
)
WITH_INTERVAL = ("motion_auc",)
OVER_HORIZONS = ("motion_auc", "motion_auc_disobeyed", "motion_spearman", "came_true")
CALLED = {"came_true": "as predicted"}
"""Display names of metrics that differ from their names in the files."""
WHAT_IF_COLUMNS = {
    "what_if_came_true": "as foretold",
    "what_if_came_true_other": "where it would change",
    "what_if_ece": "ECE",
    "listens": "listens",
}
"""Metric of an answer to its column heading."""
SPOKEN_ROWS = {"spoken": "as it speaks", "moment": "each moment alone", "real": "what came true"}
"""Rows of the table of explanations step by step."""
OBSERVER_DIFFERENCES = ("minus_no_explanation", "minus_paper")


def console() -> PlainConsole:
    """The console for tables, wide enough for them if the terminal's width is unknown."""
    shown = PlainConsole()
    shown.width = max(shown.width, TABLE_WIDTH)
    return shown


def quality_table(rows: Sequence[dict[str, Any]], title: str) -> Table:
    """One row per explainer at one horizon."""
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False, pad_edge=False, padding=0)
    table.add_column("explainer", no_wrap=True)
    for metric, short in SHORT.items():
        table.add_column(short, no_wrap=True, justify="right")
        assert metric in rows[0]
    for row in rows:
        cells = [_cell(row[metric], metric in WITH_INTERVAL) for metric in SHORT]
        ours = row["explainer"].startswith("ibe:")
        table.add_row(_name(row), *cells, style="bold" if ours else None)
    return table


def numbers_table(rows: Sequence[dict[str, Any]]) -> Table:
    """All explainers at one horizon, for each number of the instruction."""
    title = "Each component of the instruction"
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False, padding=(0, 1))
    table.add_column("number", no_wrap=True)
    table.add_column("explainer", no_wrap=True)
    for metric in OF_A_NUMBER:
        table.add_column(SHORT.get(metric, metric), no_wrap=True, justify="right")
    for number in range(len(rows[0]["each"])):
        for row in rows:
            scores = row["each"][number]
            cells = [_cell(scores[metric], metric in WITH_INTERVAL) for metric in OF_A_NUMBER]
            ours = row["explainer"].startswith("ibe:")
            table.add_row(scores["number"], _name(row), *cells, style="bold" if ours else None)
    return table


def own_table(rows: Sequence[dict[str, Any]]) -> Table:
    """The metrics of one's own, of all explainers at one horizon."""
    table = Table(box=SIMPLE, title="Metrics of your own", title_justify="left", show_edge=False)
    table.add_column("explainer", no_wrap=True)
    metrics = own_columns(rows[0])
    for metric in metrics:
        table.add_column(metric, no_wrap=True, justify="right")
    for row in rows:
        ours = row["explainer"].startswith("ibe:")
        table.add_row(_name(row), *(_cell(row[metric], True) for metric in metrics), style="bold" if ours else None)
    return table


def horizons_table(rows: Sequence[dict[str, Any]], explainers: Sequence[str]) -> Table:
    """Some explainers over all horizons."""
    horizons = sorted({row["horizon_steps"] for row in rows})
    table = Table(box=SIMPLE, title="Over the horizons, in steps", title_justify="left", show_edge=False)
    table.add_column("metric", no_wrap=True)
    table.add_column("explainer", no_wrap=True)
    for horizon in horizons:
        table.add_column(str(horizon), justify="right", no_wrap=True)
    found = {(row["explainer"], row["horizon_steps"]): row for row in rows}
    for metric in (*OVER_HORIZONS, *own_columns(name for row in rows for name in row)):
        for name in explainers:
            cells = [_cell(found[name, horizon].get(metric)) for horizon in horizons]
            if any(cells):
                table.add_row(CALLED.get(metric, metric), _name({"explainer": name}), *cells)
    return table


def paired_table(paired: Sequence[dict[str, Any]], horizon_steps: int) -> Table:
    """Paired differences of the explainer to cheaper ones and the paper's."""
    metrics = list(dict.fromkeys(each["metric"] for each in paired))
    title = f"Explanation minus baseline over {horizon_steps} steps, paired (*: the best without a simulator)"
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False)
    table.add_column("minus", no_wrap=True)
    for metric in metrics:
        table.add_column(metric, justify="right", no_wrap=True)
    here = {(each["minus"], each["metric"]): each for each in paired if each["horizon_steps"] == horizon_steps}
    for name in dict.fromkeys(minus for minus, _ in here):
        cells = [here[name, metric] for metric in metrics]
        stars = ["*" if each["best_cheap"] else " " for each in cells]
        differences = [_cell(each["difference"], True, "+") + star for each, star in zip(cells, stars, strict=True)]
        table.add_row(_name({"explainer": name}), *differences)
    return table


def observers_table(observers: dict[str, Any]) -> Table:
    """Prediction error of the simulated observer with each explainer, the best first."""
    title = f"Where will it end? A simulated observer at {observers['episodes']} approaches, error in %"
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False)
    for column in ("explanation", "error", "minus no explanation", "minus paper"):
        table.add_column(column, justify="left" if column == "explanation" else "right", no_wrap=True)
    for row in sorted(observers["rows"], key=lambda row: _known_first(row["observer_error"]["value"])):
        cells = (_cell(row["observer_error"], True), *(_cell(row[key], True, "+") for key in OBSERVER_DIFFERENCES))
        table.add_row(_name(row), *cells)
    return table


def what_if_table(report: dict[str, Any]) -> Table:
    """What it would do if it were told each value: foretold, and in copies really given."""
    title = (
        f"What if it were told something else for {report['horizon_steps']} steps? {len(report['values'])} values in "
        f"copies of {report['moments']:,} moments"
    )
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False)
    table.add_column("explainer", no_wrap=True)
    for column in WHAT_IF_COLUMNS.values():
        table.add_column(column, justify="right", no_wrap=True)
    for row in report["rows"]:
        ours = row["explainer"].startswith("ibe:")
        cells = [_cell(row.get(metric), True) for metric in WHAT_IF_COLUMNS]
        table.add_row(_name(row), *cells, style="bold" if ours else None)
    return table


def spoken_table(report: dict[str, Any]) -> Table:
    """Does it hold still? What is spoken, what each moment alone says, and what came true."""
    title = f"Step by step: {report['episodes']} of the episodes, {report['steps']:,} steps"
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False)
    for column in ("phrase", "came true", "changes in 100 steps", "undone", "steps late", "ECE"):
        table.add_column(column, justify="left" if column == "phrase" else "right", no_wrap=True)
    for row in report["rows"]:
        late = "-" if row["lag_steps"] is None else f"{row['lag_steps']:g}"
        cells = [_cell(row[metric], True) for metric in ("came_true", "phrase_changes_per_100", "flicker")]
        table.add_row(SPOKEN_ROWS[row["explainer"]], *cells, late, _cell(row.get("ece"), True))
    return table


def changing_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Each policy in its own vocabulary and in the first one, with the difference."""
    title = "A changing policy: motion AUC in its own vocabulary and the first one"
    table = Table(box=SIMPLE, title=title, title_justify="left", show_edge=False)
    for column in ("policy of frame", "its own", "of frame", "the first", "own minus first"):
        table.add_column(column, justify="right", no_wrap=True)
    for frame in dict.fromkeys(row["policy_frame"] for row in rows):
        ages = [row for row in rows if row["policy_frame"] == frame]
        first, own = ages[0], ages[-1]
        gain = _cell(first["refreshed_minus_this"]["motion_auc"], True, "+") if len(ages) > 1 else ""
        cells = _cell(own["motion_auc"], True), f"{first['vocabulary_frame']:,}", _cell(first["motion_auc"], True)
        table.add_row(f"{frame:,}", *cells, gain)
    return table


def print_rows(rows: Sequence[dict[str, Any]], title: str) -> None:
    """Print all explainers at one horizon; with several numbers also for each number."""
    shown = console()
    shown.print(quality_table(rows, title))
    shown.print("as p.: share that went as predicted, voted: by the majority of the futures")
    if "each" in rows[0]:
        shown.print(numbers_table(rows))
    if own_columns(rows[0]):
        shown.print(own_table(rows))


def print_observers(observers: dict[str, Any]) -> None:
    """Print the results of the simulated observer, if there are any."""
    if observers["rows"]:
        console().print(observers_table(observers))


BESIDE_EXACT = {
    "equal": "same",
    "equal_trusted": "if trusted",
    "trusted": "trusted",
    "motion_auc": "AUC",
    "motion_auc_minus_exact": "minus exact",
    "motion_auc_disobeyed": "disob.",
    "came_true_voted": "as pred.",
    "ece": "ECE",
    "observer_error": "obs.%",
}
"""Metric of a predictor to its column heading."""


def predictors_table(rows: Sequence[dict[str, Any]], title: str) -> Table:
    """One row per predictor at one refresh."""
    table = Table(box=SIMPLE, title=f"Predictors: {title}", title_justify="left", show_edge=False, padding=0)
    table.add_column("predictor", no_wrap=True)
    for short in BESIDE_EXACT.values():
        table.add_column(short, no_wrap=True, justify="right")
    for row in rows:
        signs = {name: "+" if name.endswith("_minus_exact") else "" for name in BESIDE_EXACT}
        cells = [_cell(row[name], name in ("equal", "motion_auc_minus_exact"), signs[name]) for name in BESIDE_EXACT]
        table.add_row(row["predictor"], *cells)
    return table


def predictors_over_training(rows: Sequence[dict[str, Any]]) -> Table:
    """Phrase agreement and motion AUC of each predictor over the training."""
    names = list(dict.fromkeys(row["predictor"] for row in rows))
    table = Table(box=SIMPLE, title="Same phrase / motion AUC over the training", title_justify="left", show_edge=False)
    for column in ("frame", *names):
        table.add_column(column, no_wrap=True, justify="right")
    found = {(row["frame"], row["predictor"]): row for row in rows}
    for frame in dict.fromkeys(row["frame"] for row in rows):
        here = [found.get((frame, name)) for name in names]
        cells = [f"{_cell(row['equal'])} / {_cell(row['motion_auc'])}" if row else "" for row in here]
        table.add_row(f"{frame:,}", *cells)
    return table


def _known_first(value: float | None) -> tuple[bool, float]:
    return value is None, value or 0.0


def _name(row: dict[str, Any]) -> str:
    name = str(row["explainer"].removeprefix("baseline:"))
    return f"{name} (all)" if row.get("over") == "refits" else name


def _cell(estimate: dict[str, Any] | None, interval: bool = False, sign: str = "") -> str:
    if estimate is None or estimate["value"] is None:
        return ""
    if isinstance(estimate["value"], list):
        return "/".join(str(value) for value in estimate["value"])
    text = _number(estimate["value"], sign)
    if not interval or estimate["low"] is None:
        return text
    return f"{text} ({_number(estimate['low'], sign)} {_number(estimate['high'], sign)})"


def _number(value: float, sign: str) -> str:
    text = f"{value:{sign}.{3 if abs(value) < 0.9995 else 2}f}"
    return text.replace("0.", ".", 1) if abs(value) < 1 else text
