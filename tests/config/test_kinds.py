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

from ibe_rl.config.command_line import composed, run_script
from ibe_rl.config.kinds import GROUPS, SEVERAL, implementation, make_several
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


def test_mappings_are_compared_with_it_and_by_its_metric(trained: Path, capsys: pytest.CaptureFixture[str]):
    few = ["evaluate.episodes=2", "evaluate.calibration_episodes=2", "evaluate.resamples=20", "predictor.futures=1"]
    few += ["evaluate.spoken_episodes=0"]
    call("explain", *mine(f"run={trained}", "task=compare", "compare.mappings=[mine]", *few))
    rows = read_json(trained / "evaluation" / "compare.json")["rows"]
    assert "ibe:mine" in {row["explainer"] for row in rows}
    assert all(0 <= row["mine/right"]["value"] <= 1 for row in rows)
    assert "mine/right" in capsys.readouterr().out


def test_a_metric_is_added_to_the_evaluation_of_a_run_that_had_none(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "argv", ["explain.py", *mine("metric=[mine]", "task=evaluate", "metrics.mine.share=0.5")])
    found: list[Any] = []
    run_script(found.append, ROOT / "configs", "explain")
    [metric] = make_several("metric", found[0].metrics)
    assert (type(metric).__name__, metric.share) == ("Distinct", 0.5)
    with pytest.raises(SystemExit, match=r"^error: metric=\[mine\] with task=episode: allowed with task=evaluate or"):
        call("explain", *mine(f"run={folder / 'run'}", "metric=[mine]"))


@pytest.mark.usefixtures("folder")
def test_runs_of_a_sweep_train_with_them_in_processes_of_their_own(tmp_path: Path):
    few = [*TINY, "collect.processes=1", "total_frames=256", "refresh_every_frames=null"]
    call("train", "-m", "seed=0,1", *mine(*CHOSEN, *few, "runs_at_once=2", f"run_dir={tmp_path / 'swept'}"))
    for seed in (0, 1):
        run = tmp_path / "swept" / f"{seed}_seed={seed}"
        assert yaml.safe_load((run / CONFIG).read_text())["mapping"]["loudness"] == 1.25
        assert (run / "diary.txt").read_text()


def test_all_settings_of_an_environment_are_shown(folder: Path, monkeypatch: pytest.MonkeyPatch):
    for name, text in {
        "bare": "id: kinds_of_mine.env:Windy-v0\n",
        "of_mine": "defaults: [mine, _self_]\nid: kinds_of_mine.env:Windy-v0\n",
        "whole": "# @package _global_\nenv:\n  id: kinds_of_mine.env:Windy-v0\n",
        "broken": "id: kinds_of_mine.nowhere:Windy-v0\n",
    }.items():
        (folder / f"mine/env/{name}.yaml").write_text(text)
    kwargs = {}
    for name in ("mine", "bare", "of_mine", "whole", "broken"):
        [config] = settings(monkeypatch, *mine(f"env={name}"))
        kwargs[name] = config.env.kwargs
    assert kwargs == {
        "mine": {"wind": 0.01},
        "bare": {"wind": 0},
        "of_mine": {"wind": 0.01},
        "whole": {"wind": 0},
        "broken": {},
    }
    with pytest.raises(SystemExit, match=r"^error: env\.id=kinds_of_mine\.nowhere:Windy-v0: .* cannot be imported"):
        call("train", *mine("env=broken"))


@pytest.mark.usefixtures("folder")
def test_a_sweep_varies_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    swept = ["-m", *mine("mapping=mine,axis", "listener=[mine]", f"run_dir={tmp_path}")]
    configs = settings(monkeypatch, *swept)
    assert [config.mapping.kind for config in configs] == ["kinds_of_mine.mapping:Loud", "axis"]
    assert [len(make_several("listener", config.listeners)) for config in configs] == [1, 1]
    stretched = settings(monkeypatch, "-m", *mine("mapping=mine", "mapping.loudness=1,2", f"run_dir={tmp_path}"))
    assert [config.mapping.loudness for config in stretched] == [1.0, 2.0]


