"""The pure parts of the benchmarks, by hand, and the smallest real measurement; without Stable-Baselines3."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import __main__ as program
from benchmarks import (
    explaining,
    explanations,
    faults,
    frames,
    ours,
    overhead,
    refilling,
    refreshes,
    skill,
    starting,
    sweep,
)
from benchmarks.child import measure
from benchmarks.curves import Curve
from benchmarks.how import HOW, TITLES
from benchmarks.levels import Measured, Point, figure, median, plain, reached, to_level
from benchmarks.plan import FORMS, ROOT, Plan, make_plan
from benchmarks.records import load, replace_part, save, stamp
from benchmarks.report import cells, document, table
from ibe_rl.storage.log import TrajectoryLog

pytestmark = pytest.mark.slow

RATES = {"batched": 8.0, "what_if": 2.0, "naive": 2.0, "engine": 16.0, "live_ms": 5.0, "live_what_if_ms": 15.0}
CLIMB = [Point(100 * n, 10.0 * n, success) for n, success in enumerate((0.0, 0.9, 0.5, 0.83, 0.96, 0.9), start=1)]
PARTS = ("skill-ppo", "skill-dqn", "frames", "explanations", "setup", "refresh", "overhead", "faults", "sweep")
ABOUT = {"date": "2026-01-02 03:04 UTC", "versions": {"python": "3.11.1"}}
MACHINE = {"processor": "A processor", "cores": 2, "memory_gb": 8.0}


def record(part: str = "frames", name: str = "frames_collect", **changed: Any) -> dict[str, Any]:
    made = figure(name, "frames/s", plain([900, 1000, 1100]), plain([400, 500, 600]))
    return {"part": part, **made, "how": f"How {name} was measured.", **ABOUT, "machine": MACHINE, **changed}


def training_run() -> ours.TrainingRun:
    times = dict.fromkeys(frames.TIMES, 1.0) | {"collect": 5.0, "learn": 7.0}
    return ours.TrainingRun({"frames": 1800, "wall_s": 20.0, "time_s": times, "success_rate": 0.9}, CLIMB)


def test_level_counts_at_the_second_of_two_in_a_row():
    assert reached(CLIMB, 0.83) == CLIMB[4]  # .9 alone was no two in a row
    assert reached(CLIMB, 0.9) == CLIMB[5]
    assert reached(CLIMB, 0.95) is None
    assert reached([], 0.5) is None


def test_run_without_the_level_counts_as_long_as_it_flew():
    assert to_level(CLIMB, 0.83, "seconds") == Measured(50.0)
    assert to_level(CLIMB, 0.83, "frames") == Measured(500)
    assert to_level(CLIMB, 0.95, "seconds") == Measured(60.0, reached=False)


@pytest.mark.parametrize(
    ("measured", "expected"),
    [
        ([Measured(1), Measured(2), Measured(9)], Measured(2)),
        ([Measured(1), Measured(2), Measured(9, False)], Measured(2)),  # 9 or more: the median is 2 in any case
        ([Measured(1), Measured(2, False), Measured(9)], Measured(2, False)),
        ([Measured(1, False), Measured(2), Measured(9)], Measured(2, False)),  # if it was 5, the median would be 5
        ([Measured(1), Measured(3, False)], Measured(2, False)),
    ],
)
def test_median_says_when_it_is_a_lower_bound(measured: list[Measured], expected: Measured):
    assert median(measured) == expected


def test_median_of_nothing_is_not_a_number():
    assert math.isnan(median([]).value)


def test_figure_is_a_ratio_of_medians():
    made = figure("a", "s", plain([2, 4, 6]), plain([8]))
    assert (made["ours"], made["other"], made["ratio"], made["at_least"]) == (4, 8, 0.5, [])
    assert made["repeats"]["ours"][0] == {"value": 2.0, "reached": True}


def test_figure_without_a_counterpart_has_no_ratio():
    made = figure("a", "s", plain([2, 4, 6]), what="min")
    assert (made["ours"], made["other"], made["ratio"]) == (2, None, None)


def test_the_worst_is_a_lower_bound_if_any_run_never_got_there():
    made = figure("a", "s", [Measured(2), Measured(9)], [Measured(5, False), Measured(18)], what="max")
    assert (made["ours"], made["other"], made["ratio"], made["at_least"]) == (9, 18, 0.5, ["other"])


def test_figure_does_not_divide_by_zero():
    assert figure("a", "s", plain([1]), plain([0]))["ratio"] is None


@pytest.mark.parametrize(
    ("ours_reached", "other_reached", "shown"),
    [
        (True, True, ("2", "4", "0.5")),
        (True, False, ("2", "> 4", "< 0.5")),
        (False, True, ("> 2", "4", "> 0.5")),
        (False, False, ("> 2", "> 4", "-")),
    ],
)
def test_lower_bounds_are_shown_as_such(ours_reached: bool, other_reached: bool, shown: tuple[str, str, str]):
    made = figure("a", "s", [Measured(2, ours_reached)], [Measured(4, other_reached)])
    assert cells(made) == ["a", shown[0], shown[1], "s", shown[2], "1"]


def test_one_part_replaces_its_own_records_only():
    old = [record("skill-ppo", "a"), record("frames", "b"), record("frames", "c"), record("overhead", "d")]
    merged = replace_part(old, "frames", [record("frames", "e")], PARTS)
    assert [made["name"] for made in merged] == ["a", "e", "d"]
    merged = replace_part(merged, "skill-dqn", [record("skill-dqn", "f")], PARTS)
    assert [made["name"] for made in merged] == ["a", "f", "e", "d"]


def test_records_come_back_from_their_file(tmp_path: Path):
    path = tmp_path / "new" / "results.json"
    assert load(path) == []
    save(path, [record()])
    assert load(path) == [record()]


def test_file_of_something_else_is_refused(tmp_path: Path):
    (tmp_path / "results.json").write_text("{}")
    with pytest.raises(ValueError, match=r"results\.json: not a list of records"):
        load(tmp_path / "results.json")


def test_stamp_names_no_machine():
    made = stamp("frames", [figure("a", "s")])[0]
    assert (made["part"], made["machine"].keys()) == ("frames", {"processor", "cores", "memory_gb"})
    assert {"python", "torch"} <= made["versions"].keys()


def test_document_is_made_from_the_records():
    text = document([record(), record("overhead", "overhead_ibe")], "img/curves.png")
    assert "| frames_collect | 1,000 | 500 | frames/s | 2 | 3 |" in text
    assert "- `overhead_ibe`: How overhead_ibe was measured." in text  # as its record says, whatever is said today
    assert "- frames: 2026-01-02 03:04 UTC; overhead: 2026-01-02 03:04 UTC\n  on A processor, 2 cores, 8.0 GB;" in text
    assert "(img/curves.png)" in text
    assert "Learning curves" not in document([record()])


def test_the_records_of_the_repository_can_be_shown():
    records = load(ROOT / "benchmarks" / "results.json")
    assert document(records).count("\n| ") == len(records) + len({one["part"] for one in records})


def test_terminal_shows_every_record():
    assert table([record(), record("overhead", "overhead_ibe")]).row_count == 2


def test_every_figure_says_how_it_was_measured():
    run, curve = training_run(), Curve(CLIMB, 20.0, 0.9)
    found = [
        *skill.figures("ppo", [dict.fromkeys(("ours", "rewarded", "lean", "gymnasium"), curve)]),
        *skill.figures("dqn", [dict.fromkeys(("ours", "lean"), curve)]),
        *frames.figures([run], {name: [1.0] for name in frames.RATES}),
        *starting.figures([dict.fromkeys(starting.PARTS_S, 1.0)]),
        *explanations.figures([RATES | {"game_frame_ms": 20}]),
        *refreshes.figures({name: [{"seconds": 1.0, "mb": 2.0}] for name in refreshes.COMPARED}),
        *overhead.figures({name: [run] for name in (*overhead.SWITCHES, "default")}),
        *sweep.figures({1: [1000.0], 2: [1800.0]}),
        *faults.figures({name: [(1.0, 2.0)] for name in (*faults.FAULTS, *faults.FROM_THE_START)}),
    ]
    assert {made["name"] for made in found} == HOW.keys() - {"sb3_dummy_frames", "sb3_subproc_frames"}
    assert tuple(TITLES) == tuple(program.PARTS) == PARTS


def test_rate_and_shares_of_a_run():
    run = training_run()
    assert run.frames_per_s() == 1800 / 18  # without set-up and evaluation
    assert run.share("collect", "learn") == pytest.approx(12 / 20)


def test_evaluations_are_read_from_the_metrics(tmp_path: Path):
    path = tmp_path / "metrics.csv"
    path.write_text(
        "frames,time/setup,time/learn,time/eval,eval/success_rate\n100,1,2,0,\n200,1,3.5,40,0.25\n300,1,5,40,\n"
    )
    with path.open() as stream:
        assert ours.read_points(list(csv.DictReader(stream))) == [Point(200, 4.5, 0.25)]


def test_rates_before_and_after_a_fault_leave_out_setup_and_evaluations():
    seconds = [(100, 9, 1, 0), (200, 9, 2, 0), (300, 9, 3, 7), (500, 9, 7, 7)]
    rows = [
        {"frames": str(f), "time/setup": str(s), "time/learn": str(t), "time/eval": str(e)} for f, s, t, e in seconds
    ]
    assert faults.rates(rows, 2) == (100, 50)


def test_faults_from_the_start_are_held_against_an_undisturbed_run():
    found = {name: [(100.0, 200.0)] for name in (*faults.FAULTS, *faults.FROM_THE_START)}
    ratios = {made["name"]: made["ratio"] for made in faults.figures(found | {"none": [(90.0, 180.0)]})}
    assert ratios["faults_killed"] == 2
    assert ratios["faults_port_taken"] == pytest.approx(200 / 180)


def small_plan(folder: Path, fault_frames: int) -> Plan:
    plan = make_plan(replace(FORMS["quick"], repeats=1, output=folder))
    sizes = replace(plan.sizes, overrides=(*plan.sizes.overrides, "collect.processes=1"), fault_frames=fault_frames)
    return replace(plan, sizes=sizes)


def test_a_fault_is_really_brought_about(tmp_path: Path):
    plan = small_plan(tmp_path, 8000)
    assert all(rate > 0 for rate in faults.rate(plan, 0, "killed"))


def test_a_fault_without_its_warning_is_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(faults.WARNING, "none", "never said")
    monkeypatch.setattr(faults, "SCRIPT", "print('the run is in a folder')")
    with pytest.raises(RuntimeError, match=r"(?s)train\.py with none ended with 0.*the run is in"):
        faults.rate(small_plan(tmp_path, 2000), 0, "none")


def test_output_folder_takes_everything(tmp_path: Path):
    plan = make_plan(replace(FORMS["quick"], output=tmp_path))
    assert {path.parent for path in (plan.results, plan.curves, plan.document, plan.picture)} == {tmp_path}
    assert make_plan(FORMS["full"]).document == ROOT / "docs" / "BENCHMARKS.md"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--short", "--quick"], "argument --quick: not allowed with argument --short"),
        (["speed"], "PART=speed: allowed is one of skill-ppo,"),
        (["refresh", "--repeats", "0"], "--repeats=0: allowed is at least 1"),
        (["refresh", "--seeds", "-1"], "--seeds=-1: allowed is at least 0"),
    ],
)
def test_bad_command_line_ends_in_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        program.main(arguments)
    assert said in capsys.readouterr().err


def test_part_without_its_package_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(program, "find_spec", lambda _: None)
    with pytest.raises(SystemExit):
        program.main(["frames"])
    assert "PART=frames: needs stable_baselines3, which is not installed" in capsys.readouterr().err


def test_part_is_written_after_each_round(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    rates = RATES
    monkeypatch.setattr(explanations, "measure", lambda *_, **__: rates)
    program.main(["explanations", "--quick", "--repeats", "2", "--output", str(tmp_path)])
    found = {made["name"]: made for made in load(tmp_path / "results.json")}
    assert found["explanations_batched_vs_naive"]["ratio"] == 4
    assert found["explanations_what_if"]["ratio"] == 0.25
    assert found["explanation_live_what_if_ms"]["ratio"] == 3
    assert len(found["explanation_live_ms"]["repeats"]["ours"]) == 2
    assert "explanations_vs_engine" in (tmp_path / "BENCHMARKS.md").read_text()


def test_failed_measurement_says_what_it_printed():
    with pytest.raises(RuntimeError, match=r"(?s)benchmarks\.child records\.missing.*AttributeError"):
        measure("records.missing")


def test_measurement_comes_back_from_its_own_process():
    assert measure("records.machine")["cores"] >= 1


def test_explanations_are_really_measured():
    rates = explaining.rates(moments=4, live_moments=2)
    assert rates.keys() == RATES.keys()
    assert all(value > 0 for value in rates.values())


def test_log_is_filled_past_its_capacity_and_refreshed(tmp_path: Path):
    assert 12_000 <= refilling.fill(str(tmp_path), frames=12_000, capacity=10_000, flown_frames=500) < 14_000
    log = TrajectoryLog.open(tmp_path)
    assert len(log.index) < log.episodes_ended  # the oldest made room
    assert len(np.unique(log.index["number"])) == len(log.index)
    assert refilling.refresh(str(tmp_path))["windows"] > 100


def test_two_runs_side_by_side_are_held_against_one_after_the_other():
    [made] = sweep.figures({1: [1000.0, 1100.0, 900.0], 2: [1700.0, 1900.0, 1800.0]})
    assert (made["name"], made["ours"], made["other"], made["ratio"]) == ("sweep_two_at_once", 1800, 1000, 1.8)
