"""Time to skill: seeds that are kept, the worst of them, and Stable-Baselines3 with either step of the lander."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import __main__ as program
from benchmarks import curves, fresh, ours, picture, sb3, skill, starting
from benchmarks.curves import Curve
from benchmarks.how import HOW
from benchmarks.levels import Point
from benchmarks.plan import FORMS, REWARDED, Plan, make_plan
from benchmarks.records import load
from ibe_rl.collect.rollout import EVALUATION_SEED
from ibe_rl.collect.schedule import Schedule
from ibe_rl.config.settings import TrainConfig

pytestmark = pytest.mark.slow

NAMES = {"ours": "ibe_rl", "lean": "theirs"}
OURS = [("agent=ppo", "eval_every_frames=50000", f"seed={seed}") for seed in range(2)]
REWARDED_RUNS = [(*run[:-1], REWARDED, run[-1]) for run in OURS]


def climb(seconds: float, successes: tuple[float, ...] = (0.5, 0.9, 0.9)) -> list[Point]:
    """Evaluations ``seconds`` and 100 frames apart; it gets to 83 % at the third."""
    return [Point(100 * n, seconds * n, success) for n, success in enumerate(successes, start=1)]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What would be run: each run of Stable-Baselines3 as its seed and step, each of train.py as its overrides."""
    made: list[tuple[Any, ...]] = []

    def measure(function: str, **arguments: Any) -> Any:
        if function == "sb3.rate":
            return {"dummy": 20_000.0, "subproc": 9000.0}[arguments["vec_env"]]
        if function == "sb3.to_skill":
            made.append((arguments["seed"], arguments["step"]))
            return [vars(point) for point in climb({"lean": 20.0, "gymnasium": 30.0}[arguments["step"]])]
        return None  # no picture

    def train(*overrides: str, fresh_episodes: int) -> ours.TrainingRun:
        made.append(overrides)
        faster, seed = 4.0 if REWARDED in overrides else 0.0, int(overrides[-1].removeprefix("seed="))
        return ours.TrainingRun({"wall_s": 40.0}, climb(10.0 - faster + seed), 0.9 - seed / fresh_episodes)

    monkeypatch.setattr(skill, "measure", measure)
    monkeypatch.setattr(ours, "train", train)
    return made


def figures_of(folder: Path, *arguments: str) -> dict[str, dict[str, Any]]:
    program.main(["skill-ppo", *arguments, "--output", str(folder)])
    return {made["name"]: made for made in load(folder / "results.json")}


def values(figure: dict[str, Any], side: str) -> list[float]:
    return [one["value"] for one in figure["repeats"][side]]


def test_five_seeds_are_run_and_every_value_is_kept(tmp_path: Path, asked: list[tuple[Any, ...]]):
    found = figures_of(tmp_path)
    assert len(asked) == 4 * 5
    assert asked[:2] == [(0, "lean"), (0, "gymnasium")]
    assert asked[2:4] == [OURS[0], REWARDED_RUNS[0]]
    assert values(found["time_to_83_ppo"], "ours") == [30, 33, 36, 39, 42]
    assert (found["time_to_83_ppo"]["ours"], found["time_to_83_ppo"]["other"]) == (36, 60)
    assert (found["time_to_83_ppo_max"]["ours"], found["time_to_83_ppo_max"]["other"]) == (42, 60)
    assert found["time_to_83_ppo_gymnasium_step"]["other"] == 90
    assert found["frames_to_83_ppo"]["ratio"] == 1
    assert all(made["how"] == HOW[name] for name, made in found.items())
    assert (found["time_to_83_ppo_rewarded"]["ours"], found["time_to_83_ppo_rewarded_max"]["ours"]) == (24, 30)
    assert found["time_to_83_ppo_rewarded"]["ratio"] == 24 / 60
    assert found["final_success_ppo"]["ours"] == 0.9 - 2 / 500
    assert found["final_success_ppo_min"]["ours"] == found["final_success_ppo_rewarded_min"]["ours"] == 0.9 - 4 / 500
    assert found["run_wall_s_ppo"]["ours"] == 40


def test_a_run_that_was_stopped_goes_on_with_the_missing_seeds(tmp_path: Path, asked: list[tuple[Any, ...]]):
    whole = figures_of(tmp_path / "whole", "--seeds", "0", "1", "2")
    figures_of(tmp_path / "parts", "--seeds", "0", "2")
    asked.clear()
    resumed = figures_of(tmp_path / "parts", "--seeds", "0", "1", "2", "--resume")
    assert asked == [(1, "lean"), (1, "gymnasium"), OURS[1], REWARDED_RUNS[1]]
    assert [made | {"date": ""} for made in resumed.values()] == [made | {"date": ""} for made in whole.values()]


def test_only_seeds_of_the_same_way_and_place_are_taken_up(
    tmp_path: Path, asked: list[tuple[Any, ...]], monkeypatch: pytest.MonkeyPatch
):
    figures_of(tmp_path, "--seeds", "0")
    for changed in ([], ["--cap-seconds", "100"]):
        asked.clear()
        figures_of(tmp_path, "--seeds", "0", *changed, *(["--resume"] if changed else []))
        assert len(asked) == 4
    asked.clear()
    monkeypatch.setattr(skill, "machine", lambda: {"processor": "another"})
    figures_of(tmp_path, "--seeds", "0", "--cap-seconds", "100", "--resume")
    assert len(asked) == 4


