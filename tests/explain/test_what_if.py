"""What it would do if it were told something else: a lift that obeys, one that does not, one that does at times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from by_hand import TASK, on_a_line
from by_hand import WORDS as OF_THE_LIFT

from ibe_rl.explain.explainer import explain
from ibe_rl.explain.phrasing import Asking, ExplainerState
from ibe_rl.explain.what_if import MOST_VALUES, in_a_sentence, listening, told_twins, values_of, whatever
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.task import Phrases
from ibe_rl.types import Array, Moment, Policy, Prediction, columns_of, observe

DOWN, STAY, UP = "going down", "staying", "going up"
VALUES = values_of(TASK)
LIFT = ExplainerState(on_a_line([-4, 0, 4]), 4, [OF_THE_LIFT], what_if=Asking(VALUES))


def obeys(observations: Array) -> Array:
    return observations[:, -2]


def ignores(observations: Array) -> Array:
    return np.ones(len(observations))


def above_ground(observations: Array) -> Array:
    """It obeys where it is above 0, and stays below."""
    return np.where(observations[:, 0] > 0, observations[:, -2], 0.0)


class Shaft:
    """Moves by the action in every step; a moment and its twins are shaken alike."""

    def __init__(self) -> None:
        self.calls: list[int] = []

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        self.calls.append(len(moments))
        states, instruction, given = columns_of(moments)
        path = [states]
        for _ in range(horizon_steps):
            path.append(path[-1] + policy(observe(path[-1], instruction, given))[:, None])
        return Prediction.exact(np.stack(path, axis=1))


def moments(*heights: float, instruction: float = 1.0) -> list[Moment]:
    return [Moment(np.array([height]), np.array([instruction]), True) for height in heights]


def answers(policy: Policy, *heights: float) -> list[dict[str, str]]:
    said = explain(moments(*heights), policy, Shaft(), LIFT)
    return [{name: one.phrase for name, one in each.what_if.items()} for each in said]


def test_one_that_obeys_does_each_time_what_it_is_told():
    shaft = Shaft()
    said = explain(moments(10, -10), obeys, shaft, LIFT)
    assert shaft.calls == [2 * (1 + 3)]  # all in one
    assert answers(obeys, 10) == [{DOWN: DOWN, STAY: STAY, UP: UP}]
    assert [one.listens for one in said] == [1, 1]
    assert [one.phrase for one in said] == [UP, UP]
    assert said[0].what_if[DOWN].path[:, 0].tolist() == [10, 9, 8, 7, 6]
    assert said[0].what_if[DOWN].horizon_steps == 4
    assert whatever(said[0]) is None
    assert in_a_sentence(said[0]) == "told going down: going down; told staying: staying; told going up: going up"


def test_one_that_does_not_listen_does_the_same_whatever_it_is_told():
    [said] = explain(moments(10, instruction=-1), ignores, Shaft(), LIFT)
    assert answers(ignores, 10) == [{DOWN: UP, STAY: UP, UP: UP}]
    assert said.listens == 0
    assert whatever(said) == UP
    assert in_a_sentence(said) == "whatever you say now: going up"


def test_one_that_obeys_at_times_listens_there_only():
    said = explain(moments(10, -10), above_ground, Shaft(), LIFT)
    assert [one.listens for one in said] == [1, 0]
    assert [whatever(one) for one in said] == [None, STAY]


def test_one_that_does_not_know_says_nothing_of_whatever_it_is_told():
    doubt = Calibration(("a", "b"), np.zeros(2), np.ones(2), np.zeros(2), np.array([-2.0]))
    unsure = replace(LIFT, min_confidence=0.5, what_if=Asking(VALUES, calibration=doubt))
    [said] = explain(moments(10), ignores, Shaft(), unsure)
    assert said.known
    assert {one.said for one in said.what_if.values()} == {"I do not know"}
    assert all(one.calibrated for one in said.what_if.values())
    assert whatever(said) is None


def test_it_is_asked_only_where_there_are_values():
    shaft = Shaft()
    [said] = explain(moments(10), obeys, shaft, replace(LIFT, what_if=None))
    assert (shaft.calls, said.what_if, said.listens, in_a_sentence(said)) == ([1], {}, None, "")
    [one] = explain(moments(10), obeys, shaft, replace(LIFT, what_if=Asking({UP: VALUES[UP]})))
    assert np.isnan(one.listens)
    assert whatever(one) is None


def test_the_explanation_is_the_same_as_without_and_the_futures_are_as_many():
    state = replace(LIFT, futures=3, spans={2: on_a_line([-2, 0, 2])})
    [asked] = explain(moments(10), obeys, Shaft(), state)
    [plain] = explain(moments(10), obeys, Shaft(), replace(state, what_if=None))
    assert (asked.phrase, asked.confidence, len(asked.spans)) == (plain.phrase, plain.confidence, len(plain.spans))
    np.testing.assert_array_equal(asked.path, plain.path)
    assert [len(one.futures) for one in asked.what_if.values()] == [3, 3, 3]
    assert [one.spans for one in asked.what_if.values()] == [()] * 3


def test_twins_are_told_to_the_end_and_name_whom_they_repeat():
    twins = told_twins(moments(10, 20), {"up": np.ones(1), "down": -np.ones(1)})
    assert [(one.twin, one.instruction[0], one.state[0]) for one in twins] == [
        (0, 1, 10),
        (1, 1, 20),
        (0, -1, 10),
        (1, -1, 20),
    ]


@pytest.mark.parametrize(
    ("answered", "told_values", "expected"),
    [
        ([[0.5], [0.5]], [[-1], [1]], 0),
        ([[-1], [1]], [[-1], [1]], 1),
        ([[1], [-1]], [[-1], [1]], 1),  # the opposite is listening too
        ([[-0.5], [0.5]], [[-1], [1]], 0.5),
        ([[-1, 0], [1, 0]], [[-1, -1], [1, 1]], 0.5),  # of two numbers one
        ([[-1, 0.3], [1, 0.1]], [[-1, 0], [1, 0]], 1),  # the second is not asked
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.eye(3), 1),  # three words
        ([[-1], [1]], [[-0.1], [0.1]], 1),  # not more than all
    ],
)
def test_listening_is_the_spread_of_the_answers(
    answered: list[list[float]], told_values: list[list[float]], expected: float
):
    assert listening(np.array(answered, float), np.array(told_values, float)) == pytest.approx(expected)


def test_values_are_called_by_the_phrases_and_told_apart():
    assert {name: value.tolist() for name, value in VALUES.items()} == {DOWN: [-1], STAY: [0], UP: [1]}
    coarse = replace(TASK, instruction_values=(-1.0, 0.0, 0.1, 1.0))
    assert [*values_of(coarse)] == [DOWN, "staying (0)", "staying (0.1)", UP]


@pytest.mark.parametrize(("numbers", "count"), [(1, 3), (2, 9), (3, 7), (5, 11)])
def test_of_several_numbers_each_combination_is_asked_where_they_are_few(numbers: int, count: int):
    same = (Phrases("0", "{degree}-", "{degree}+", ((0.5, ""),)),) * numbers
    task = replace(TASK, phrases=same, explained=(0,) * numbers, explained_band=(0.1,) * numbers, explained_range=())
    found = values_of(task)
    assert len(found) == count
    assert len({tuple(value) for value in found.values()}) == count
    assert count <= MOST_VALUES


def test_only_some_moments_and_fewer_futures_may_be_asked():
    shaft, state = Shaft(), replace(LIFT, futures=3, what_if=Asking(VALUES, every=2, futures=2))
    said = explain(moments(10, 20, -30, 40, -50), above_ground, shaft, state)
    assert shaft.calls == [5 * 3 + 3 * 3 * 2]
    assert [len(one.what_if) for one in said] == [3, 0, 3, 0, 3]
    assert [one.listens for one in said] == [1, None, 0, None, 0]
    assert [one.what_if[UP].path[0, 0] for one in said[::2]] == [10, -30, -50]
    assert {len(one.futures) for one in said} == {3}
    assert {len(one.futures) for each in said for one in each.what_if.values()} == {2}
