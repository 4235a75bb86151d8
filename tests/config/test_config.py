"""Every file in configs/ composes, every limit holds, and no setting is there for nothing."""

import ast
from copy import deepcopy
from dataclasses import asdict, fields, replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from every_setting import CHOICES, LIMITS, ROOT, SCHEMAS
from hydra import compose, initialize_config_dir
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config import settings as schemas
from ibe_rl.config.kind_files import register
from ibe_rl.config.kinds import GROUPS, ROOMS, SEVERAL, check_config, implementation, settings_of
from ibe_rl.config.settings import (
    CODE_SETTINGS,
    CollectConfig,
    ExplainConfig,
    InstructorConfig,
    LogConfig,
    PredictorConfig,
    TrainConfig,
    ViewerConfig,
)
from ibe_rl.envs.lander_task import LANDER_TASK
from ibe_rl.ibe import IBEConfig, IBEMapping
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.fitting import check_mapping
from ibe_rl.vocabulary.tracker import check_refreshing

NEEDED = {"recorded": ["instructor.recording=a_run"], "habits": ["instructor.run=a_run"]}
"""What a choice cannot do without."""
SWEPT = {"horizon": "horizon_steps", "clusters": "n_clusters", "mappings": "mapping", "agents": "agent"}
"""What a sweep varies, where it is not called just so."""


def composed(root: str, *overrides: str) -> Any:
    return deepcopy(_composed(root, *overrides))


@cache
def _composed(root: str, *overrides: str) -> Any:
    register()
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        values = OmegaConf.to_object(compose(root, list(overrides)))
    check_config(values)
    return values


@pytest.mark.parametrize("root", sorted(path.stem for path in (ROOT / "configs").glob("*.yaml")))
def test_every_root_composes(root: str):
    assert isinstance(composed(root), {"train": TrainConfig, "explain": ExplainConfig}[root])


@pytest.mark.parametrize(("group", "name"), [choice for choice in CHOICES if choice[0] not in ("experiment", "sweep")])
def test_every_choice_composes(group: str, name: str):
    config = composed("train", f"{group}={name}", *NEEDED.get(name, ()))
    if group in SEVERAL:
        assert implementation(group, getattr(config, SEVERAL[group])[name].kind).name == name
        return
    chosen = getattr(config, group)
    own = getattr(chosen, "kind", getattr(chosen, "mode", None))
    if group != "env":
        assert own in (name, None)
    if group in ("predictor", "viewer"):
        assert getattr(composed("explain", f"{group}={name}"), group) == chosen


@pytest.mark.parametrize("name", [name for group, name in CHOICES if group == "experiment"])
def test_every_experiment_composes_and_what_is_said_beside_it_wins(name: str):
    assert composed("train") != composed("train", f"experiment={name}")
    for agent in ("dqn", "ppo"):
        assert composed("train", f"experiment={name}", f"agent={agent}").agent.kind == agent


def test_the_papers_experiment_trains_its_kind_of_agent_and_reports():
    cfg = composed("train", "experiment=paper")
    assert (cfg.agent.kind, cfg.report) == ("dqn", True)
    assert not composed("train").report


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for group, name in CHOICES if group == "sweep"])
def test_every_sweep_varies_what_it_is_called_after_and_each_of_its_runs_can_work(name: str):
    register()
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        swept = compose("train", [f"sweep={name}"], return_hydra_config=True).hydra.sweeper.params
        loader = GlobalHydra.instance().config_loader()
        parsed = OverridesParser.create(loader).parse_overrides([f"{key}={values}" for key, values in swept.items()])
        runs = BasicSweeper.split_arguments(parsed, None)[0]
    varied = {key.rpartition(".")[2] for key in swept}
    assert varied == {"seeds": {"seed"}}.get(name, {"seed", SWEPT.get(name, name)})
    assert len({tuple(run) for run in runs}) == len(runs) >= 5
    for run in runs:
        if "seed=0" not in run:  # the others differ in nothing else
            continue
        cfg = composed("train", f"sweep={name}", *run)
        check_refreshing(cfg, LANDER_TASK)
        assert replace(cfg, run_dir="") == replace(composed("train", *run), run_dir="")  # nothing else is changed


def test_the_sweep_of_mappings_has_every_mapping():
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        values = compose("train", ["sweep=mappings"], return_hydra_config=True).hydra.sweeper.params.mapping
        parser = OverridesParser.create(GlobalHydra.instance().config_loader())
        [override] = parser.parse_overrides([f"mapping={values}"])
        names = list(override.sweep_string_iterator())
    assert sorted(names) == sorted(name for group, name in CHOICES if group == "mapping")


