"""Tables fit the terminal and hold what they are given."""

import re
from typing import Any

from rich.console import Console
from rich.table import Table

from ibe_rl.evaluation.rows import ROW_METRICS
from ibe_rl.evaluation.tables import (
    TABLE_WIDTH,
    changing_table,
    console,
    horizons_table,
    observers_table,
    paired_table,
    quality_table,
    spoken_table,
)

SOME = {"value": -0.98765, "low": -0.99999, "high": -0.91234}


def row(name: str, horizon: int = 60, **found: Any) -> dict[str, Any]:
    return {"explainer": name, "horizon_steps": horizon, **dict.fromkeys(ROW_METRICS, SOME), **found}


def printed(table: Table) -> str:
    shown = Console(width=TABLE_WIDTH)
    with shown.capture() as text:
        shown.print(table)
    return text.get()


def test_the_widest_row_fits():
    sides = {"value": [12, 12], "low": None, "high": None}
    widest = row("baseline:random_clusters", over="refits", left_right=sides, observer_error=dict(SOME, value=12.345))
    text = printed(quality_table([widest, row("ibe:axis_bisecting", left_right=sides)], "what"))
    assert "…" not in text
    assert "random_clusters (all) -.988 (-1.00 -.912)" in text
    assert "12/12" in text
    assert "12.35" in text
    assert max(len(line) for line in text.splitlines()) <= TABLE_WIDTH


def test_what_is_null_stays_empty():
    text = printed(
        quality_table([row("ibe:x", came_true=None, motion_auc={"value": 1.0, "low": None, "high": None})], "")
    )
    assert "ibe:x" in text
    assert "1.00" in text
    assert "None" not in text


def test_horizons_stand_side_by_side():
    rows = [row("ibe:x", steps, motion_auc=dict(SOME, value=steps / 1000)) for steps in (100, 20)]
    text = printed(horizons_table(rows, ["ibe:x"]))
    assert re.search(r"motion_auc +ibe:x +\.020 +\.100", text)
    assert text.index("20") < text.index("100")


def test_the_best_cheap_baseline_has_a_star():
    paired = [
        {"metric": "motion_auc", "horizon_steps": 60, "minus": name, "best_cheap": name == "b", "difference": SOME}
        for name in ("a", "b")
    ] + [{"metric": "motion_auc", "horizon_steps": 20, "minus": "c", "best_cheap": True, "difference": SOME}]
    lines = printed(paired_table(paired, 60)).splitlines()
    assert [line.rstrip().endswith("*") for line in lines if line.strip().startswith(("a ", "b "))] == [False, True]
    assert not any(line.strip().startswith("c ") for line in lines)


def test_own_vocabulary_against_the_first():
    rows = [
        {
            "policy_frame": 2_000,
            "vocabulary_frame": frame,
            "motion_auc": dict(SOME, value=value),
            "refreshed_minus_this": {"motion_auc": dict(SOME, value=0.9 - value)},
        }
        for frame, value in ((500, 0.25), (1_500, 0.9))
    ]
    text = printed(changing_table(rows))
    assert [part in text for part in ("2,000", "500", ".900", ".250", "+.650")] == [True] * 5


def test_who_helps_the_observer_most_comes_first():
    def observed(name: str, error: float | None) -> dict[str, Any]:
        found = dict(SOME, value=error)
        return {"explainer": name, "observer_error": found, "minus_no_explanation": SOME, "minus_paper": None}

    rows = [observed("nobody", None), observed("no_explanation", 7.0), observed("ibe:x", 2.0)]
    lines = printed(observers_table({"episodes": 9, "rows": rows})).splitlines()
    assert "9 approaches" in lines[0]
    found = [line.split()[0] for line in lines if line.strip()]
    assert found[-3:] == ["ibe:x", "no_explanation", "nobody"]


def test_the_console_is_wide_enough_without_a_terminal():
    assert console().width >= TABLE_WIDTH


def test_the_table_step_by_step_fits_and_says_what_was_not_measured():
    row = {"came_true": SOME, "phrase_changes_per_100": SOME, "flicker": {"value": None, "low": None, "high": None}}
    report = {
        "episodes": 10,
        "steps": 2_950,
        "rows": [
            {**row, "explainer": "spoken", "lag_steps": 2.5, "ece": SOME},
            {**row, "explainer": "moment", "lag_steps": None},
            {**row, "explainer": "real", "lag_steps": 0.0},
        ],
    }
    lines = printed(spoken_table(report)).splitlines()
    assert lines[0].strip() == "Step by step: 10 of the episodes, 2,950 steps"
    told = [line.split() for line in lines if "-.988" in line]
    assert told[0][:3] == ["as", "it", "speaks"]
    assert "2.5" in told[0]
    assert (told[1][-1], told[2][-1]) == ("-", "0")
    assert not any("…" in line for line in lines)
