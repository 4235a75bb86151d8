"""What crosses the layers: shapes are checked, nothing can be changed afterwards."""

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from ibe_rl.data import Episode, observe, read_only
from ibe_rl.env import LANDER_TASK


def episode(**changes: Any) -> Episode:
    parts: dict[str, Any] = {
        "states": np.zeros((4, 2)),
        "actions": np.zeros(3, int),
        "rewards": np.array([0.5, 1.0, -2.0], np.float32),
        "instructions": np.zeros((3, 1)),
        "given": np.ones(3, bool),
        "terminated": True,
        "success": False,
        "context": "here",
    }
    return Episode(**(parts | changes))


def test_observe_joins_state_instruction_given_in_this_order():
    seen = observe(np.array([[1.0, 2.0]]), np.array([[-1.0]]), np.array([[1.0]]))
    assert seen.dtype == np.float32
    assert seen.tolist() == [[1.0, 2.0, -1.0, 1.0]]


def test_read_only_gives_a_view_that_cannot_be_written():
    array = np.zeros((2, 3))
    view = read_only(array, (2, None), "name")
    assert np.shares_memory(view, array)
    with pytest.raises(ValueError, match="read-only"):
        view[0, 0] = 1
    array[0, 0] = 1  # the owner still can


@pytest.mark.parametrize("shape", [(3, 3), (2,), (2, 3, 1)])
def test_read_only_names_both_shapes(shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"thing has shape \(2, 3\), expected") as caught:
        read_only(np.zeros((2, 3)), shape, "thing")
    assert str(caught.value).endswith(str(shape))


def test_episode_has_a_state_more_than_actions():
    whole = episode()
    assert len(whole) == 3
    assert len(whole.states) == 4
    assert whole.total_reward == -0.5
    assert len(episode(actions=np.zeros((3, 2)))) == 3  # continuous actions


@pytest.mark.parametrize(
    "changes",
    [
        {"states": np.zeros((3, 2))},
        {"states": np.zeros(4)},
        {"rewards": np.zeros(4)},
        {"rewards": np.zeros((3, 1))},
        {"instructions": np.zeros(3)},
        {"given": np.ones((3, 1), bool)},
    ],
)
def test_episode_refuses_a_wrong_shape_by_name(changes: dict[str, Any]):
    with pytest.raises(ValueError, match=rf"Episode\.{next(iter(changes))} has shape"):
        episode(**changes)


def test_episode_cannot_be_changed():
    whole = episode()
    with pytest.raises(FrozenInstanceError):
        whole.success = True
    for name in ("states", "actions", "rewards", "instructions", "given"):
        assert not getattr(whole, name).flags.writeable


def test_total_reward_is_summed_in_double_precision():
    rewards = np.full(100_000, 0.1, np.float32)
    states, zeros = np.zeros((100_001, 1)), np.zeros((100_000, 1))
    long = episode(states=states, actions=rewards, rewards=rewards, instructions=zeros, given=rewards)
    assert long.total_reward == pytest.approx(100_000 * float(np.float32(0.1)), abs=1e-6)


def test_task_sizes():
    assert LANDER_TASK.instruction_size == 1
    assert LANDER_TASK.observation_size == len(LANDER_TASK.state_names) + 2
    assert len(LANDER_TASK.state_names) == len(LANDER_TASK.state_units)
