"""Agents of other libraries, and functions, as policies; what does not fit is refused with both sizes."""

import json
import pickle
import sys
import zipfile
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pilots
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete

from ibe_rl.apps.external.adapters import Batched
from ibe_rl.apps.external.finding import SB3_KINDS, find_agent, made_without_arguments
from ibe_rl.apps.external.policy import EpsilonGreedy, ExternalPolicy, as_policy
from ibe_rl.apps.external.reading import Reading
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.evaluation.run_predictor import crosses_processes, processes_for
from ibe_rl.types import ConfigError

FOUR: Any = Discrete(4)
THRUST: Any = Box(-1, 1, (2,))
WIDE: Any = Box(-9, 9, (2,))
OBSERVATIONS = np.random.default_rng(0).normal(size=(20, 11)).astype(np.float32)
OBSERVATIONS[:, 9:] = np.column_stack([np.arange(20) % 3 - 1, np.ones(20)])


def policy_of(agent: Any, sees: bool | None = None, actions: Any = FOUR) -> ExternalPolicy:
    return as_policy(agent, LANDER_TASK, actions, Reading(sees), OBSERVATIONS[:5])


def test_a_function_of_many_observations_is_called_with_all_of_them() -> None:
    policy = policy_of(pilots.sideways, False)
    assert policy.agent == Batched(pilots.sideways)
    np.testing.assert_array_equal(policy(OBSERVATIONS), pilots.sideways(OBSERVATIONS[:, :9]))
    assert policy(OBSERVATIONS).dtype == np.int64


def test_a_function_of_one_observation_is_called_for_each() -> None:
    policy = policy_of(pilots.pilot, False)
    np.testing.assert_array_equal(policy(OBSERVATIONS), [pilots.pilot(row[:9]) for row in OBSERVATIONS])


def test_what_reads_the_instruction_gets_it() -> None:
    np.testing.assert_array_equal(policy_of(pilots.obedient, True)(OBSERVATIONS), np.arange(20) % 3 + 1)


def test_actions_of_a_box_are_numbers_each() -> None:
    policy = policy_of(lambda states: states[:, :2].astype(float), False, WIDE)
    assert policy(OBSERVATIONS).dtype == np.float32
    np.testing.assert_array_equal(policy(OBSERVATIONS), OBSERVATIONS[:, :2])
    single = policy_of(lambda state: state[0] * np.ones(2), False, WIDE)
    np.testing.assert_array_equal(single(OBSERVATIONS), OBSERVATIONS[:, [0, 0]])


def test_a_torchrl_policy_is_read_without_chance_and_left_as_it_was() -> None:
    module = pilots.module()
    policy = policy_of(module, False)
    np.testing.assert_array_equal(policy(OBSERVATIONS), policy(OBSERVATIONS))
    assert len(set(policy(OBSERVATIONS).tolist())) > 1
    assert module.training
    tensor = policy_of(lambda states: module.module[0](pilots.torch.from_numpy(states)).argmax(-1), False)
    np.testing.assert_array_equal(policy(OBSERVATIONS), tensor(OBSERVATIONS))


@pytest.mark.parametrize(("kind", "instructed"), [("PPO", False), ("DQN", False), ("PPO", True)])
def test_a_model_of_stable_baselines3_does_what_it_does_there(kind: str, instructed: bool, tmp_path: Path) -> None:
    model = pilots.trained(kind, instructed)
    model.save(tmp_path / "model.zip")
    loaded = policy_of(find_agent(str(tmp_path / "model.zip")))
    expected = model.predict(OBSERVATIONS[:, : 11 if instructed else 9], deterministic=True)[0]
    for policy in (policy_of(model), loaded, policy_of(model.policy), pickle.loads(pickle.dumps(loaded))):  # noqa: S301 - our own
        np.testing.assert_array_equal(policy(OBSERVATIONS), expected)
    assert loaded.seen == (11 if instructed else 9)
    with pytest.raises(ConfigError, match="the agent says that it reads"):
        policy_of(model, not instructed)


@pytest.mark.parametrize("kind", SB3_KINDS)
def test_each_algorithm_of_stable_baselines3_is_known_by_its_file(kind: str, tmp_path: Path) -> None:
    package = import_module(SB3_KINDS[kind][1])
    env = gymnasium.make("Pendulum-v1" if kind in ("SAC", "TD3", "TQC", "CrossQ") else "CartPole-v1")
    policy = {"RecurrentPPO": "MlpLstmPolicy", "ARS": "LinearPolicy"}.get(kind, "MlpPolicy")
    size = {} if kind == "ARS" else {"net_arch": [4]}
    made = getattr(package, kind)(policy, env, policy_kwargs=size, device="cpu")
    made.save(tmp_path / "model.zip")
    assert type(find_agent(str(tmp_path / "model.zip"))) is type(made)


def test_a_function_is_found_by_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "mine_for_test.py").write_text("def fly(state):\n    return 2\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    np.testing.assert_array_equal(policy_of(find_agent("mine_for_test:fly"), False)(OBSERVATIONS), np.full(20, 2))


def packed(path: Path, **settings: Any) -> str:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps(settings))
    return str(path)


