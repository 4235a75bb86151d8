"""The benchmarks of instruction and of flawed instructors: their arithmetic by hand, and all of it once, small."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from processes import call

from benchmarks import instruction, instruction_report, ours, robustness, robustness_report
from benchmarks.instruction_report import baselines, looks, relative_frames, success, table
from benchmarks.kept import keep, kept
from benchmarks.robustness_flaws import ANEW, CURVES
from benchmarks.robustness_report import anew_table, flaws_table, growth
from benchmarks.truth_report import BLUE, GREY
from ibe_rl.agents import check_agent
from ibe_rl.collect.check import check_collect
from ibe_rl.config.kind_files import register
from ibe_rl.config.limits import check
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.instructors.flawed import FlawedConfig
from ibe_rl.training.instruction_reward import check_instruction_reward
from ibe_rl.types import Array
from ibe_rl.vocabulary.tracker import check_refreshing

ROOT = Path(__file__).parent.parent
DIFFERENT = {
    "sight": ("rewarded, goal seen", "silent, goal hidden"),
    "flaws": ("flawed, goal hidden",),
    "dqn": ("instructed, goal seen",),
    "reward": ("nothing", "mapping, 0.5", "oracle, 0.5, not absorbing"),
}
"""Arms that differ in kind, of each part; the others differ from one of these in a number or in one setting."""
ARMS = {(part, name): given for part, arms in instruction.PARTS.items() for name, given in arms.items()}


def mean_and_reach(values: Array) -> list[dict[str, float]]:
    """In the place of the bootstrap, with ends that can be told by hand."""
    return [{"value": float(one.mean()), "low": float(one.min()), "high": float(one.max())} for one in values.T]


@pytest.fixture(autouse=True)
def without_bootstrap(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (instruction_report, robustness_report):
        monkeypatch.setattr(module, "interquartile", mean_and_reach)


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Trainings go on here, which spares each the imports; returns what they are asked to do."""
    asked: list[list[str]] = []

    def run(command: list[str]) -> str:
        assert command[1] == "train.py"
        asked.append(command[2:])
        call("train", *command[2:])
        return ""

    monkeypatch.setattr(ours, "run", run)
    monkeypatch.setattr(robustness, "run_command", run)
    monkeypatch.setattr(robustness, "PredictorConfig", partial(PredictorConfig, processes=1))
    return asked


def test_instruction_is_measured_and_reported(
    tmp_path: Path, in_this_process: list[list[str]], monkeypatch: pytest.MonkeyPatch
):
    some = {part: {name: arms[name] for name in DIFFERENT[part]} for part, arms in instruction.PARTS.items()}
    monkeypatch.setattr(instruction, "PARTS", some)
    arguments = ["--quick", "--parts", *some, "--seeds", "4", "--output", str(tmp_path)]
    instruction.main(arguments)
    found = json.loads((tmp_path / "instruction.json").read_text())
    assert {(part, name) for part, arms in found.items() for name in arms} == {(p, n) for p in some for n in some[p]}
    for arms in found.values():
        for runs in arms.values():
            assert runs.keys() == {"4"}
            assert [point["frames"] for point in runs["4"]] == [1024, 2048]
    assert all("seed=4" in overrides for overrides in in_this_process)
    page = (tmp_path / "INSTRUCTION.md").read_text()
    for part, name in ((p, n) for p in some for n in some[p]):
        assert "\n".join(table(found[part], baselines(part, found))) in page
        assert f"| {name} | 0." in page or f"| {name} | 1." in page
    for part in found:
        assert (tmp_path / f"instruction_{part}.png").stat().st_size > 10_000
    trained = len(in_this_process)
    monkeypatch.setattr(instruction, "train", lambda *_: found["dqn"]["instructed, goal seen"]["4"])
    instruction.main(["--quick", "--parts", "dqn", "--seeds", "4", "--output", str(tmp_path)])
    assert json.loads((tmp_path / "instruction.json").read_text()).keys() == found.keys()  # the other parts are kept
    instruction.main([*arguments, "--missing"])
    instruction.main(["--report", "--output", str(tmp_path)])
    assert len(in_this_process) == trained
    assert (tmp_path / "INSTRUCTION.md").read_text() == page


