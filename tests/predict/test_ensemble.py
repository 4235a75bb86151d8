"""The ensemble learns dynamics that are known, and says where it does not know them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from cart import BEYOND, END, GOAL, POSITION, SPEED, after, coast, drive, logged, moment, right
from gymnasium import spaces

from ibe_rl.predict.ensemble import Ensemble, EnsembleConfig
from ibe_rl.predict.experience import ActionColumns
from ibe_rl.predict.members import make_layers
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Prediction

PUSHES = ActionColumns.of(spaces.Discrete(3))
SETTINGS = EnsembleConfig(members=3, hidden=[32], updates=250, minibatch_size=256, learning_rate=0.02)


def rule(states: Array) -> Array:
    return np.sign(states[..., :1])


def make(seed: int = 0, config: EnsembleConfig = SETTINGS, actions: ActionColumns = PUSHES) -> Ensemble:
    return Ensemble(config, actions, 4, rule, seed)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> TrajectoryLog:
    torch.set_num_threads(1)  # more of them would wait for each other
    return logged(tmp_path_factory.mktemp("log"))


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_weights_that_are_no_numbers_are_not_taken(tmp_path: Path):
    log = logged(tmp_path)
    log._columns["state"][:] = np.inf
    with pytest.raises(FloatingPointError, match="the weights of the predictor are not finite numbers"):
        make().learn(log)


@pytest.fixture(scope="module")
def learnt(log: TrajectoryLog) -> Ensemble:
    ensemble = make()
    ensemble.learn(log)
    return ensemble


@pytest.mark.slow
def test_it_follows_the_policy_as_the_cart_would_go(learnt: Ensemble):
    starts = [moment(-1.5), moment(0, -0.5), moment(-0.5, 0.5), moment(0.2, 0.1)]
    predicted = learnt.rollout(starts, coast, 20)
    for path, start in zip(predicted.paths, starts, strict=True):
        np.testing.assert_allclose(path[:, :2], drive(start.state, 20 * [0.0])[:, :2], atol=0.1)
    assert predicted.paths.shape == (4, 21, 4)
    assert predicted.trusted_steps.tolist() == [20] * 4
    assert (predicted.uncertainty < 1).all()


def test_what_never_changes_stays_and_a_flag_is_a_flag(learnt: Ensemble):
    predicted = learnt.rollout([moment(-1.0, 1.0, goal) for goal in (0, 1, 0.25)], right, 30)
    assert [set(path[:, GOAL].tolist()) for path in predicted.paths] == [{0}, {1}, {0.25}]
    assert set(np.unique(predicted.paths[..., BEYOND]).tolist()) == {0, 1}
    for path in predicted.paths:
        near = np.abs(path[:, POSITION] - 1) < 0.15
        assert ((path[:, POSITION] > 1) == path[:, BEYOND])[~near].all()


def test_an_end_stops_the_path(learnt: Ensemble):
    path = learnt.rollout([moment(1.5, 1.0)], right, 30).paths[0]
    stopped = int(np.argmax((path == path[-1]).all(axis=1)))
    assert abs(stopped - (len(drive(path[0], 30 * [1.0])) - 1)) <= 1
    assert path[-1, POSITION] == pytest.approx(END, abs=0.25)
    assert (path[stopped:] == path[stopped]).all()


def test_where_the_members_part_the_path_is_not_trusted(learnt: Ensemble):
    known = learnt.rollout([moment(0.0), moment(-30.0, -40.0)], coast, 40)
    assert known.trusted_steps.tolist()[0] == 40
    assert known.trusted_steps.tolist()[1] < 40
    assert known.uncertainty[1] > 1 > known.uncertainty[0]


@pytest.mark.parametrize("future", ["hold", "rule"])
def test_the_policy_reads_its_future_instruction(log: TrajectoryLog, future: str):
    ensemble, seen = make(config=EnsembleConfig(**{**vars(SETTINGS), "updates": 5, "future_instruction": future})), []

    def noting(observations: Array) -> Array:
        seen.append(observations.copy())
        return coast(observations)

    ensemble.learn(log)
    paths = ensemble.rollout([moment(-1.0), moment(1.2)], noting, 5).paths
    read = np.array(seen)
    np.testing.assert_array_equal(read[0, :2, :4], paths[:, 0])
    assert read[0, :2, 4:].tolist() == [[0, 1], [0, 1]]
    np.testing.assert_array_equal(np.sort(read[1:, :2, 0]), np.sort(paths[:, 1:-1, 0].T))
    later = [[0, 1]] if future == "hold" else [[-1, 1], [1, 1]]
    assert np.unique(read[1:, :2, 4:].reshape(-1, 2), axis=0).tolist() == later


def same(one: Prediction, other: Prediction) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in vars(one))


def test_the_same_seed_learns_the_same_and_another_one_does_not(log: TrajectoryLog):
    made = [make(seed, EnsembleConfig(**{**vars(SETTINGS), "updates": 5})) for seed in (1, 1, 2)]
    for ensemble in made:
        ensemble.learn(log)
    first, again, other = (ensemble.rollout([moment(0.0), moment(1.0)], right, 12) for ensemble in made)
    assert same(first, again)
    assert not same(first, other)


def test_few_and_many_at_once_are_predicted_alike(learnt: Ensemble):
    starts = [moment(position) for position in np.linspace(-2, 1.5, 31)]
    small = make(config=EnsembleConfig(**{**vars(SETTINGS), "moments_at_once": 7}))
    small.load_state_dict(learnt.state_dict())
    whole, parts = (one.rollout(starts, right, 25) for one in (learnt, small))
    np.testing.assert_allclose(whole.paths, parts.paths, atol=1e-5)
    np.testing.assert_array_equal(whole.trusted_steps, parts.trusted_steps)


def test_one_that_goes_on_from_its_state_learns_what_it_would_have_learnt(log: TrajectoryLog):
    config = EnsembleConfig(**{**vars(SETTINGS), "updates": 10})
    whole, other = make(config=config), make(config=config)
    assert make().state_dict() == {}
    whole.learn(log)
    other.load_state_dict({})
    other.load_state_dict(whole.state_dict())
    for ensemble in (whole, other):
        ensemble.learn(log)
        ensemble.forget()
    assert same(*(ensemble.rollout([moment(0.0)], right, 12) for ensemble in (whole, other)))
    assert whole.state_dict()["times"] == 2
    whole.close()


def test_continuous_actions_are_numbers(tmp_path: Path):
    pushes = ActionColumns.of(spaces.Box(-1, 1, (1,)))
    ensemble = make(actions=pushes)
    ensemble.learn(logged(tmp_path, continuous=True))
    half = ensemble.rollout([moment(-1.0)], lambda seen: np.full((len(seen), 1), 0.5, np.float32), 20).paths[0]
    np.testing.assert_allclose(half[:, SPEED], drive(half[0], 20 * [0.5])[:, SPEED], atol=0.1)
    assert after(half[0], 0.5)[SPEED] == pytest.approx(half[1, SPEED], abs=0.02)


def test_only_what_had_ended_by_a_frame_is_learnt_from(log: TrajectoryLog):
    frame = int(log.index["frame"][40])
    config = EnsembleConfig(**{**vars(SETTINGS), "updates": 5})
    early, again = make(config=config), make(config=config)
    early.learn(log, until_frame=frame)
    again.learn(log)
    assert not same(*(one.rollout([moment(0.0)], right, 12) for one in (early, again)))
    with pytest.raises(ValueError, match="no whole episode"):
        make().learn(log, until_frame=3)


def test_what_does_not_fit_is_refused(learnt: Ensemble):
    with pytest.raises(ValueError, match="not been trained yet"):
        make().rollout([moment(0.0)], right, 3)
    state = learnt.state_dict()
    with pytest.raises(ValueError, match=r"layer 0 has the shapes .* expected"):
        make(config=EnsembleConfig(members=2, hidden=[32])).load_state_dict(state)
    short: dict[str, Any] = {name: values[:3] for name, values in state["scale"].items()}
    with pytest.raises(ValueError, match="its states have 3 dimensions, expected 4"):
        make().load_state_dict({**state, "scale": short})
    assert make_layers(2, [3, 1], 0)[0][0].shape == (2, 3, 1)


@pytest.mark.parametrize(
    ("space", "actions", "expected"),
    [
        (spaces.Discrete(2, start=4), [4, 5], [[1, 0], [0, 1]]),
        (spaces.MultiDiscrete([2, 3], start=[1, 0]), [[2, 0], [1, 2]], [[0, 1, 1, 0, 0], [1, 0, 0, 0, 1]]),
        (spaces.MultiBinary(2), [[1, 0]], [[0, 1, 1, 0]]),
    ],
)
def test_choices_become_columns(space: spaces.Space, actions: list[Any], expected: list[list[int]]):
    columns = ActionColumns.of(space)
    assert columns(np.array(actions)).tolist() == expected
    assert columns.size == len(expected[0])
