"""What crosses the layers: shapes are checked, nothing can be changed afterwards."""

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from ibe_rl.envs import LANDER_TASK
from ibe_rl.types import DOES_NOT_KNOW, Episode, Explanation, observe, read_only


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


def explanation(
    phrase: str, horizon_steps: int, known: bool = True, spans: tuple[Explanation, ...] = ()
) -> Explanation:
    nothing = np.zeros(1)
    path, futures = np.zeros((2, 1)), np.zeros((1, 1))
    return Explanation(nothing, phrase, 0, nothing, horizon_steps, 1.0, path, futures, known=known, spans=spans)


def in_time(own: str, *others: str) -> str:
    """What is said if 40 steps are called ``own`` and 20, 100, 60 what the others are called, ? being unsure."""
    [one, *rest] = [
        explanation(name.strip("?"), steps, known=not name.startswith("?"))
        for name, steps in zip((own, *others), (40, 20, 100, 60), strict=False)
    ]
    return explanation(one.phrase, 40, one.known, tuple(rest)).in_time()


def test_what_an_agent_is_not_sure_of_is_not_said():
    assert explanation("up", 40).said == "up"
    unsure = explanation("up", 40, known=False)
    assert (unsure.phrase, unsure.said, unsure.in_time()) == ("up", DOES_NOT_KNOW, DOES_NOT_KNOW)


@pytest.mark.parametrize(
    ("phrases", "said"),
    [
        (["up"], "up"),
        (["up", "up"], "up"),
        (["up", "down"], "now down, later up"),
        (["up", "up", "up"], "up"),
        (["up", "down", "up"], "now down, later up"),
        (["up", "up", "down"], "now up, later down"),
        (["up", "down", "still"], "within 20 steps down, within 40 steps up, within 100 steps still"),
        (["up", "down", "down"], "within 20 steps down, within 40 steps up, within 100 steps down"),
        (["up", "up", "down", "down"], "now up, later down"),  # 60 and 100 alike
        (["up", "up", "down", "up"], "now up, later down"),
        (["up", "up", "up", "down"], "within 20 steps up, within 60 steps down, within 100 steps up"),
        (["up", "?down"], f"now {DOES_NOT_KNOW}, later up"),
        (["?up", "?down"], DOES_NOT_KNOW),
    ],
)
def test_spans_of_time_are_said_in_order_and_what_is_repeated_once(phrases: list[str], said: str):
    assert in_time(*phrases) == said


def test_an_episode_as_steps_ends_once_with_its_outcome():
    states, columns = np.arange(8.0).reshape(4, 2), np.zeros((3, 1))
    episode = Episode(states, np.arange(3), np.ones(3), columns, np.ones(3, bool), True, False, "here")
    steps = episode.as_steps()
    assert {len(column) for column in steps.values()} == {1}
    np.testing.assert_array_equal(steps["next_state"][0], states[1:])
    np.testing.assert_array_equal(steps["done"], [[False, False, True]])
    np.testing.assert_array_equal(steps["terminated"], [[False, False, True]])
    assert not steps["success"].any()
