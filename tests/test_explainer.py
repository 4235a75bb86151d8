"""An explanation is the mapping's word for the change that the predictor sees."""

from collections.abc import Sequence

import numpy as np
import pytest

from ibe_rl.data import Array, Moment, Phrases, Policy
from ibe_rl.explainer import explain, hold, put_in_words

WORDS = [Phrases("still", "{degree}down", "{degree}up", ((0.1, "a little "), (0.5, "")))]


def stay(observations: Array) -> Array:
    return np.zeros(len(observations), int)


class Straight:
    """Goes on by the second number of the state in every step."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, Policy, int]] = []

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Array:
        self.calls.append((len(moments), policy, horizon_steps))
        start = np.array([moment.state for moment in moments])
        steps = np.arange(horizon_steps + 1)[None, :, None] * start[:, None, 1:]
        return start[:, None] + np.concatenate([steps, 0 * steps], axis=2)


class Tenths:
    """Expresses a tenth of the change of the first number."""

    ids = np.array([5, 7, 6])

    def cluster(self, delta: Array) -> Array:
        return np.arange(len(delta))

    def express(self, delta: Array) -> Array:
        return delta[:, :1] / 10

    def confidence(self, delta: Array) -> Array:
        return np.abs(delta[:, 0]) / 10


def moments(*speeds: float) -> list[Moment]:
    return [Moment(np.array([100.0, speed]), np.zeros(1), True) for speed in speeds]


def test_the_change_over_the_horizon_is_put_into_words():
    predictor = Straight()
    said = explain(moments(2, -0.25, 0), stay, predictor, Tenths(), 4, WORDS)
    assert predictor.calls == [(3, stay, 4)]  # all together
    assert [one.phrase for one in said] == ["up", "a little down", "still"]
    assert [one.expression.tolist() for one in said] == [[0.8], [-0.1], [0.0]]
    assert [one.delta_state.tolist() for one in said] == [[8, 0], [-1, 0], [0, 0]]
    assert [one.cluster for one in said] == [5, 7, 6]
    assert [one.confidence for one in said] == [0.8, 0.1, 0.0]
    assert [one.horizon_steps for one in said] == [4, 4, 4]
    assert said[0].path[:, 0].tolist() == [100, 102, 104, 106, 108]


def test_without_moments_nothing_is_said():
    predictor = Straight()
    assert explain([], stay, predictor, Tenths(), 4, WORDS) == []
    assert predictor.calls == []


@pytest.mark.parametrize(
    ("every_steps", "heard"),
    [(1, [1, 2, 3, 4, 5, 6]), (2, [1, 1, 3, 3, 5, 5]), (4, [1, 1, 1, 1, 5, 5]), (5, [1, 1, 1, 1, 1, 6]), (9, [1] * 6)],
)
def test_in_between_the_last_explanation_holds(every_steps: int, heard: list[int]):
    mapping = Tenths()
    mapping.ids = np.arange(6)
    new = explain(moments(1, 2, 3, 4, 5, 6)[::every_steps], stay, Straight(), mapping, 1, WORDS)
    assert [one.delta_state[0] for one in hold(new, every_steps, 6)] == heard


def test_predictions_can_be_put_into_the_words_of_another_vocabulary():
    class Backwards(Tenths):
        ids = np.array([30, 10])

        def express(self, delta: Array) -> Array:
            return -super().express(delta)

    paths = Straight().rollout(moments(2, -0.25), stay, 4)
    now, then = (put_in_words(paths, mapping, 4, WORDS) for mapping in (Tenths(), Backwards()))
    assert [(one.phrase, one.cluster) for one in now] == [("up", 5), ("a little down", 7)]
    assert [(one.phrase, one.cluster) for one in then] == [("down", 30), ("a little up", 10)]
    for one, other, path in zip(now, then, paths, strict=True):
        np.testing.assert_array_equal(one.path, path)
        np.testing.assert_array_equal(one.path, other.path)
        assert one.delta_state.tolist() == other.delta_state.tolist() == (path[-1] - path[0]).tolist()
        assert one.horizon_steps == other.horizon_steps == 4
    assert explain(moments(2, -0.25), stay, Straight(), Tenths(), 4, WORDS)[1].phrase == now[1].phrase