def test_a_file_may_start_from_another_and_its_settings_are_still_its_kinds(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    text = "defaults: [axis, _self_]\nkind: kinds_of_mine.mapping:Stretched\nn_clusters: 5\n"
    (folder / "mine/mapping/mine_of_axis.yaml").write_text(text)
    [config] = settings(monkeypatch, *mine("mapping=mine_of_axis", "mapping.stretch=2"))
    assert (config.mapping.space, config.mapping.stretch, config.mapping.n_clusters) == ("rule", 2.0, 5)
    (folder / "mine/agent/mine_of_ppo.yaml").write_text("defaults: [ppo, _self_]\nkind: kinds_of_mine.agent:Shy\n")
    [config] = settings(monkeypatch, *mine("agent=mine_of_ppo", "agent.shyness=0.25"))
    assert (config.agent.kind, config.agent.shyness) == ("kinds_of_mine.agent:Shy", 0.25)
    (folder / "mine/agent/mine_of_mine.yaml").write_text("defaults: [mine, _self_]\nkind: kinds_of_mine.agent:Shy\n")
    [config] = settings(monkeypatch, *mine("agent=mine_of_mine", "agent.shyness=0.75"))
    assert (config.agent.hidden, config.agent.shyness) == ([16], 0.75)
    (folder / "mine/listener/other.yaml").write_text(
        "defaults: [mine, _self_]\nkind: kinds_of_mine.listener:Diary\nname: o.txt\n"
    )
    [config] = settings(monkeypatch, *mine("listener=[other]"))
    assert {name: one.name for name, one in config.listeners.items()} == {"other": "o.txt"}


BAD = {
    "mapping.loudness=9": r"mapping\.loudness=9\.0: allowed is at least 0\.5 and at most 2",
    "mapping.loudness=very": r"mapping\.loudness: Value 'very' of type 'str' could not be converted to Float",
    "mapping.colour=1": r"mapping\.colour: no such setting; allowed are kind, .*, loudness",
    "mapping.power=0.5": r"mapping\.power: no such setting; allowed are kind, .*, hold_within, loudness",
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
    kind = "ibe_rl.training.listeners:Checkpoints"
    with pytest.raises(ConfigError, match=rf"listeners\.mine={kind}: it cannot be made \(TypeError"):
        make_several("listener", {"mine": ListenerConfig(kind=kind)})
    with pytest.raises(ConfigError, match=r"kind=collections:OrderedDict: allowed is a class derived from .*:Listener"):
        make_several("listener", {"mine": ListenerConfig(kind="collections:OrderedDict")})


LATE = """
from ibe_rl.vocabulary.listener import Listener, Metric

class Late(Listener):
    def __init__(self, config): raise ValueError("not today")

class Greedy(Metric):
    columns = ("ibe/windows",)
    def __init__(self, config): pass
"""
REFUSED = {
    "listener=[late]": r"listeners\.late=kinds_of_mine\.late:Late: it cannot be made \(ValueError: not today\)",
    "metric=[late]": r"metrics\.late: its column ibe/windows is taken; allowed is another one, as late/x",
}


@pytest.mark.parametrize("chosen", REFUSED)
def test_one_that_cannot_be_made_is_refused_before_there_is_a_folder(folder: Path, tmp_path: Path, chosen: str):
    (folder / "kinds_of_mine/late.py").write_text(LATE)
    (folder / "mine/listener/late.yaml").write_text("kind: kinds_of_mine.late:Late\n")
    (folder / "mine/metric/late.yaml").write_text("kind: kinds_of_mine.late:Greedy\n")
    with pytest.raises(SystemExit, match=f"^error: {REFUSED[chosen]}"):
        call("train", *mine(chosen, f"run_dir={tmp_path / 'run'}", "viewer=off"))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("group", GROUPS)
def test_a_kind_that_is_none_is_refused(group: str):
    for kind in ("nonsense", "../x", "networks", "") if group not in ("mapping", *SEVERAL) else ():
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
    assert config.agent.mirror is False  # the demo is from before there was a mirror image
    assert config.obedience.absorbing is False  # and before the end of an episode was judged
    assert (config.agent.kind, config.instructor.kind, config.mapping.kind) == ("ppo", "oracle", "axis")
    assert config.predictor.kind == "simulator"


def test_a_setting_that_is_gone_does_not_keep_a_folder_from_opening(tmp_path: Path):
    old = load_config(saved(tmp_path, "obedience", "centred", value=True), TrainConfig)
    assert old.obedience.absorbing is False
    new = load_config(saved(tmp_path, "obedience", "absorbing", value=True), TrainConfig)
    assert new.obedience.absorbing is True


def test_settings_that_nothing_reads_are_refused_when_they_are_asked_for(tmp_path: Path):
    for setting, mapping, because, allowed in (
        ("hidden=[8]", "axis", "space=rule", r"\[32, 32\]"),
        ("n_init=9", "axis_quantile", "split=quantile", "4"),
    ):
        message = rf"^mapping\.{re.escape(setting)}: nothing reads it with mapping\.{because}; allowed is {allowed}$"
        with pytest.raises(ConfigError, match=message):
            composed("train", [f"mapping={mapping}", f"mapping.{setting}"])
    assert composed("train", ["mapping=network", "mapping.hidden=[8]"]).mapping.hidden == [8]
    old = saved(tmp_path, "mapping", "hidden", value=[8])  # as an earlier version took it
    assert load_config(old, TrainConfig).mapping.hidden == [8]


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
        *(("listeners", "x", "kind"), ("loggers", "x", "kind"), ("metrics", "x", "kind"), ("env", "id")),
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