def test_a_seed_without_all_of_its_sides_is_run_again(tmp_path: Path):
    sides = {"ours": Curve(climb(1.0), 5.0, 0.95), "lean": Curve(climb(2.0))}
    records = curves.to_records("skill-ppo", NAMES, {0: sides, 1: sides}, {"train": []})
    path = tmp_path / "curves.json"
    path.write_text(json.dumps(records[:-1]))  # theirs of seed 1 is missing
    assert curves.load_seeds(path, "skill-ppo", NAMES, {"train": []}) == {0: sides}
    assert curves.load_seeds(path, "skill-dqn", NAMES, {"train": []}) == {}
    assert curves.load_seeds(path, "skill-ppo", NAMES, {"train": ["other"]}) == {}


def test_our_run_to_skill_is_the_default_one_with_more_evaluations():
    plan = make_plan(FORMS["full"])
    assert TrainConfig.total_frames == 600_000
    assert not any("total_frames" in one for one in skill.train_overrides(plan, "ppo"))
    assert "total_frames=2_000_000" in skill.train_overrides(plan, "dqn")  # CHANGELOG: what the lander needs
    due = Schedule(plan.sizes.evaluate_every["ppo"])
    assert sum(due(frames) for frames in range(8192, TrainConfig.total_frames + 1, 8192)) >= 11
    sizes = plan.sizes
    assert max(sizes.short_frames, sizes.fault_frames, sizes.sweep_frames) < TrainConfig.total_frames


def test_each_side_has_a_colour_of_its_own():
    names = skill.names_of(make_plan(FORMS["full"]), "ppo", "dummy")
    assert len({picture.colour(name) for name in names.values()}) == 4


def small_short(folder: Path) -> Plan:
    form = FORMS["short"]
    return make_plan(replace(form, sizes=replace(form.sizes, vec_env_steps=32), output=folder))


def test_the_short_form_has_its_parts_one_seed_and_its_own_folder(tmp_path: Path, asked: list[tuple[Any, ...]]):
    form = program.as_asked(program.make_parser().parse_args(["--short"]))
    assert form.parts == ("skill-ppo", "frames", "explanations", "setup")
    assert (form.seeds, form.repeats, form.output) == ((0,), 1, Path("runs/benchmarks-short"))
    [found] = skill.run(small_short(tmp_path), lambda _: None, "skill-ppo")
    assert [made[0] for made in asked] == [0, "agent=ppo"]
    assert not any("gymnasium" in made["name"] for made in found)


def test_the_command_line_changes_what_it_names():
    line = ["frames", "--short", "--seeds", "3", "4", "--repeats", "2", "--output", "here"]
    form = program.as_asked(program.make_parser().parse_args(line))
    assert (form.parts, form.seeds, form.repeats, form.output) == (("frames",), (3, 4), 2, Path("here"))
    assert form.cap_seconds == FORMS["short"].cap_seconds


def test_both_steps_give_stable_baselines3_the_same_numbers():
    lean, theirs = sb3.make_told("lean"), sb3.make_told("gymnasium")
    assert (lean.unwrapped.lean, theirs.unwrapped.lean) == (True, False)
    random = np.random.default_rng(0)
    for seed in range(6):
        np.testing.assert_array_equal(lean.reset(seed=seed)[0], theirs.reset(seed=seed)[0])
        ended = False
        while not ended:
            action = int(random.integers(4))
            mine, other = lean.step(action), theirs.step(action)
            np.testing.assert_array_equal(mine[0], other[0])
            assert mine[1:] == other[1:]
            ended = mine[2] or mine[3]


def test_stable_baselines3_learns_the_same_with_either_step():
    sizes = {"evaluate_every": 1000, "episodes": 4, "levels": [0.95], "cap_frames": 3000, "rollout_steps": 64}
    runs = [sb3.to_skill("ppo", 0, "dummy", step, cap_seconds=600.0, **sizes) for step in ("lean", "gymnasium")]
    lean, theirs = ([(point["frames"], point["success"]) for point in points] for points in runs)
    assert lean == theirs
    assert len(lean) == 3


def test_the_end_is_judged_on_episodes_that_the_training_has_not_seen(monkeypatch: pytest.MonkeyPatch):
    asked: list[range] = []

    def play(envs: list[Any], *policy_and_instructor: Any) -> list[SimpleNamespace]:
        seeds = policy_and_instructor[-1]
        assert len(envs) == min(fresh.AT_ONCE, len(seeds))
        asked.append(seeds)
        return [SimpleNamespace(success=seed % 4 > 0) for seed in seeds]

    run = SimpleNamespace(config=TrainConfig(), task=None, policy=None, make_env=object)
    monkeypatch.setattr(fresh, "load_run", lambda *_: run)
    monkeypatch.setattr(fresh, "make_instructor", lambda *_: None)
    monkeypatch.setattr(fresh, "play", play)
    assert [fresh.success("runs/one", episodes) for episodes in (8, 400)] == [0.75, 0.75]
    evaluated = range(EVALUATION_SEED, EVALUATION_SEED + TrainConfig.eval_episodes)  # seeds before are trained with
    assert all(min(seeds) >= EVALUATION_SEED and not set(seeds) & set(evaluated) for seeds in asked)


def test_set_up_is_divided_by_what_the_first_row_says(tmp_path: Path):
    path = tmp_path / "metrics.csv"
    path.write_text("frames,time/setup,time/collect,time/learn,time/eval\n8192,3,1.5,0.5,2\n")
    with path.open() as stream:
        [row] = csv.DictReader(stream)
    assert starting.parts_of(11.0, row) == {"imports": 4.0, "making": 3.0, "batch": 1.5}
    [whole, *_] = starting.figures([{"imports": 4.0, "making": 3.0, "batch": 1.5}])
    assert (whole["name"], whole["ours"]) == ("setup_s", 8.5)


def test_set_up_is_really_measured():
    parts = starting.start_once(*FORMS["quick"].sizes.overrides)
    assert parts.keys() == set(starting.PARTS_S)
    assert all(seconds > 0 for seconds in parts.values())
