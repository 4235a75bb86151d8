"""A kind of one's own is one module and one YAML file, anywhere; a stranger's folder makes none of it run."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from own_kinds import KINDS, write_kinds
from processes import ROOT, call

from ibe_rl.config.command_line import run_script
from ibe_rl.config.kinds import GROUPS, implementation, make_listeners
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import ListenerConfig, TrainConfig
from ibe_rl.storage.run_folder import CONFIG, METRICS, read_json, read_rows
from ibe_rl.types import ConfigError

CHOSEN = [
    "env=mine",
    "agent=mine",
    "instructor=mine",
    "mapping=mine",
    "predictor=mine",
    "listener=mine",
    "metric=[mine]",
]
TINY = [
    *("collect.processes=2", "collect.envs_per_process=4", "collect.steps_per_batch=64", "total_frames=1024"),
    *("refresh_every_frames=512", "eval_every_frames=1024", "eval_episodes=2", "log.capacity_frames=10000"),
    *("mapping.horizon_steps=5", "mapping.spans_steps=[]", "mapping.n_clusters=3", "viewer=off"),
    *("mapping.loudness=1.25", "predictor.drift=0.02", "listeners.mine.every_batches=1", "env.kwargs.wind=0.02"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A person's folder, from which they start the program."""
    made = tmp_path_factory.mktemp("own")
    write_kinds(made)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        yield made
    sys.path.remove(str(made))


def mine(*arguments: str) -> list[str]:
    return ["--config-dir", "mine", *arguments]


@pytest.fixture(scope="module")
def trained(folder: Path) -> Path:
    """A training with one kind of each, in two processes."""
    call("train", *mine(*CHOSEN, *TINY, f"run_dir={folder / 'run'}", "stop_after_frames=512"))
    return folder / "run"


