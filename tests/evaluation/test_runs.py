"""A run folder opens as it last was, and says what it lacks; nothing in it is run."""

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from by_hand import plain
from omegaconf import OmegaConf

from ibe_rl.agents import make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import (
    AgentConfig,
    EnvConfig,
    InstructorConfig,
    PredictorConfig,
    TrainConfig,
    ViewerConfig,
)
from ibe_rl.envs import LANDER_ID
from ibe_rl.evaluation import runs
from ibe_rl.evaluation.runs import earlier_state, load_run, open_trained
from ibe_rl.evaluation.trained_run import explainer_state
from ibe_rl.ibe import ClusterMapping, IBEConfig, Reactions
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.storage.checkpoint import save_policy
from ibe_rl.storage.run_folder import (
    CALIBRATION,
    CHECKPOINTS,
    CONFIG,
    EVALUATION,
    METRICS,
    REFRESHES,
    create_run_folder,
    write_json,
)
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.training_episodes import settled

OBSERVATIONS = np.random.default_rng(0).normal(size=(50, 11)).astype(np.float32)
ACTIONS: Any = gymnasium.spaces.Discrete(4)


def mapping_of(first: float, dimensions: int = 9) -> ClusterMapping:
    k, ones = np.zeros((2, 1)), np.ones(2)
    expressions = np.array([[first], [1]])
    return ClusterMapping(plain(dimensions), np.zeros((2, dimensions)), k, expressions, ones, ones, ones, np.arange(2))


def config_of(agent: AgentConfig) -> TrainConfig:
    parts: dict[str, Any] = {"mapping": IBEConfig(), "predictor": PredictorConfig(), "viewer": ViewerConfig()}
    env = EnvConfig(id=LANDER_ID, kwargs={"pad": "left"})
    return TrainConfig(run_dir="x", env=env, agent=agent, instructor=InstructorConfig(), **parts)


def write_config(folder: Path, config: Any) -> None:
    OmegaConf.save(OmegaConf.structured(config), folder / CONFIG)


def write_policy(folder: Path, frame: int, agent: AgentConfig) -> Any:
    torch.manual_seed(frame)
    greedy = make_agent(agent, 11, ACTIONS, 1_000).greedy
    save_policy(folder / CHECKPOINTS, frame, greedy.state_dict())
    return greedy


def write_mapping(
    folder: Path,
    frame: int,
    mapping: ClusterMapping,
    calibration: Calibration | None = None,
    reactions: Reactions | None = None,
    **spans: ClusterMapping,
) -> None:
    other = [{"horizon_steps": int(name.removeprefix("n")), "mapping": each.to_dict()} for name, each in spans.items()]
    values = {"frame": frame, "horizon_steps": 40, "mapping": mapping.to_dict(), "spans": other}
    values["calibration"] = calibration and calibration.to_dict()
    values["reactions"] = reactions and reactions.to_dict()
    write_json(folder / REFRESHES / f"{frame:012d}.json", values)


def write_run(folder: Path, agent: AgentConfig) -> Path:
    create_run_folder(folder)
    write_config(folder, config_of(agent))
    for frame in (900, 1_000):
        write_policy(folder, frame, agent)
    for frame, first in ((500, -0.1), (950, -0.2), (1_100, -0.3)):
        write_mapping(folder, frame, mapping_of(first))
    return folder


PPO, DQN = PPOConfig(hidden=[6]), DQNConfig(hidden=[6])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", PPO)


@pytest.mark.parametrize("agent", [PPO, DQN], ids=["ppo", "dqn"])
def test_a_run_opens_as_it_last_was(tmp_path: Path, agent: AgentConfig):
    folder = write_run(tmp_path / "run", agent)
    run = load_run(folder)
    assert run.folder == folder
    assert run.config == replace(config_of(agent), mapping=settled(config_of(agent).mapping, 40))
    assert run.config.mapping.horizon_steps == run.horizon_steps == 40
    assert type(run.config.agent) is type(agent)
    assert run.policy_frame == 1_000
    expected = write_policy(folder, 1_000, agent)
    np.testing.assert_array_equal(run.policy(OBSERVATIONS), expected(OBSERVATIONS))
    assert len(set(run.policy(OBSERVATIONS))) > 1
    assert run.task.name == "Lunar Lander with pads"
    assert run.make_env().reset(seed=0)[0][8] == np.float32(-0.6)


@pytest.mark.parametrize("missing", [REFRESHES, CHECKPOINTS])
def test_the_newest_run_is_one_that_can_explain(folder: Path, monkeypatch: pytest.MonkeyPatch, missing: str):
    """Not one that is in training, or was interrupted, before it had a vocabulary and a policy."""
    monkeypatch.setattr(runs, "_RUNS", folder.parent)
    newer = folder.with_name("newer")
    shutil.copytree(folder, newer)
    os.utime(newer / CONFIG, (2e9, 2e9))
    assert open_trained(None).folder == newer
    (newer / METRICS).touch()
    shutil.rmtree(newer / missing)
    assert open_trained(None).folder == folder


