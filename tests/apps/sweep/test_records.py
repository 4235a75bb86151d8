"""What is read of a sweep's runs, on folders made by hand."""

from pathlib import Path

import pytest

from ibe_rl.apps.sweep.records import ALL, conditions, read_sweep
from ibe_rl.types import ConfigError
from tests.apps.sweep.made import judge, run, sweep


def test_a_condition_is_what_differs_but_for_the_seed(tmp_path: Path) -> None:
    place = sweep(tmp_path, {"mapping=axis": [0.5, 0.6], "mapping=paper": [0.7]})
    records = read_sweep(place)
    assert [record.condition for record in records] == ["mapping=axis", "mapping=axis", "mapping=paper"]
    assert [record.name for record in records] == [
        "mapping=axis, seed=0",
        "mapping=axis, seed=1",
        "mapping=paper, seed=0",
    ]
    assert [record.seed for record in records] == ["0", "1", "0"]
    assert {record.missing for record in records} == {""}
    assert records[1].ends["eval/success_rate"] == 0.6
    assert records[1].ends["ibe/motion_auc"] == pytest.approx(0.8)
    assert not [name for name in records[1].ends if name.startswith("time") or name == "frames"]
    frames, values = records[1].curves["eval/success_rate"]
    assert frames.tolist() == [900, 1000]
    assert values.tolist() == pytest.approx([0.6 * 8 / 9, 0.6], rel=1e-5)


def test_a_setting_that_a_run_leaves_out_is_the_default(tmp_path: Path) -> None:
    runs = [run(tmp_path / "0", ["seed=0"]), run(tmp_path / "1", ["seed=0", "agent=dqn"])]
    assert conditions(runs) == ["agent=default", "agent=dqn"]


def test_where_only_the_seed_differs_there_is_one_condition(tmp_path: Path) -> None:
    runs = [run(tmp_path / str(seed), [f"seed={seed}", "agent=dqn", f"viewer={seed}"]) for seed in range(2)]
    assert conditions(runs) == [ALL, ALL]


def test_runs_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (10, 9, 0):
        run(tmp_path / f"{number}_seed={number}", [f"seed={number}"])
    assert [record.seed for record in read_sweep(tmp_path)] == ["0", "9", "10"]


def test_runs_that_are_not_finished_say_so(tmp_path: Path) -> None:
    stopped = run(tmp_path / "0_seed=0", ["seed=0"])
    (stopped / "summary.json").write_text('{"stopped_early": true}')
    run(tmp_path / "1_seed=1", ["seed=1"], finished=False)
    failed = run(tmp_path / "2_seed=2", ["seed=2"], finished=False)
    (failed / "output.log").write_text("all well\nRuntimeError: out of luck\n")
    (tmp_path / "3_seed=3").mkdir()
    (tmp_path / "3_seed=3" / "output.log").write_text("error: mapping.horizon_steps=2000: allowed is less\n")
    (tmp_path / "multirun.yaml").touch()
    (tmp_path / "figures").mkdir()
    assert [record.missing for record in read_sweep(tmp_path)] == [
        "stopped early, at 1,000 frames",
        "not finished, at 1,000 frames",
        "not finished, at 1,000 frames; its last output: RuntimeError: out of luck",
        "not started; its last output: error: mapping.horizon_steps=2000: allowed is less",
    ]


def test_what_a_run_was_judged_to_be_counts_too(tmp_path: Path) -> None:
    judge(run(tmp_path / "0_seed=0", ["seed=0"]), motion_auc=0.97, vocabulary_loss=0.02)
    [record] = read_sweep(tmp_path)
    assert record.ends["quality/motion_auc"] == 0.97
    assert record.ends["quality/vocabulary_loss"] == 0.02
    assert "quality/came_true" not in record.ends


@pytest.mark.parametrize("text", ["{", "[]", '{"protocol": {"mapping": "axis", "horizon_steps": 60}, "rows": []}'])
def test_a_damaged_judgement_is_named(text: str, tmp_path: Path) -> None:
    one = run(tmp_path / "0_seed=0", ["seed=0"])
    (one / "evaluation").mkdir()
    (one / "evaluation" / "quality.json").write_text(text)
    with pytest.raises(ConfigError, match=r"0_seed=0/evaluation/quality.json: not a readable judgement"):
        read_sweep(tmp_path)


def test_a_damaged_table_is_named(tmp_path: Path) -> None:
    one = run(tmp_path / "0_seed=0", ["seed=0"])
    (one / "metrics.csv").write_text("frames,train/return_mean\n1,2\n2,two\n")
    with pytest.raises(
        ConfigError, match=r"0_seed=0/metrics.csv: column train/return_mean has a value that is not a number"
    ):
        read_sweep(tmp_path)


def test_what_is_no_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"sweep=.*: there is no run in it; allowed is a folder"):
        read_sweep(tmp_path / "nowhere")
    one = run(tmp_path / "one", ["seed=0"])
    with pytest.raises(ConfigError, match=rf"sweep={one}: it is one run; allowed is run={one}"):
        read_sweep(one)