def test_what_cannot_be_loaded_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "text.zip").write_text("text")
    for name in ("text.zip", "missing.zip"):
        with pytest.raises(ConfigError, match=rf"agent=.*{name}: no readable model"):
            find_agent(str(tmp_path / name))
    with pytest.raises(ConfigError, match=r"allowed are MaskablePPO, .*, DQN, SAC, TD3, PPO, A2C, or MODULE:NAME"):
        find_agent(packed(tmp_path / "other.zip", something=1))
    with pytest.raises(ConfigError, match="PPO cannot load it"):
        find_agent(packed(tmp_path / "half.zip", clip_range=0.2))
    for name in ("model", "model:", "no_such_module:fly", "pilots:nothing"):
        with pytest.raises(ConfigError, match=rf"agent={name}.*allowed is a .zip of stable-baselines3, or MODULE:NAME"):
            find_agent(name)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(ConfigError, match=r"install the extra ibe_rl\[sb3\]"):
        find_agent(packed(tmp_path / "half.zip", clip_range=0.2))


def test_sizes_that_do_not_fit_are_named() -> None:
    with pytest.raises(ConfigError, match=r"agent_sees_instruction=null.*true for 11 numbers.*false for the state, 9"):
        policy_of(pilots.sideways)
    spaces = {"predict": None, "action_space": FOUR}
    for space, shape in ((Box(0, 1, (8,)), r"of shape \(8,\)"), (Dict(), r"Dict\(\)")):
        with pytest.raises(ConfigError, match=f"observations {shape}; allowed .* 9 numbers, or .* 11"):
            policy_of(SimpleNamespace(observation_space=space, **spaces))
    stacked = SimpleNamespace(observation_space=Box(0, 1, (27,)), **spaces)
    with pytest.raises(ConfigError, match="agent_frame_stack=3 if it was trained behind VecFrameStack"):
        policy_of(stacked)
    with pytest.raises(ConfigError, match=r"its actions are Discrete\(5\).*environment, Discrete\(4\)"):
        policy_of(SimpleNamespace(observation_space=pilots.SPACE, action_space=Discrete(5)))
    with pytest.raises(ConfigError, match=r"its actions are Discrete\(4\).*environment, Box"):
        policy_of(SimpleNamespace(observation_space=pilots.SPACE, action_space=FOUR), actions=THRUST)
    with pytest.raises(ConfigError, match=r"fails on an observation of 9 numbers .*RuntimeError.* 9 numbers, or .* 11"):
        policy_of(pilots.module(inputs=11), False)
    with pytest.raises(ConfigError, match="allowed are Discrete, and MultiDiscrete, MultiBinary or a Box of one dim"):
        policy_of(pilots.sideways, False, Dict())


def test_what_is_no_agent_is_refused() -> None:
    with pytest.raises(ConfigError, match="agent=7: allowed is a model"):
        policy_of(7, False)


@pytest.mark.parametrize("action", [4, -1, 0.5, np.nan, [1, 2], "left"])
def test_what_is_no_action_is_refused(action: Any) -> None:
    with pytest.raises(ConfigError, match=r"allowed is one action of Discrete\(4\) each"):
        policy_of(lambda _: action, False)


def test_numbers_that_are_not_finite_are_no_action() -> None:
    with pytest.raises(ConfigError, match="allowed is one action of Box"):
        policy_of(lambda _: np.array([0, np.inf]), False, THRUST)


def test_other_processes_are_only_asked_where_they_can_know_the_agent() -> None:
    known, unknown = policy_of(pilots.sideways, False), policy_of(lambda states: pilots.sideways(states), False)
    assert (crosses_processes(known), crosses_processes(unknown)) == (True, False)
    assert [processes_for(PredictorConfig().processes, policy) for policy in (known, unknown)] == [2, 1]
    assert processes_for(1, unknown) == 1
    assert processes_for(3, known) == 3
    with pytest.raises(ConfigError, match=r"predictor.processes=2.*allowed is 1"):
        processes_for(2, unknown)