def test_the_vocabulary_is_the_last_one_before_the_policy(folder: Path):
    (folder / REFRESHES / "notes.json").write_text("not a refresh")
    run = load_run(folder)
    assert (run.mapping_frame, run.horizon_steps) == (950, 40)
    assert run.mapping.expressions[0, 0] == -0.2
    assert run.spans == {}


def test_an_earlier_state_is_the_nearest_policy_with_the_vocabulary_of_its_time(folder: Path):
    (folder / CHECKPOINTS / "policy_000000000900.pt").rename(folder / CHECKPOINTS / "between_000000000900.pt")
    run = load_run(folder)
    earlier = earlier_state(run, 940)
    assert (earlier.policy_frame, earlier.mapping_frame) == (900, 500)
    assert earlier.mapping.expressions[0, 0] == -0.1
    expected = write_policy(folder, 900, PPO)
    np.testing.assert_array_equal(earlier.policy(OBSERVATIONS), expected(OBSERVATIONS))
    assert earlier_state(run, 10_000).policy_frame == run.policy_frame
    (folder / REFRESHES / "000000000500.json").unlink()
    with pytest.raises(ConfigError, match="it has no vocabulary from before its policy of frame 900"):
        earlier_state(run, 0)
    shutil.rmtree(folder / CHECKPOINTS)
    with pytest.raises(ConfigError, match="it has no policy yet"):
        earlier_state(run, 900)


def test_the_vocabularies_of_other_spans_come_with_it(folder: Path):
    write_mapping(folder, 960, mapping_of(-0.4), n20=mapping_of(-0.5), n120=mapping_of(-0.6))
    run = load_run(folder)
    assert run.mapping.expressions[0, 0] == -0.4
    assert {n: each.expressions[0, 0] for n, each in run.spans.items()} == {20: -0.5, 120: -0.6}


def test_what_its_agent_did_when_instructed_otherwise_comes_with_it(folder: Path):
    assert load_run(folder).reactions is None
    asked = Reactions(np.ones((12, 1, 9)), np.zeros((12, 1, 9)))
    write_mapping(folder, 960, mapping_of(-0.4), reactions=asked)
    read = load_run(folder).reactions
    assert read is not None
    np.testing.assert_array_equal(read.up, asked.up)
    np.testing.assert_array_equal(read.down, asked.down)


@pytest.mark.parametrize("shape", [(12, 1, 8), (12, 2, 9)])
def test_reactions_of_another_shape_are_refused(folder: Path, shape: tuple[int, ...]):
    write_mapping(folder, 960, mapping_of(-0.4), reactions=Reactions(np.ones(shape), np.ones(shape)))
    message = rf"its agent's reactions have the shape {re.escape(str(shape))}, not \(\.\., 1, 9\)"
    with pytest.raises(ConfigError, match=message):
        load_run(folder)


def sure(intercept: float) -> Calibration:
    """As sure whatever there is to see."""
    return Calibration(("agreement", "purity"), np.zeros(2), np.ones(2), np.zeros(2), np.array([intercept]))


LEFT_OUT = "left out"


def write_judged(folder: Path, **changes: Any) -> Path:
    """What ``task=evaluate`` leaves of the confidence in the vocabulary of frame 950."""
    (folder / EVALUATION).mkdir(exist_ok=True)
    values = {"mapping_frame": 950, "horizon_steps": 40, "calibration": sure(2).to_dict()} | changes
    write_json(folder / EVALUATION / CALIBRATION, {name: value for name, value in values.items() if value != LEFT_OUT})
    return folder / EVALUATION / CALIBRATION


def intercept(folder: Path) -> float | None:
    calibration = load_run(folder).calibration
    return None if calibration is None else float(calibration.intercept[0])


def test_the_confidence_is_calibrated_as_the_refresh_was(folder: Path):
    assert load_run(folder).calibration is None
    write_mapping(folder, 950, mapping_of(-0.2), sure(1))
    assert intercept(folder) == 1


def test_what_an_evaluation_found_of_the_same_vocabulary_is_trusted_more(folder: Path):
    write_mapping(folder, 950, mapping_of(-0.2), sure(1))
    path = write_judged(folder)
    assert intercept(folder) == 2
    write_judged(folder, mapping_frame=500)
    assert intercept(folder) == 1
    write_judged(folder, horizon_steps=60)
    assert intercept(folder) == 1
    path.unlink()
    assert intercept(folder) == 1
    write_mapping(folder, 950, mapping_of(-0.2))
    write_judged(folder)
    assert intercept(folder) == 2  # also if the refresh had none


def test_the_confidence_in_answers_is_calibrated_as_the_evaluation_was(folder: Path):
    write_mapping(folder, 950, mapping_of(-0.2), sure(1))
    write_judged(folder)
    assert load_run(folder).what_if_calibration is None  # as of earlier versions
    write_judged(folder, what_if=sure(3).to_dict())
    found = load_run(folder).what_if_calibration
    assert found is not None
    assert float(found.intercept[0]) == 3
    write_judged(folder, what_if=sure(3).to_dict(), mapping_frame=500)
    assert load_run(folder).what_if_calibration is None


