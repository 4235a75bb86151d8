"""An agent is asked what it does if it is told otherwise, on a line where it can be seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from ibe_rl.ibe import Reactions
from ibe_rl.types import Array, Moment, Policy, Prediction, observe
from ibe_rl.vocabulary.reactions import ActsUnder, ask


class OnAPlane:
    """A predictor: each action is a step, down or up the first number; what it hands on as told is always 9, not given.

    Attributes:
        asked: the moments of each rollout.
    """

    def __init__(self) -> None:
        self.asked: list[Sequence[Moment]] = []

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        self.asked.append(moments)
        paths = [np.array([moment.state for moment in moments], float)]
        size = len(moments[0].instruction)
        for _ in range(horizon_steps):
            here = paths[-1]
            action = policy(observe(here, np.full((len(here), size), 9.0), np.zeros((len(here), 1))))
            paths.append(here + np.column_stack([action, 0 * action]))
        return Prediction.exact(np.stack(paths, axis=1))


def moments(*places: float, size: int = 1) -> list[Moment]:
    return [Moment(np.array([place, 5.0], np.float32), np.full(size, 0.5), False, place) for place in places]


def obedient(observations: Array) -> Array:
    """Goes as told by the first number, if it is told; twice as far from 10 on."""
    instruction, given = observations[:, 2], observations[:, -1]
    return instruction * given * np.where(observations[:, 0] >= 10, 2, 1)


def test_the_instruction_is_the_same_all_the_time() -> None:
    found = ask(moments(0, 20), obedient, OnAPlane(), 3)
    assert found is not None
    assert found.up.tolist() == [[[3, 0]], [[6, 0]]]
    assert found.down.tolist() == [[[-3, 0]], [[-6, 0]]]


def test_each_component_is_instructed_alone() -> None:
    found = ask(moments(0, 1, size=2), obedient, OnAPlane(), 2)
    assert found is not None
    assert found.up.tolist() == [[[2, 0], [0, 0]]] * 2
    assert found.down.tolist() == [[[-2, 0], [0, 0]]] * 2


def test_the_predictor_gets_the_instruction_too_and_gets_the_snapshots() -> None:
    predictor = OnAPlane()
    ask(moments(0, 1, size=2), obedient, predictor, 2)
    instructions = [[moment.instruction.tolist() for moment in asked] for asked in predictor.asked]
    assert instructions == [[[1, 0]] * 2, [[0, 1]] * 2, [[-1, 0]] * 2, [[0, -1]] * 2]
    assert all(moment.given for asked in predictor.asked for moment in asked)
    assert [moment.snapshot for moment in predictor.asked[0]] == [0, 1]


def test_who_acts_alike_under_every_instruction_needs_no_predictor() -> None:
    """The same at all of these moments, though not elsewhere."""

    def deaf(observations: Array) -> Array:
        return observations[:, 0] + (observations[:, 0] > 10) * observations[:, 2]

    predictor = OnAPlane()
    found = ask(moments(0, 1, 2), deaf, predictor, 3)
    assert isinstance(found, Reactions)
    assert found.up.shape == found.down.shape == (3, 1, 2)
    assert not found.up.any()
    assert not found.down.any()
    assert predictor.asked == []
    assert ask(moments(0, 1, 11), deaf, predictor, 3) is not None
    assert len(predictor.asked) == 2


def test_nobody_is_asked_without_a_moment() -> None:
    assert ask([], obedient, OnAPlane(), 3) is None


@pytest.mark.parametrize("instruction", [[1.0], [0.0, -1.0]])
def test_what_stands_is_read_instead_of_what_was_said(instruction: list[float]) -> None:
    seen = []

    def noting(observations: Array) -> Array:
        seen.append(observations)
        return observations[:, 0]

    states = np.array([[1.0, 2.0], [3.0, 4.0]])
    said = observe(states, np.full((2, len(instruction)), 9.0), np.zeros((2, 1)))
    assert ActsUnder(noting, np.array(instruction))(said).tolist() == [1, 3]
    [read] = seen
    assert read.tolist() == [[1, 2, *instruction, 1], [3, 4, *instruction, 1]]
    assert read.dtype == np.float32