def settings(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> list[Any]:
    """The configs with which a command line starts runs."""
    found: list[Any] = []
    monkeypatch.setattr(sys, "argv", ["train.py", *arguments, "hydra/launcher=basic"])
    run_script(found.append, ROOT / "configs", "train")
    return found


def test_a_kind_of_each_trains_in_two_processes(trained: Path):
    config = yaml.safe_load((trained / CONFIG).read_text())
    kinds = {
        group: config[group]["kind"].partition(":")[0] for group in ("agent", "instructor", "mapping", "predictor")
    }
    assert kinds == {group: f"kinds_of_mine.{group}" for group in kinds}
    assert (config["mapping"]["loudness"], config["predictor"]["drift"], config["min_confidence"]) == (1.25, 0.02, 0.4)
    assert config["listeners"]["mine"] == {
        "kind": "kinds_of_mine.listener:Diary",
        "name": "diary.txt",
        "every_batches": 1,
    }
    rows = read_rows(trained / METRICS)
    assert {row["mine/words"] for row in rows if row["mine/words"]} or not any(row["ibe/windows"] for row in rows)
    assert read_json(trained / "summary.json")["refreshes"] == 1


def test_it_goes_on_with_them(trained: Path):
    call("train", *mine(f"resume={trained}", "agent.shyness=0.25"))
    config = yaml.safe_load((trained / CONFIG).read_text())
    assert (config["agent"]["shyness"], config["mapping"]["loudness"]) == (0.25, 1.25)
    assert config["listeners"]["mine"]["every_batches"] == 1
    assert read_json(trained / "summary.json")["frames"] == 1024
    assert (trained / "diary.txt").read_text()
    for kept in ("predictor.drift=0.5", "mapping.loudness=2", "agent=ppo"):
        with pytest.raises(SystemExit, match=f"error: {kept} with resume: a run keeps its"):
            call("train", *mine(f"resume={trained}", "total_frames=4096", kept))


def test_mappings_are_compared_with_it(trained: Path):
    few = ["evaluate.episodes=2", "evaluate.calibration_episodes=2", "evaluate.resamples=20", "predictor.futures=1"]
    call("explain", *mine(f"run={trained}", "task=compare", "compare.mappings=[mine]", *few))
    rows = read_json(trained / "evaluation" / "compare.json")["rows"]
    assert "ibe:mine" in {row["explainer"] for row in rows}


@pytest.mark.usefixtures("folder")
def test_a_sweep_varies_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    swept = ["-m", *mine("mapping=mine,axis", "listener=[mine]", f"run_dir={tmp_path}")]
    configs = settings(monkeypatch, *swept)
    assert [config.mapping.kind for config in configs] == ["kinds_of_mine.mapping:Loud", "axis"]
    assert [len(make_listeners(config)) for config in configs] == [1, 1]
    stretched = settings(monkeypatch, "-m", *mine("mapping=mine", "mapping.loudness=1,2", f"run_dir={tmp_path}"))
    assert [config.mapping.loudness for config in stretched] == [1.0, 2.0]


def test_a_file_may_start_from_another_and_its_settings_are_still_its_kinds(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    text = "defaults: [axis, _self_]\nkind: kinds_of_mine.mapping:Loud\nn_clusters: 5\n"
    (folder / "mine/mapping/mine_of_axis.yaml").write_text(text)
    [config] = settings(monkeypatch, *mine("mapping=mine_of_axis"))
    assert (config.mapping.space, config.mapping.loudness, config.mapping.n_clusters) == ("rule", 1.0, 5)
    (folder / "mine/agent/mine_of_mine.yaml").write_text("defaults: [mine, _self_]\nkind: kinds_of_mine.agent:Shy\n")
    [config] = settings(monkeypatch, *mine("agent=mine_of_mine", "agent.shyness=0.75"))
    assert (config.agent.hidden, config.agent.shyness) == ([16], 0.75)


BAD = {
    "mapping.loudness=9": r"mapping\.loudness=9\.0: allowed is at least 0\.5 and at most 2",
    "mapping.loudness=very": r"mapping\.loudness: Value 'very' of type 'str' could not be converted to Float",
    "mapping.colour=1": r"mapping\.colour: no such setting; allowed are kind, .*, loudness",
    "predictor.drift=2": r"predictor\.drift=2\.0: allowed is at least 0 and at most 1",
    "agent.shyness=2": r"agent\.shyness=2\.0: allowed is at least 0 and at most 1",
    "instructor.every_steps=0": r"instructor\.every_steps=0: allowed is at least 1 and at most 9",
    "listeners.mine.every_batches=0": r"listeners\.mine\.every_batches=0: allowed is at least 1",
    "listeners.mine.colour=1": r"listeners\.mine\.colour: no such setting; allowed are kind, name, every_batches",
    "metrics.mine.share=2": r"metrics\.mine\.share=2\.0: allowed is at least 0 and at most 1",
    "env.kwargs.wind=2": r"env\.kwargs\.wind=2\.0: allowed is at least 0 and at most 0\.1",
    "env.kwargs.wind=strong": r"env\.kwargs\.wind: Value 'strong' of type 'str' could not be converted to Float",
    "+env.kwargs.rain=2": r"env\.kwargs\.rain=2: no such setting; allowed are wind",
    "listener=[yours]": r"listener=yours: allowed is one of mine",
    "mapping.kind=kinds_of_mine.agent:Shy": r"mapping\.kind=kinds_of_mine\.agent:Shy: its settings are .*MappingConfig",
}


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("bad", BAD)
def test_bad_settings_are_refused_by_name(tmp_path: Path, bad: str):
    group = bad.lstrip("+").partition(".")[0].partition("=")[0].removesuffix("s")
    chosen = [f"{group}=mine"] if "=[" not in bad else []
    with pytest.raises(SystemExit, match=f"^error: {BAD[bad]}"):
        call("train", *mine(*chosen, bad, f"run_dir={tmp_path / 'run'}", "viewer=off"))
    assert not (tmp_path / "run").exists()


WRONG = {
    "kind: nowhere:Loud\n": r"mapping\.kind=nowhere:Loud: allowed is module:Class \(ModuleNotFoundError",
    "kind: kinds_of_mine.mapping:setting\n": r"mapping\.kind=kinds_of_mine\.mapping:setting: no such kind",
    "kind: kinds_of_mine.mapping:Loud\ncolour: red\n": r"mapping\.colour: no such setting; allowed are .*loudness",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_file_that_names_nothing_or_sets_what_is_not_there_is_refused(folder: Path, text: str):
    (folder / "mine/mapping/wrong.yaml").write_text(text)
    with pytest.raises(SystemExit, match=f"^error: {WRONG[text]}"):
        call("train", *mine("mapping=wrong"))
    (folder / "mine/mapping/wrong.yaml").unlink()


def test_a_listener_that_cannot_be_made_is_named():
    cfg = TrainConfig(listeners={"mine": ListenerConfig(kind="collections:OrderedDict")})
    with pytest.raises(ConfigError, match=r"listeners\.mine=collections:OrderedDict: it cannot be made \(TypeError"):
        make_listeners(cfg)


@pytest.mark.parametrize("group", GROUPS)
def test_a_kind_that_is_none_is_refused(group: str):
    for kind in ("nonsense", "../x", "networks", "") if group not in ("mapping", "listener", "metric") else ():
        with pytest.raises(ConfigError, match=rf"{group}\.kind={re.escape(kind)}: no such kind"):
            implementation(group, kind)


def test_it_takes_two_files():
    assert all(len(files) == 2 for files in KINDS.values())


# ---- a stranger's folder


def saved(tmp_path: Path, *keys: str, value: Any) -> Path:
    """The config of the demo with something else in it."""
    config = yaml.safe_load((ROOT / "demo" / CONFIG).read_text())
    place = config
    for key in keys[:-1]:
        place = place.setdefault(key, {})
    place[keys[-1]] = value
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config))
    return path


def test_a_folder_of_an_earlier_version_opens():
    config = load_config(ROOT / "demo" / CONFIG, TrainConfig)
    assert (config.agent.kind, config.instructor.kind, config.mapping.kind) == ("ppo", "oracle", "axis")
    assert config.predictor.kind == "simulator"


def test_code_is_found_under_the_name_that_its_room_had(tmp_path: Path):
    path = saved(
        tmp_path, "env", value={"id": "Reacher-v5", "task": {"name": "x", "rule": "ibe_rl.env.reacher:instruct"}}
    )
    text = yaml.safe_load(path.read_text())
    text["env"]["task"] |= {"phrases": [], "explained": [], "explained_band": []}
    path.write_text(yaml.safe_dump(text))
    assert load_config(path, TrainConfig).env.task.rule == "ibe_rl.envs.reacher:instruct"


@pytest.mark.parametrize(
    "keys",
    [
        *(("agent", "kind"), ("instructor", "kind"), ("mapping", "kind"), ("predictor", "kind")),
        *(("listeners", "x", "kind"), ("metrics", "x", "kind"), ("env", "id")),
    ],
)
def test_code_that_no_file_of_ones_own_names_is_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keys: tuple[str, ...]
):
    sprung = tmp_path / "sprung"
    (tmp_path / "trap.py").write_text(f"open({str(sprung)!r}, 'w').close()\nclass Trap: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match=r"runs code, trap:Trap; allowed is what comes with ibe_rl or is named by"):
        load_config(saved(tmp_path, *keys, value="trap:Trap"), TrainConfig)
    assert not sprung.exists()


def test_with_ones_own_files_such_a_folder_opens(trained: Path):
    with pytest.raises(SystemExit, match=r"its agent runs code, kinds_of_mine\.agent:Shy; allowed is"):
        call("explain", f"run={trained}", "viewer=off")
    call("explain", *mine(f"run={trained}", "viewer=off"))