@pytest.mark.parametrize(
    "damage",
    [
        {"what_if": None},
        *({name: LEFT_OUT} for name in ("mapping_frame", "horizon_steps", "calibration")),
        {"calibration": None},
        {"calibration": sure(1).to_dict() | {"scale": [0.0, 1.0]}},
        {"calibration": sure(1).to_dict() | {"mean": ["a", 0.0]}},
        "",
        "[]",
        '{"mapping_frame": 950',
        b"\xff\xfe",
    ],
    ids=str,
)
def test_a_damaged_calibration_is_refused(folder: Path, damage: dict[str, Any] | str | bytes):
    path = write_judged(folder, **(damage if isinstance(damage, dict) else {}))
    if not isinstance(damage, dict):
        path.write_bytes(damage if isinstance(damage, bytes) else damage.encode())
    with pytest.raises(ConfigError, match=rf"{re.escape(str(path))}: not a readable calibration \("):
        load_run(folder)


def test_a_run_speaks_with_all_that_it_learnt(folder: Path):
    write_mapping(folder, 950, mapping_of(-0.2), sure(1), n20=mapping_of(-0.5))
    run = load_run(folder)
    explainer = explainer_state(run)
    assert (explainer.mapping, explainer.horizon_steps, explainer.words, explainer.spans) == (
        run.mapping,
        40,
        run.task.phrases,
        run.spans,
    )
    assert explainer.calibration is run.calibration
    assert list(explainer.spans) == [20]


def test_a_run_without_a_policy_says_so(folder: Path):
    for path in (folder / CHECKPOINTS).iterdir():
        path.unlink()
    with pytest.raises(ConfigError, match=f"run={folder}: it has no policy yet"):
        load_run(folder)


def test_a_run_without_a_vocabulary_says_so(folder: Path):
    for frame in (500, 950):
        (folder / REFRESHES / f"{frame:012d}.json").unlink()
    with pytest.raises(ConfigError, match=f"run={folder}: it has no vocabulary from before its policy of frame 1,000"):
        load_run(folder)


@pytest.mark.parametrize("text", [None, "", "a: [", "agent: {kind: sac}", "- 1", "!!python/object/apply:os._exit [3]"])
def test_a_config_that_is_none_is_refused(folder: Path, text: str | None):
    path = folder / CONFIG
    if text is None:
        path.unlink()
    else:
        path.write_text(text)
    with pytest.raises(ConfigError, match=f"{path}: not the config of a run of this version"):
        load_run(folder)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"colour": "red"}, "not the config of a run of this version .*colour: no such setting"),
        ({"seed": "many"}, "not the config of a run of this version .*seed"),
        ({"seed": -1}, "seed=-1: allowed is"),
        ({"env": {"id": "Moon-v7", "kwargs": {}}}, r"env\.id=Moon-v7: not registered"),
    ],
)
def test_a_config_that_does_not_fit_is_refused(folder: Path, changes: dict[str, Any], message: str):
    saved = OmegaConf.to_container(OmegaConf.load(folder / CONFIG))
    OmegaConf.save(OmegaConf.create({**saved, **changes}), folder / CONFIG)
    with pytest.raises(ConfigError, match=message):
        load_run(folder)


def test_a_policy_of_another_network_is_refused(folder: Path):
    write_policy(folder, 2_000, replace(PPO, hidden=[7]))
    with pytest.raises(ConfigError, match=r"policy_000000002000\.pt: not a policy of this run \(.*state_dict"):
        load_run(folder)


@pytest.mark.parametrize("state", [torch.zeros(3), [1, 2], None, {"a": 1}], ids=["tensor", "list", "none", "dict"])
def test_what_is_no_policy_is_refused(folder: Path, state: Any):
    save_policy(folder / CHECKPOINTS, 2_000, state)
    with pytest.raises(ConfigError, match=r"policy_000000002000\.pt: not a policy of this run"):
        load_run(folder)


def test_a_confidence_made_of_something_else_is_refused(folder: Path):
    other = sure(1).to_dict() | {"names": ["agreement", "mood"]}
    write_mapping(folder, 950, mapping_of(-0.2))
    write_judged(folder, calibration=other)
    with pytest.raises(ConfigError, match="its confidence is made of agreement, mood; allowed are agreement, purity"):
        load_run(folder)


def test_a_damaged_policy_is_refused(folder: Path):
    (folder / CHECKPOINTS / "policy_000000002000.pt").write_bytes(b"nothing")
    with pytest.raises(ConfigError, match="not a readable checkpoint"):
        load_run(folder)


def test_a_damaged_vocabulary_is_refused(folder: Path):
    path = folder / REFRESHES / f"{990:012d}.json"
    path.write_text(json.dumps({"frame": 990}))
    with pytest.raises(ConfigError, match=f"{re.escape(str(path))} is not a readable refresh"):
        load_run(folder)


def test_a_vocabulary_of_another_environment_is_refused(folder: Path):
    write_mapping(folder, 990, mapping_of(0.0, dimensions=4))
    with pytest.raises(ConfigError, match=f"{folder}: its vocabulary is for 4 state dimensions, not 9"):
        load_run(folder)