@pytest.mark.parametrize(("group", "name"), [choice for choice in CHOICES if choice[0] in ROOMS])
def test_every_kind_is_a_module_that_is_called_like_its_file(group: str, name: str):
    made = implementation(group, name)
    assert (made.kind, made.__module__) == (name, f"{ROOMS[group]}.{name}")
    settings = settings_of(group, name)
    assert settings is GROUPS[group] or (settings.kind, settings.__module__) == (name, made.__module__)


def test_every_mode_of_the_viewer_has_a_file():
    modes = next(item for item in fields(ViewerConfig) if item.name == "mode").metadata["choices"]
    assert {name for place, name in CHOICES if place == "viewer"} == set(modes)


@pytest.mark.parametrize("name", [name for group, name in CHOICES if group == "mapping"])
def test_every_mapping_is_called_like_its_file_and_can_work(name: str):
    chosen = composed("train", f"mapping={name}").mapping
    assert chosen.kind == name
    check_mapping(chosen, LANDER_TASK)


def test_no_two_mappings_are_the_same():
    chosen = [composed("train", f"mapping={name}").mapping for group, name in CHOICES if group == "mapping"]
    settings = [asdict(replace(each, kind="")) for each in chosen]
    assert all(one != other for one, other in combinations(settings, 2))


def test_the_composed_defaults_are_those_of_the_dataclasses():
    cfg = composed("train")
    assert cfg.agent == PPOConfig(noise_steps=10)  # of the lander
    assert composed("train", "agent=dqn").agent == DQNConfig(noise_steps=10)
    assert cfg.collect == CollectConfig()
    assert cfg.log == LogConfig()
    assert cfg.instructor == InstructorConfig()
    assert cfg.obedience == schemas.ObedienceConfig()
    for group, kind in [choice for choice in CHOICES if choice[0] in ROOMS and choice[1] not in NEEDED]:
        config = getattr(composed("train", f"{group}={kind}"), group)
        of_the_lander = {"noise_steps": 10.0} if group == "agent" else {}
        assert replace(config) == settings_of(group, kind)(kind=kind, **of_the_lander)
    assert composed("train", "mapping=paper").mapping == IBEConfig(horizon_steps=60, delay_steps=0)  # of the lander
    assert cfg.predictor == PredictorConfig()
    assert cfg.viewer == ViewerConfig()
    for item in fields(TrainConfig):
        if item.metadata.keys() >= LIMITS:
            assert getattr(cfg, item.name) == item.default
    explain = composed("explain")
    assert explain.predictor == PredictorConfig()
    assert (explain.run, explain.seed, explain.context) == (None, 0, None)


def test_a_setting_that_is_none_is_refused():
    with pytest.raises(ConfigError, match=r"mapping\.colour=red: no such setting; allowed are kind, horizon_steps"):
        composed("train", "+mapping.colour=red")


@cache
def reads() -> set[str]:
    """Names read from anything that is called like a config or a part of one, outside ``config.py``."""
    parts = [*fields(TrainConfig), *fields(ExplainConfig)]
    owners = {"cfg", "config", "_config", "ahead", *(item.name for item in parts)}
    found = {*IBEMapping().get_params(), *CODE_SETTINGS, "explained_range"}  # these by their name
    for path in [*(ROOT / "ibe_rl").rglob("*.py"), ROOT / "train.py", ROOT / "explain.py"]:
        if path.name == "config.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute):
                owner = node.value
                name = owner.attr if isinstance(owner, ast.Attribute) else getattr(owner, "id", None)
                if name in owners:
                    found.add(node.attr)
    return found


@pytest.mark.parametrize("schema", SCHEMAS, ids=lambda schema: schema.__name__)
def test_every_setting_is_read_somewhere(schema: type):
    assert {item.name for item in fields(schema)} - reads() == set()


def test_every_kind_of_listener_and_metric_is_listed_under_its_name():
    assert {SEVERAL[group] for group in GROUPS.keys() - ROOMS.keys() - {"mapping"}} == {
        "listeners",
        "loggers",
        "metrics",
    }


def attributes_read(path: Path, owner: str) -> set[str]:
    """Names read from what is called ``owner``."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)]
    mine = [node for node in nodes if isinstance(node.value, ast.Name) and node.value.id == owner]
    return {node.attr for node in mine if isinstance(node.ctx, ast.Load)}


def test_what_is_passed_on_to_the_estimator_is_read_there():
    settings = set(IBEMapping().get_params())
    assert settings <= attributes_read(ROOT / "ibe_rl" / "ibe" / "estimator.py", "self")