def test_two_processes_add_to_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What another one wrote while this one trained is kept, and not trained again."""
    monkeypatch.setattr(instruction, "PARTS", {"reward": {"nothing": ("a",), "oracle, 0.5": ("b",)}})
    results, trained = tmp_path / "instruction.json", []

    def train(*overrides: str) -> list[dict[str, float]]:
        trained.append((overrides[0], overrides[-1]))
        if len(trained) == 1:
            keep(results, {"reward": {"oracle, 0.5": {"8": run(0.5)}}})
        return run(1.0)

    monkeypatch.setattr(instruction, "train", train)
    instruction.train_part("reward", [8, 9], (), results)
    assert trained == [("seed=8", "a"), ("seed=9", "a"), ("seed=9", "b")]
    assert kept(results) == {
        "reward": {"oracle, 0.5": {"8": run(0.5), "9": run(1.0)}, "nothing": {"8": run(1.0), "9": run(1.0)}}
    }


def test_arms_and_seeds_are_told_in_their_order():
    """Whichever process was first; an arm of an earlier version is left out."""
    found = {"reward": {"mapping, 0.5": {"10": 1, "9": 2}, "nothing": {"7": 3}, "earlier": {"0": 4}}, "flaws": {}}
    told = [
        (part, name, list(runs)) for part, arms in instruction.in_order(found).items() for name, runs in arms.items()
    ]
    assert told == [("reward", "nothing", ["7"]), ("reward", "mapping, 0.5", ["9", "10"])]


@pytest.mark.parametrize(("part", "seeds"), [("sight", 10), ("flaws", 10), ("dqn", 10), ("reward", 3)])
def test_each_part_has_its_seeds(part: str, seeds: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(instruction, "train", lambda *_: run(0.5, 1.0))
    instruction.main(["--parts", part, "--output", str(tmp_path)])
    found = kept(tmp_path / "instruction.json")
    assert {name: len(runs) for name, runs in found[part].items()} == dict.fromkeys(instruction.PARTS[part], seeds)


def test_robustness_is_measured_and_reported(
    tmp_path: Path, in_this_process: list[list[str]], monkeypatch: pytest.MonkeyPatch
):
    ends = {curve: {p: points[p] for p in (min(points), max(points))} for curve, points in CURVES.items()}
    monkeypatch.setattr(robustness, "CURVES", ends)
    monkeypatch.setattr(robustness, "ANEW", {"wrong 0.2": ANEW["wrong 0.2"]})
    robustness.main(["--quick", "--seeds", "4", "--corruptions", "1", "--episodes", "3", "--output", str(tmp_path)])
    found = json.loads((tmp_path / "robustness.json").read_text())
    places = [(curve, point) for curve, points in ends.items() for point in points]
    assert [(one["curve"], one["point"], one["seed"], one["draw"]) for one in found["curves"]] == [
        (*place, 4, 0) for place in places
    ]
    clean = [one["own"] for one in found["curves"] if one["point"] in ("0", "1")]
    assert len(set(clean)) == 1  # without flaws it is the same vocabulary in all curves
    assert [one["name"] for one in found["anew"]] == ["wrong 0.2"]
    assert "instructor.wrong=0.2" in in_this_process[1]
    page = (tmp_path / "INSTRUCTION.md").read_text()
    assert "\n".join(flaws_table(found["curves"])) in page
    assert "\n".join(anew_table(found["anew"])) in page
    assert (tmp_path / "robustness.png").stat().st_size > 10_000
    robustness.main(["--report", "--output", str(tmp_path)])
    assert (tmp_path / "INSTRUCTION.md").read_text() == page
    assert len(in_this_process) == 2


@pytest.mark.parametrize("program", [instruction, robustness])
def test_quick_figures_are_kept_apart(program: Any, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        program.main(["--quick"])
    assert "--quick: allowed with --output=FOLDER, its figures mean nothing" in capsys.readouterr().err


def composed(*overrides: str) -> Any:
    register()
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        return OmegaConf.to_object(compose("train", list(overrides)))


@pytest.mark.parametrize(("part", "name"), ARMS)
def test_every_arm_can_be_trained(part: str, name: str):
    cfg = composed(*instruction.COMMON, *ARMS[part, name])
    check(cfg)
    check_collect(cfg.collect)
    check_agent(cfg.agent, LANDER_TASK.state_names)
    check_refreshing(cfg, LANDER_TASK)
    check_instruction_reward(cfg)
    assert cfg.total_frames == 700_000
    assert (cfg.instructor.kind == "silent") == name.startswith("silent")
    assert (cfg.agent.ignores == ["goal_x"]) == name.endswith("hidden")
    assert (cfg.obedience.judge == "none") == (name.partition(",")[0] in ("instructed", "silent", "nothing"))
    if part == "reward" and name != "nothing":
        less = "" if cfg.obedience.absorbing else ", not absorbing"
        assert f"{cfg.obedience.judge}, {cfg.obedience.weight:g}{less}" == name


@pytest.mark.parametrize("name", ANEW)
def test_what_is_trained_again_has_the_flaws_that_are_predicted(name: str):
    overrides, flaws = ANEW[name]
    assert composed(*robustness.COMMON, *overrides).instructor == flaws


@pytest.mark.parametrize("curve", CURVES)
def test_every_curve_begins_without_flaws(curve: str):
    first, *others = CURVES[curve].values()
    assert (first.wrong, first.late_steps, first.present) == (0, 0, 1)
    assert all(one != FlawedConfig(spell_steps=one.spell_steps) for one in others)
    for flaws in (first, *others):
        check(flaws)


def record(point: str, seed: int, own: float | None, draw: int = 0, curve: str = "late") -> dict[str, Any]:
    return {"curve": curve, "point": point, "seed": seed, "draw": draw, "own": own, "paper": None}


def test_growth_is_from_the_same_run_and_draw_without_flaws():
    records = [
        *(record("0", 0, 0.1), record("0", 0, 0.2, draw=1), record("0", 1, 0.5), record("0", 2, None)),
        *(record("9", 0, 0.4), record("9", 0, 0.1, draw=1), record("9", 1, None), record("9", 2, 0.9)),
        *(record("0", 0, 7.0, curve="wrong"), record("1", 0, 9.0, curve="wrong")),
    ]
    found = growth(records, "late", "own")
    assert list(found) == ["0", "9"]
    np.testing.assert_allclose(found["0"], [0, 0, 0])
    np.testing.assert_allclose(found["9"], [0.3, -0.1])  # what taught nothing, before or after, is left out
    assert growth(records, "wrong", "own")["1"].tolist() == [2]
    assert [len(values) for values in growth(records, "late", "paper").values()] == [0, 0]
    for one, steps in zip([one for one in records if one["point"] == "9"], (8, 20, 9), strict=False):
        one |= {"late": 9, "delay": {"known": True, "steps": steps}}
    assert flaws_table(records)[2:] == [
        "| late | 9 | +0.100 [-0.100, +0.300], 1 taught nothing | -, 4 taught nothing | 8 to 20 | 2 of 4 |",
        "| wrong | 1 | +2.000 [+2.000, +2.000] | -, 1 taught nothing | - | 0 of 1 |",
    ]


def test_what_was_trained_stands_beside_what_was_predicted():
    records = [
        {"seed": 1, "name": "late", "trained": 0.25, "corrupted": None},
        {"seed": 0, "name": "late", "trained": 0.125, "corrupted": 0.5},
    ]
    records[1]["delay"] = {"known": True, "steps": 25, "low": 22, "high": 27}
    assert anew_table(records)[2:] == ["| late | 0 | 0.125 | 0.500 | 25 (22 to 27) |", "| late | 1 | 0.250 | - | - |"]


def run(*success: float) -> list[dict[str, float]]:
    return [{"frames": 1_000 * (n + 1), "seconds": 2.0 * (n + 1), "success": one} for n, one in enumerate(success)]


def test_arms_are_told_by_their_curves():
    runs = {"0": run(0, 0.9, 0.9, 1.0), "1": run(0.5, 0.5, 0.5, 0.9)}
    frames, curves = success(runs)
    assert frames.tolist() == [1_000, 2_000, 3_000, 4_000]
    assert curves.tolist() == [[0, 0.9, 0.9, 1.0], [0.5, 0.5, 0.5, 0.9]]
    assert table({"told": runs}, {})[2:] == [
        "| told | 0.70 [0.50, 0.90] | 0.95 [0.90, 1.00] | 0.65 [0.60, 0.70] | "
        "**>3,500** (3,000 to >4,000) | 1 of 2 | - |"
    ]
    assert table({"told": runs}, {"told": runs})[2].endswith("| ?1.00 [0.75, 1.33] |")


SOON, LATE, NEVER = run(0.9, 0.9, 0, 0), run(0, 0, 0.9, 0.9), run(0, 0, 0, 0)


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        (SOON, LATE, "0.50 [0.50, 0.50]"),
        (SOON, NEVER, "<0.50 [0.50, 0.50]"),
        (NEVER, SOON, ">2.00 [2.00, 2.00]"),
        (NEVER, NEVER, "?"),
    ],
)
def test_frames_are_told_relative_to_those_of_other_runs(one: Any, other: Any, told: str):
    assert relative_frames({"0": one, "1": one}, {"7": other}) == told


def test_arms_that_differ_in_one_thing_have_one_colour():
    for arms in instruction.PARTS.values():
        seen = dict(zip(arms, looks(arms), strict=True))
        assert len(set(seen.values())) == len(arms)
    names = ("nothing", "mapping, 0.5", "mapping, 0.5, not absorbing")
    assert looks(names) == [(BLUE, "-"), (GREY, "-"), (GREY, "--")]
    assert looks(("silent, goal seen", "silent, goal hidden")) == [(BLUE, "-"), (BLUE, "--")]


def test_an_arm_is_compared_with_the_silent_one_of_the_same_goal():
    def of(name: str) -> Any:
        return {"0": name}

    sight = {name: of(name) for name in instruction.PARTS["sight"]}
    found: Any = {
        "sight": sight,
        "flaws": {"always wrong, goal hidden": of("wrong")},
        "dqn": {"instructed, goal seen": of("deep"), "silent, goal seen": of("still")},
        "reward": {"nothing": of("nothing"), "oracle, 0.5": of("more")},
    }
    assert baselines("sight", found) == {
        f"{how}, goal {sight}": of(f"silent, goal {sight}")
        for how in ("rewarded", "instructed")
        for sight in ("seen", "hidden")
    }
    assert baselines("flaws", found) == {"always wrong, goal hidden": of("silent, goal hidden")}
    assert baselines("dqn", found) == {"instructed, goal seen": of("still")}
    assert baselines("reward", found) == {"oracle, 0.5": of("nothing")}
    assert baselines("flaws", {"flaws": found["flaws"]}) == {}
