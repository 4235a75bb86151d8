"""What all predictors promise, and which settings of them are refused."""

from collections.abc import Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import EnvConfig, InstructorConfig, PredictorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.explain.what_if import told_twins
from ibe_rl.instructors import make_instructor
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.predict import KeptPredictor, check_predictor, is_learnt, make_predictor
from ibe_rl.predict.ensemble import EnsembleConfig
from ibe_rl.predict.regression import RegressionConfig
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, ConfigError, Episode, Moment, Prediction

LANDER = EnvConfig(LANDER_ID)
KINDS: dict[str, PredictorConfig] = {
    "simulator": PredictorConfig(),
    "ensemble": EnsembleConfig(updates=5, minibatch_size=64, hidden=[8], moments_at_once=4),
    "ensemble by rule": EnsembleConfig(updates=5, minibatch_size=64, members=2, future_instruction="rule"),
    "regression": RegressionConfig(),
}


def fall(observations: Array) -> Array:
    return np.zeros(len(observations), int)


def add(log: TrajectoryLog, episode: Episode) -> None:
    done = np.arange(len(episode)) == len(episode) - 1
    steps = {
        "state": episode.states[:-1],
        "next_state": episode.states[1:],
        "action": episode.actions,
        "reward": episode.rewards,
        "instruction": episode.instructions,
        "given": episode.given,
        "done": done,
        "terminated": done & episode.terminated,
        "success": done & episode.success,
    }
    log.add({name: column[None] for name, column in steps.items()}, LANDER_TASK.context)


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> tuple[TrajectoryLog, Sequence[Moment]]:
    """A log of falling landers, and the moments of the last one."""
    torch.set_num_threads(1)
    log = TrajectoryLog(tmp_path_factory.mktemp("log"), 10_000, LANDER_TASK.contexts)
    instructor = make_instructor(InstructorConfig(), LANDER_TASK)
    for seed in range(6):
        watched = record_rollout(make_env(LANDER), fall, instructor, seed)
        add(log, watched.episode)
    return log, watched.moments


@pytest.fixture(params=KINDS)
def predictor(request: pytest.FixtureRequest, fallen: Any) -> KeptPredictor:
    config = KINDS[request.param]
    made = make_predictor(
        config, partial(make_snapshot_env, LANDER), LANDER_TASK.rule, 3, make_env(LANDER), lambda: [10, 30]
    )
    made.learn(fallen[0])
    return made


def test_every_predictor_keeps_the_protocol(predictor: KeptPredictor, fallen: Any):
    moments = fallen[1][::20]
    for horizon in (1, 25):
        predicted = predictor.rollout(moments, fall, horizon)
        assert predicted.paths.shape == (len(moments), horizon + 1, 9)
        assert predicted.paths.dtype == np.float32
        np.testing.assert_array_equal(predicted.paths[:, 0], [moment.state for moment in moments])
        assert np.isfinite(predicted.paths).all()
        assert (predicted.paths[:, 1] != predicted.paths[:, 0]).any(axis=1).all()
        assert ((predicted.trusted_steps >= 0) & (predicted.trusted_steps <= horizon)).all()
        assert (np.isfinite(predicted.uncertainty) & (predicted.uncertainty >= 0)).all()
        assert not predicted.paths.flags.writeable


def test_every_predictor_goes_on_from_its_state(predictor: KeptPredictor, fallen: Any, request: pytest.FixtureRequest):
    config = KINDS[request.node.callspec.params["predictor"]]
    other = make_predictor(
        config, partial(make_snapshot_env, LANDER), LANDER_TASK.rule, 3, make_env(LANDER), lambda: [10, 30]
    )
    predictor.rollout(fallen[1][:5], fall, 3)
    predictor.forget()
    other.load_state_dict(predictor.state_dict())
    one, again = (each.rollout(fallen[1][::20], fall, 20) for each in (predictor, other))
    for name in vars(one):
        np.testing.assert_array_equal(getattr(one, name), getattr(again, name))
    predictor.close()
    other.close()


def test_the_exact_one_stands_by_all_that_it_says(fallen: Any):
    made = Simulator.make(
        PredictorConfig(), make_snapshot_env=partial(make_snapshot_env, LANDER), rule=LANDER_TASK.rule, seed=0
    )
    made.learn(fallen[0])
    predicted = made.rollout(fallen[1][:3], fall, 7)
    assert predicted.trusted_steps.tolist() == [7] * 3
    assert predicted.uncertainty.tolist() == [0] * 3


def test_a_prediction_is_of_one_size():
    with pytest.raises(ValueError, match=r"Prediction.trusted_steps has shape \(1,\), expected \(2,\)"):
        Prediction(np.zeros((2, 4, 1)), np.zeros(1), np.zeros(2))


