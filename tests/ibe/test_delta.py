"""Windows and best episodes, on episodes whose numbers can be checked in the head."""

import numpy as np
import pytest

from ibe_rl.ibe import Windows, cut_windows, delta_states, top_episodes
from ibe_rl.types import Array, Episode

SQUARES = np.array([[0, 0], [1, 10], [4, 20], [9, 30], [16, 40]], float)  # four steps


def episode(states: Array, instruction: list[float], given: list[bool] | None = None) -> Episode:
    steps = len(instruction)
    heard = np.ones(steps, bool) if given is None else np.array(given)
    return Episode(states, np.zeros(steps), np.zeros(steps), np.array(instruction)[:, None], heard, True, True, "here")


@pytest.mark.parametrize(
    ("horizon", "drop", "clamp"),
    [
        (1, [1, 3, 5, 7], [1, 3, 5, 7]),
        (2, [4, 8, 12], [4, 8, 12, 7]),
        (3, [9, 15], [9, 15, 12, 7]),
        (4, [16], [16, 15, 12, 7]),
        (5, [], [16, 15, 12, 7]),
        (9, [], [16, 15, 12, 7]),
    ],
)
def test_change_over_n_steps(horizon: int, drop: list[float], clamp: list[float]):
    assert delta_states(SQUARES, horizon)[:, 0].tolist() == drop
    assert delta_states(SQUARES, horizon, end="drop").shape == (len(drop), 2)
    assert delta_states(SQUARES, horizon, end="clamp")[:, 0].tolist() == clamp


def test_change_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match="horizon_steps=0: at least 1"):
        delta_states(SQUARES, 0)
    with pytest.raises(ValueError, match="end='wrap': choose one of drop, clamp"):
        delta_states(SQUARES, 1, end="wrap")


@pytest.fixture
def two() -> list[Episode]:
    return [
        episode(SQUARES, [-1, 0, 1, -1], [True, False, True, True]),
        episode(np.array([[0, 5], [2, 5], [3, 5]], float), [1, 0]),
    ]


def test_windows_carry_the_instruction_at_their_beginning(two: list[Episode]):
    windows = cut_windows(two, 2)
    assert windows.delta.tolist() == [[4, 20], [8, 20], [12, 20], [3, 0]]
    assert windows.instruction[:, 0].tolist() == [-1, 0, 1, 1]
    assert windows.given.tolist() == [True, False, True, True]
    assert windows.episode.tolist() == [0, 0, 0, 1]
    assert windows.step.tolist() == [0, 1, 2, 0]
    assert windows.horizon_steps == 2
    assert len(windows) == 4


def test_clamped_windows_begin_at_every_step(two: list[Episode]):
    windows = cut_windows(two, 3, end="clamp")
    assert windows.delta[:, 0].tolist() == [9, 15, 12, 7, 3, 1]
    assert windows.instruction[:, 0].tolist() == [-1, 0, 1, -1, 1, 0]
    assert windows.step.tolist() == [0, 1, 2, 3, 0, 1]


def test_episodes_shorter_than_the_horizon_have_no_window(two: list[Episode]):
    windows = cut_windows(two, 3)
    assert windows.episode.tolist() == [0, 0]
    assert cut_windows(two, 10).delta.shape == (0, 2)


def test_windows_can_be_picked(two: list[Episode]):
    windows = cut_windows(two, 2)
    picked = windows[windows.given]
    assert picked.delta[:, 0].tolist() == [4, 12, 3]
    assert picked.step.tolist() == [0, 2, 0]
    assert picked.horizon_steps == 2
    assert len(windows[:0]) == 0


def test_windows_cannot_be_changed(two: list[Episode]):
    with pytest.raises(ValueError, match="read-only"):
        cut_windows(two, 2).delta[0] = 0


def test_windows_need_an_episode():
    with pytest.raises(ValueError, match="at least one episode"):
        cut_windows([], 2)


def test_windows_refuse_unequal_lengths():
    with pytest.raises(ValueError, match=r"Windows\.step has shape \(3,\), expected \(2,\)"):
        Windows(np.zeros((2, 1)), np.zeros((2, 1)), np.ones(2, bool), np.zeros(2), np.zeros(3), 5)


def test_best_of_all():
    rewards = np.array([5.0, -200, 3, 7, 1, 0, 2, 4])
    assert np.flatnonzero(top_episodes(rewards, 0.25)).tolist() == [0, 3]
    assert np.flatnonzero(top_episodes(rewards, 0.26)).tolist() == [0, 3, 7]  # rounded up
    assert top_episodes(rewards, 1.0).all()
    assert np.flatnonzero(top_episodes(rewards, 1e-9)).tolist() == [3]  # never none
    assert top_episodes(rewards[:0], 0.25).tolist() == []


def test_best_within_each_context():
    rewards = np.array([100.0, 101, 102, 103, 1, 2, 3, 4])
    contexts = np.array(["far"] * 4 + ["near"] * 4)
    assert np.flatnonzero(top_episodes(rewards, 0.5)).tolist() == [0, 1, 2, 3]
    assert np.flatnonzero(top_episodes(rewards, 0.5, contexts)).tolist() == [2, 3, 6, 7]
    assert np.flatnonzero(top_episodes(rewards, 0.1, contexts)).tolist() == [3, 7]


def test_of_equals_the_earlier_is_best():
    assert np.flatnonzero(top_episodes(np.zeros(6), 0.5)).tolist() == [0, 1, 2]


@pytest.mark.parametrize(("fraction", "count"), [(0.07, 7), (0.14, 14), (0.55, 55), (0.25, 25), (0.071, 8)])
def test_the_share_of_a_hundred_is_its_percentage(fraction: float, count: int):
    best = top_episodes(np.arange(100.0), fraction)
    assert np.count_nonzero(best) == count


@pytest.mark.parametrize("fraction", [0.0, -0.1, 1.01, float("nan")])
def test_another_share_is_refused(fraction: float):
    with pytest.raises(ValueError, match=r"top_fraction=.*: above 0 and at most 1"):
        top_episodes(np.zeros(3), fraction)