def test_wandering_does_a_share_of_the_actions_at_random_and_the_same_with_the_same_seed() -> None:
    policy, many = policy_of(pilots.sideways, False), np.repeat(OBSERVATIONS, 50, axis=0)
    wandering = [EpsilonGreedy(policy, 0.5, FOUR, seed)(many) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(wandering[0], wandering[1])
    assert np.any(wandering[0] != wandering[2])
    assert np.mean(wandering[0] != policy(many)) == pytest.approx(0.5 * 0.75, abs=0.05)
    np.testing.assert_array_equal(EpsilonGreedy(policy, 0.0, FOUR, 0)(many), policy(many))


def test_a_function_of_one_state_is_no_function_of_as_many_states_as_it_has_numbers() -> None:
    """Two numbers, and two or five examples: what it makes of five states is not five actions."""
    task: Any = SimpleNamespace(state_names=("x", "v"), parts=(), percept_size=2, observation_size=4)
    examples = OBSERVATIONS[:5, :4]

    def wrapped(function: Any, actions: Any = WIDE) -> ExternalPolicy:
        return as_policy(function, task, actions, Reading(False), examples)

    single = wrapped(lambda state: 0.1 * state[:2])  # two states would be two actions
    np.testing.assert_allclose(single(examples), 0.1 * examples[:, :2])
    np.testing.assert_allclose(single(examples[:2]), 0.1 * examples[:2, :2])
    mean = wrapped(lambda state: state[..., :2] - state.mean())  # answers a batch, but with the mean of all its states
    np.testing.assert_allclose(mean(examples), examples[:, :2] - examples[:, :2].mean(axis=1, keepdims=True), rtol=1e-5)
    five: Any = SimpleNamespace(state_names=tuple("abcde"), parts=(), percept_size=5, observation_size=7)
    first = as_policy(lambda state: np.asarray(state[0] > 0, int), five, FOUR, Reading(False), OBSERVATIONS[:5, :7])
    np.testing.assert_array_equal(first(OBSERVATIONS[:5, :7]), OBSERVATIONS[:5, 0] > 0)


def test_what_can_be_read_as_an_action_is() -> None:
    yes = policy_of(lambda states: states[:, 0] > 0, False)
    assert yes(OBSERVATIONS).dtype == np.int64
    np.testing.assert_array_equal(yes(OBSERVATIONS), OBSERVATIONS[:, 0] > 0)
    column = policy_of(lambda states: np.full((len(states), 1), 2.0), False)
    np.testing.assert_array_equal(column(OBSERVATIONS), np.full(20, 2))
    one: Any = Box(-1, 1, (1,))
    assert policy_of(lambda states: states[:, 0].clip(-1, 1), False, one)(OBSERVATIONS).shape == (20, 1)
    several: Any = MultiDiscrete([3, 2])
    np.testing.assert_array_equal(policy_of(lambda _: [2, 1], False, several)(OBSERVATIONS), [[2, 1]] * 20)
    np.testing.assert_array_equal(policy_of(lambda _: [0.0, 1.0], False, MultiBinary(2))(OBSERVATIONS), [[0, 1]] * 20)
    with pytest.raises(ConfigError, match=r"allowed is one action of MultiDiscrete\(\[3 2\]\) each"):
        policy_of(lambda _: [2, 2], False, several)
    shifted: Any = Discrete(4, start=1)
    module = policy_of(pilots.module(), False)(OBSERVATIONS)
    np.testing.assert_array_equal(policy_of(pilots.module(), False, shifted)(OBSERVATIONS), module + 1)


def test_actions_outside_the_bounds_are_clipped_and_counted() -> None:
    policy = policy_of(lambda states: 5 * states[:, :2], False, THRUST)
    assert policy.clipped == []
    np.testing.assert_array_equal(policy(OBSERVATIONS), np.clip(5 * OBSERVATIONS[:, :2], -1, 1))
    assert len(policy.clipped) == 1
    assert abs(policy.clipped[0]) > 1
    spaces: Any = {"predict": None, "observation_space": pilots.SPACE}
    for declared in (Box(-2, 2, (2,)), Box(-1, 1, (3,))):
        with pytest.raises(ConfigError, match=r"its actions are Box.*of the environment"):
            policy_of(SimpleNamespace(action_space=declared, **spaces), actions=THRUST)
    with pytest.raises(ConfigError, match=r"its actions are Discrete\(4, start=1\)"):
        policy_of(SimpleNamespace(action_space=Discrete(4, start=1), **spaces))


def test_an_agent_that_answers_by_chance_is_noted_and_one_that_writes_into_its_argument_writes_into_a_copy() -> None:
    random = np.random.default_rng(0)
    policy = policy_of(lambda states: random.integers(0, 4, len(states)), False)
    assert "answers the same observations differently" in policy.notes[0]
    assert policy_of(pilots.sideways, False).notes == []

    def spoils(states: np.ndarray) -> np.ndarray:
        states[:] = 0
        return np.zeros(len(states), int)

    before = OBSERVATIONS.copy()
    policy_of(spoils, True)(OBSERVATIONS)
    np.testing.assert_array_equal(OBSERVATIONS, before)


def make_sideways() -> Any:
    return pilots.sideways


def test_what_takes_no_argument_makes_the_agent() -> None:
    assert made_without_arguments(make_sideways) is pilots.sideways
    assert made_without_arguments(pilots.sideways) is pilots.sideways
    assert isinstance(made_without_arguments(pilots.OneHot), pilots.OneHot)
    with pytest.raises(
        ConfigError, match=r"agent=broken: it failed when called to make the agent .RuntimeError: no we"
    ):
        made_without_arguments(broken)
    with pytest.raises(ConfigError, match="agent: OneHot is a network, which says nothing about actions"):
        policy_of(pilots.OneHot(), False)


def broken() -> Any:
    raise RuntimeError("no weights")


def test_weights_alone_are_no_agent(tmp_path: Path) -> None:
    (tmp_path / "model.pt").touch()
    with pytest.raises(ConfigError, match="it may hold weights only: name a function that loads them"):
        find_agent(str(tmp_path / "model.pt"))