def with_actions(actions: spaces.Space[Any]) -> Any:
    """An environment that declares its actions only."""
    return SimpleNamespace(action_space=actions, has_wrapper_attr=lambda _: False)


def refused(config: PredictorConfig, instructor: InstructorConfig, actions: spaces.Space[Any]) -> str:
    with pytest.raises(ConfigError) as error:
        check_predictor(config, instructor, with_actions(actions))
    return str(error.value)


def test_settings_that_cannot_work_are_refused():
    oracle, four = InstructorConfig(), spaces.Discrete(4)
    assert refused(EnsembleConfig(), HumanConfig(), four).endswith("allowed is predictor=simulator")
    assert "actions Dict(" in refused(EnsembleConfig(), oracle, spaces.Dict(a=four))
    for hidden in ([], [8, 0]):
        assert refused(EnsembleConfig(hidden=hidden), oracle, four).startswith(f"predictor.hidden={hidden}: allowed")
    config = RegressionConfig(spans_steps=[20, 0])
    assert refused(config, oracle, four).startswith("predictor.spans_steps=[20, 0]: allowed is at least 1")
    for config in KINDS.values():
        check_predictor(config, oracle, with_actions(four))
    check_predictor(PredictorConfig(), HumanConfig(), with_actions(spaces.MultiBinary(3)))
    assert [is_learnt(config) for config in KINDS.values()] == [False, True, True, True]


VALUES = {name: np.array([value], np.float32) for name, value in (("left", -1.0), ("down", 0.0), ("right", 1.0))}


def obey(observations: Array) -> Array:
    """The engine that pushes as it is told, none if it is told 0 or nothing."""
    return np.select([observations[:, -2] < 0, observations[:, -2] > 0], [3, 1], 0)


def again(predictor: KeptPredictor, request: pytest.FixtureRequest) -> KeptPredictor:
    config = KINDS[request.node.callspec.params["predictor"]]
    made = make_predictor(
        config, partial(make_snapshot_env, LANDER), LANDER_TASK.rule, 3, make_env(LANDER), lambda: [10, 30]
    )
    made.load_state_dict(predictor.state_dict())
    return made


@pytest.mark.parametrize("count", [3, 13])  # in one part of the simulator's, and in parts of their own
def test_what_else_is_told_changes_no_other_future(
    predictor: KeptPredictor, fallen: Any, request: pytest.FixtureRequest, count: int
):
    moments = fallen[1][: 2 * count : 2]
    alone, others = (again(predictor, request) for _ in range(2))
    together = predictor.rollout([*moments, *told_twins(moments, VALUES)], obey, 12)
    for name, values in vars(alone.rollout(moments, obey, 12)).items():
        np.testing.assert_array_equal(values, getattr(together, name)[:count])
    left = others.rollout([*moments, *told_twins(moments, {"left": VALUES["left"]})], obey, 12)
    np.testing.assert_allclose(left.paths[count:], together.paths[count : 2 * count], atol=1e-4)
    ends = together.paths[:, -1].reshape(4, count, -1)
    assert np.abs(ends[1] - ends[3]).max() > 1e-3  # told left, told right


def test_one_that_is_told_the_same_has_the_same_chances(predictor: KeptPredictor, fallen: Any):
    moments = fallen[1][:4]
    paths = predictor.rollout([*moments, *told_twins(moments, VALUES)], fall, 12).paths.reshape(4, 4, 13, -1)
    if type(predictor).__name__ != "Regression":  # it reads the instruction itself, and asks no policy
        np.testing.assert_allclose(paths[1:], np.broadcast_to(paths[:1], paths[1:].shape), atol=1e-4)


def test_a_twin_is_told_the_same_to_the_end_also_where_the_rule_tells_the_others(fallen: Any):
    seen: list[Array] = []

    def noting(observations: Array) -> Array:
        seen.append(observations[:, -2:].copy())
        return fall(observations)

    for config in (KINDS["ensemble by rule"], PredictorConfig(future_instruction="rule")):
        made = make_predictor(
            config, partial(make_snapshot_env, LANDER), LANDER_TASK.rule, 3, make_env(LANDER), lambda: [10, 30]
        )
        made.learn(fallen[0])
        seen.clear()
        made.rollout([fallen[1][0], *told_twins(fallen[1][:1], {"half": np.array([0.5], np.float32)})], noting, 9)
        heard = [float(value) for each in seen for value, _ in each if value in (0.5, -0.5)]
        assert heard
        assert set(heard) == {0.5}
        assert len(heard) % 9 == 0
