"""An explanation is the mapping's word for the change that most of the predicted futures see."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from by_hand import WORDS as OF_THE_LIFT
from by_hand import on_a_line

from ibe_rl.explain.explainer import explain
from ibe_rl.explain.phrasing import (
    AHEAD_STEPS,
    CONFIDENCE_FEATURES,
    ExplainerState,
    confidence_features,
    hold,
    majority_phrases,
    put_in_words,
)
from ibe_rl.explain.steady import DOUBT_STEPS, LEAD, MEMORY_STEPS, say_steadily
from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.space import along
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.task import Phrases
from ibe_rl.types import DOES_NOT_KNOW, Array, Explanation, Moment, Policy, Prediction

WORDS = [Phrases("still", "{degree}down", "{degree}up", ((0.1, "a little "), (0.5, "")))]


def stay(observations: Array) -> Array:
    return np.zeros(len(observations), int)


class Straight:
    """Goes on by the second number of the state in every step."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, Policy, int]] = []

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        self.calls.append((len(moments), policy, horizon_steps))
        start = np.array([moment.state for moment in moments])
        steps = np.arange(horizon_steps + 1)[None, :, None] * start[:, None, 1:]
        return Prediction.exact(start[:, None] + np.concatenate([steps, 0 * steps], axis=2))


class Tenths:
    """Expresses a tenth of the change of the first number."""

    ids = np.array([5, 7, 6])

    def cluster(self, delta: Array) -> Array:
        return np.arange(len(delta))

    def express(self, delta: Array) -> Array:
        return delta[:, :1] / 10

    def knows(self, delta: Array) -> Array:
        return np.ones(len(delta), bool)

    def confidence(self, delta: Array) -> Array:
        return np.abs(delta[:, 0]) / 10


LATEST = max(AHEAD_STEPS)
TENTHS = ExplainerState(Tenths(), 4, WORDS)


def moments(*speeds: float) -> list[Moment]:
    return [Moment(np.array([100.0, speed]), np.zeros(1), True) for speed in speeds]


def test_the_change_over_the_horizon_is_put_into_words():
    predictor = Straight()
    said = explain(moments(2, -0.25, 0), stay, predictor, TENTHS)
    assert predictor.calls == [(3, stay, 4 + LATEST)]  # all together
    assert [one.phrase for one in said] == ["up", "a little down", "still"]
    assert [one.expression.tolist() for one in said] == [[0.8], [-0.1], [0.0]]
    assert [one.delta_state.tolist() for one in said] == [[8, 0], [-1, 0], [0, 0]]
    assert [one.cluster for one in said] == [5, 7, 6]
    assert [one.confidence for one in said] == [0.8, 0.1, 0.0]
    assert [one.horizon_steps for one in said] == [4, 4, 4]
    assert said[0].path[:, 0].tolist() == [100, 102, 104, 106, 108]
    assert [(one.spans, one.said, one.in_time()) for one in said] == [((), one.phrase, one.phrase) for one in said]


def test_without_moments_nothing_is_said():
    predictor = Straight()
    assert explain([], stay, predictor, TENTHS) == []
    assert predictor.calls == []


@pytest.mark.parametrize(
    ("every_steps", "heard"),
    [(1, [1, 2, 3, 4, 5, 6]), (2, [1, 1, 3, 3, 5, 5]), (4, [1, 1, 1, 1, 5, 5]), (5, [1, 1, 1, 1, 1, 6]), (9, [1] * 6)],
)
def test_in_between_the_last_explanation_holds(every_steps: int, heard: list[int]):
    mapping = Tenths()
    mapping.ids = np.arange(6)
    new = explain(moments(1, 2, 3, 4, 5, 6)[::every_steps], stay, Straight(), ExplainerState(mapping, 1, WORDS))
    assert [one.delta_state[0] for one in hold(new, every_steps, 6)] == heard


def test_predictions_can_be_put_into_the_words_of_another_vocabulary():
    class Backwards(Tenths):
        ids = np.array([30, 10])

        def express(self, delta: Array) -> Array:
            return -super().express(delta)

    paths = Straight().rollout(moments(2, -0.25), stay, 4).paths
    now, then = (put_in_words(paths[:, None], ExplainerState(mapping, 4, WORDS)) for mapping in (Tenths(), Backwards()))
    assert [(one.phrase, one.cluster) for one in now] == [("up", 5), ("a little down", 7)]
    assert [(one.phrase, one.cluster) for one in then] == [("down", 30), ("a little up", 10)]
    for one, other, path in zip(now, then, paths, strict=True):
        np.testing.assert_array_equal(one.path, path)
        np.testing.assert_array_equal(one.path, other.path)
        assert one.delta_state.tolist() == other.delta_state.tolist() == (path[-1] - path[0]).tolist()
        assert one.horizon_steps == other.horizon_steps == 4
    assert explain(moments(2, -0.25), stay, Straight(), TENTHS)[1].phrase == now[1].phrase


LINE = replace(on_a_line([-4, 0, 4], ids=[3, 5, 7]), purities=np.array([0.5, 0.75, 1]))
LIFT = ExplainerState(LINE, 4, [OF_THE_LIFT])
DOWN, STAY, UP = "going down", "staying", "going up"


def ahead(*futures: Sequence[float], steps: int = 4) -> Array:
    """Of each moment several futures: straight from 100 m to so many metres above."""
    return 100 + np.multiply.outer(np.array(futures, float), np.linspace(0, 1, steps + 1))[..., None]


def test_what_most_futures_are_called_is_said():
    said = put_in_words(ahead([4, -4, 5], [0, -3, -4], [4, 4, 4]), LIFT)
    assert [one.phrase for one in said] == [UP, DOWN, UP]
    assert [one.delta_state.tolist() for one in said] == [[4], [-3], [4]]  # the first of the futures called so
    assert [one.path[:, 0].tolist() for one in said] == [
        [100, 101, 102, 103, 104],
        [100, 99.25, 98.5, 97.75, 97],
        [100, 101, 102, 103, 104],
    ]
    assert [one.expression.tolist() for one in said] == [[1], [-1], [1]]
    np.testing.assert_allclose(movements_said(said)[:, 0], [1 / 3, -2 / 3, 1])  # the mean over the futures
    assert [one.cluster for one in said] == [7, 3, 7]
    assert [one.agreement for one in said] == pytest.approx([2 / 3, 2 / 3, 1])
    assert [one.purity for one in said] == [1, 0.5, 1]
    assert [one.confidence for one in said] == pytest.approx([2 / 3, 1 / 3, 1])  # not calibrated: the product
    assert [one.futures[:, 0].tolist() for one in said] == [[4, -4, 5], [0, -3, -4], [4, 4, 4]]
    np.testing.assert_allclose(confidence_features(said), [[2 / 3, 1], [2 / 3, 0.5], [1, 1]])


@pytest.mark.parametrize(
    ("futures", "phrase", "chosen", "agreement"),
    [
        ([-4, 0, 4], DOWN, 0, 1 / 3),
        ([0, 4, 4, 0], STAY, 0, 1 / 2),
        ([4, 0, 0, 4], UP, 0, 1 / 2),
        ([4, 0, -4, 0, -4], STAY, 1, 2 / 5),
        ([0], STAY, 0, 1),
    ],
)
def test_of_equally_frequent_phrases_the_first_one_is_said(
    futures: list[float], phrase: str, chosen: int, agreement: float
):
    phrases, which, shares = majority_phrases(np.array(futures, float)[None, :, None], LINE, [OF_THE_LIFT])
    assert (phrases, which.tolist(), shares.tolist()) == ([phrase], [chosen], [agreement])


def test_clusters_of_one_name_vote_together():
    mapping = on_a_line([-4, 0, 2, 4], expressions=[-1, 0, 0.8, 1])
    phrases, which, shares = majority_phrases(np.array([[[-4.0], [-4], [4], [2], [2]]]), mapping, [OF_THE_LIFT])
    assert (phrases, which.tolist(), shares.tolist()) == ([UP], [2], [3 / 5])


class Gusts(Straight):
    """The copies of a moment are carried off by 0, 3 and -8 metres a step, one after the other."""

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        paths = super().rollout(moments, policy, horizon_steps).paths.copy()
        gusts = np.resize([0, 3, -8], len(moments))
        paths[..., 0] += np.multiply.outer(gusts, np.arange(horizon_steps + 1))
        return Prediction.exact(paths)


def test_as_many_futures_are_sampled_of_each_moment_as_asked_for():
    predictor, mapping = Gusts(), replace(on_a_line([-4, 0, 4]), space=along(np.eye(2)[:, :1]))
    state = ExplainerState(mapping, 4, [OF_THE_LIFT], futures=3)
    said = explain(moments(1, -3), stay, predictor, state)
    assert predictor.calls == [(6, stay, 4 + LATEST)]
    assert [one.futures[:, 0].tolist() for one in said] == [[4, 16, -28], [-12, 0, -44]]
    assert [(one.phrase, one.agreement) for one in said] == [(UP, 2 / 3), (DOWN, 2 / 3)]
    alone = explain(moments(1, -3), stay, Straight(), replace(state, futures=1))
    assert [(one.phrase, one.agreement, one.futures.shape) for one in alone] == [(UP, 1, (1, 2)), (DOWN, 1, (1, 2))]


SPANS = {8: replace(LINE, ids=np.array([10, 11, 12])), 2: LINE}


def test_all_spans_of_time_come_from_one_roll_out():
    predictor = Straight()
    [one] = explain(moments(2), stay, predictor, replace(TENTHS, spans={8: Tenths(), 2: Tenths()}))
    assert predictor.calls == [(1, stay, 8 + LATEST)]
    assert one.path[:, 0].tolist() == [100, 102, 104, 106, 108]
    assert [(each.horizon_steps, each.delta_state[0], len(each.path)) for each in one.spans] == [(2, 4, 3), (8, 16, 9)]
    assert [each.path[-1, 0] for each in one.spans] == [104, 116]
    [short] = explain(moments(2), stay, predictor, replace(TENTHS, spans={2: Tenths()}))
    assert predictor.calls[1:] == [(1, stay, 4 + LATEST)]  # no further than anything is said of
    assert [each.horizon_steps for each in short.spans] == [2]


def test_each_span_votes_for_itself():
    """After two steps two of three have gone down, after four they are back, after eight two are up."""
    paths = np.array(
        [[[0, -2, -4, -2, 0, 1, 2, 3, 4], [0, -2, -4, -2, 0, -1, -2, -3, -4], [0, 1, 2, 3, 4, 4, 4, 4, 4]]]
    )
    [one] = put_in_words(paths[..., None].astype(float), replace(LIFT, spans=SPANS))
    assert (one.horizon_steps, one.phrase, one.agreement) == (4, STAY, 2 / 3)
    now, later = one.spans
    assert (now.horizon_steps, now.phrase, now.agreement, now.cluster) == (2, DOWN, 2 / 3, 3)
    assert (later.horizon_steps, later.phrase, later.agreement, later.cluster) == (8, UP, 2 / 3, 12)
    assert later.path[:, 0].tolist() == paths[0, 0].tolist()
    assert one.in_time() == f"within 2 steps {DOWN}, within 4 steps {STAY}, within 8 steps {UP}"


BY_PURITY = Calibration(
    CONFIDENCE_FEATURES, np.array([0, 0.5]), np.array([1, 0.5]), np.array([0, np.log(9)]), np.zeros(1)
)
"""One half at a purity of 1/2, three quarters at 3/4, nine tenths at 1; whatever the futures agree on."""


@pytest.mark.parametrize(
    ("minimum", "known"),
    [(0.0, [True, True, True]), (0.5, [True, True, True]), (0.6, [False, True, True]), (0.95, [False, False, False])],
)
def test_calibrated_confidence_is_a_probability_and_below_the_least_the_agent_does_not_know(
    minimum: float, known: list[bool]
):
    state = replace(LIFT, calibration=BY_PURITY, min_confidence=minimum)
    said = put_in_words(ahead([-4, 4, -4], [0, 0, 0], [4, 4, -4]), state)
    assert [one.confidence for one in said] == pytest.approx([0.5, 0.75, 0.9])
    assert [one.known for one in said] == known
    assert [one.phrase for one in said] == [DOWN, STAY, UP]  # what it would have said is still there
    assert [one.said for one in said] == [
        phrase if sure else DOES_NOT_KNOW for phrase, sure in zip([DOWN, STAY, UP], known, strict=True)
    ]
    assert [one.agreement for one in said] == pytest.approx([2 / 3, 1, 2 / 3])


def test_it_is_silent_below_the_minimum_also_before_it_is_calibrated():
    said = put_in_words(ahead([-4, 0, 4]), replace(LIFT, min_confidence=0.99))
    assert [(one.confidence, one.known, one.calibrated) for one in said] == [(pytest.approx(0.5 / 3), False, False)]
    assert said[0].said == DOES_NOT_KNOW


def test_other_spans_are_spoken_of_whatever_the_calibration_says():
    """It is learnt from what came true of the horizon."""
    state = replace(LIFT, spans=SPANS, calibration=BY_PURITY, min_confidence=0.95)
    [one] = put_in_words(ahead([7, 7], steps=8), state)
    assert (one.known, one.confidence) == (False, pytest.approx(0.9))
    assert [(each.known, each.confidence, each.said) for each in one.spans] == [(True, 0.75, STAY), (True, 1, UP)]
    assert one.in_time() == f"within 2 steps {STAY}, within 4 steps {DOES_NOT_KNOW}, within 8 steps {UP}"


def test_what_the_predictor_does_not_stand_by_is_marked_and_lowers_the_confidence():
    class Parting(Straight):
        def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
            whole = super().rollout(moments, policy, horizon_steps)
            return replace(whole, trusted_steps=np.resize([3, 4], len(moments)))

    state = replace(TENTHS, futures=2, spans={2: Tenths()})
    [one] = explain(moments(2), stay, Parting(), state)
    assert (one.trusted_steps, one.trusted, one.agreement) == (3, False, 0.5)
    assert one.confidence == one.agreement * one.purity
    assert (one.spans[0].trusted_steps, one.spans[0].trusted, one.spans[0].agreement) == (2, True, 1)
    assert one.trusted_path[:, 0].tolist() == [100, 102, 104, 106, 106]
    [sure] = explain(moments(2), stay, Straight(), state)
    assert (sure.trusted_steps, sure.trusted, sure.agreement) == (4, True, 1)
    np.testing.assert_array_equal(sure.trusted_path, sure.path)


def spoken(*futures: Sequence[float], every_steps: int = 1, state: ExplainerState = LIFT) -> list[Explanation]:
    """What is said of moments with these futures, one after the other."""
    return say_steadily(put_in_words(ahead(*futures), state), state, every_steps)


def test_windows_that_begin_later_vote_too():
    path = np.array([0, 0, 0, 0, 0, 4, 4, 12, 16], float)
    [one] = put_in_words(path[None, None, :, None], LIFT)
    assert AHEAD_STEPS == (0, 2, 4)
    assert one.later_futures[:, 0].tolist() == [4, 16]
    assert one.phrase == STAY  # of the window that begins now
    [aloud] = say_steadily([one], LIFT)
    assert (aloud.phrase, aloud.of_the_moment, aloud.agreement) == (UP, STAY, pytest.approx(2 / 3))


def test_a_change_that_is_undone_at_once_is_not_said():
    said = spoken([4, 4, 4], [4, 4, 4], [-4, -4, 4], [4, 4, 4])
    assert [one.phrase for one in said] == [UP] * 4
    assert [one.of_the_moment for one in said] == [None, None, DOWN, None]
    assert said[2].agreement == pytest.approx((1 + 1 + 1 / 3) / 3)
    assert (said[2].delta_state.tolist(), said[2].expression.tolist(), said[2].cluster) == ([4], [1], 7)  # its own
    assert movements_said(said)[2, 0] == pytest.approx(-1 / 3)  # of all its futures
    assert said[2].futures[:, 0].tolist() == [-4, -4, 4]


def test_a_change_that_lasts_is_said_once_it_leads():
    said = spoken(*[[4, 4, 4]] * 5, *[[-4, -4, -4]] * 5)
    assert [one.phrase for one in said] == [UP] * 6 + [DOWN] * 4
    late = said[5]  # no future of this moment is called so any more
    assert (late.delta_state.tolist(), late.agreement, late.of_the_moment) == ([4], pytest.approx(2 / 3), DOWN)


def test_a_lead_that_is_too_small_changes_nothing():
    assert 1 / 7 < LEAD < 3 / 7
    assert [one.phrase for one in spoken([0] * 7, [0, 0, 4, 4, 4, 4, 4], every_steps=5)] == [STAY, UP]
    assert [one.phrase for one in spoken([0] * 7, [0, 0, 0, 4, 4, 4, 4], every_steps=5)] == [STAY, STAY]


def test_a_new_phrase_is_one_of_this_moment():
    """Up has most votes in the end, of moments before this one, but was never said."""
    mostly_up = [4] * 5 + [0] * 4
    said = spoken([0] * 9, *[mostly_up] * 4, [-4] * 9)
    assert [one.phrase for one in said] == [STAY] * 6
    assert said[-1].of_the_moment == DOWN


def test_what_is_longer_ago_is_forgotten():
    said = spoken([4, 4, 4], [-4, -4, -4], every_steps=MEMORY_STEPS + 1)
    assert [(one.phrase, one.agreement) for one in said] == [(UP, 1), (DOWN, 1)]


def test_the_confidence_is_that_in_what_is_spoken():
    state = replace(LIFT, min_confidence=0.75)
    said = spoken([4, 4, 4], [-4, -4, 4], state=state)
    assert said[1].phrase == UP
    assert said[1].confidence == pytest.approx(2 / 3)  # a purity of 1
    assert [one.known for one in said] == [True, True]  # .83 on the average of both
    assert [one.known for one in spoken([4, 4, 4], [-4, -4, 4], [-4, -4, 4], state=state)] == [True, True, False]


def test_doubt_is_remembered_longer_than_votes():
    """The confidence is 1, 2/3, 5/9 and then 1/3, and is averaged over five steps; it is sure from .6 on."""
    state = replace(LIFT, min_confidence=0.6)
    said = spoken([4, 4, 4], *[[4, -4, 0]] * 5, state=state)
    assert DOUBT_STEPS > MEMORY_STEPS
    assert [one.known for one in said] == [True, True, True, True, False, False]


def test_each_span_holds_for_itself():
    state = ExplainerState(LINE, 4, [OF_THE_LIFT], {2: LINE})
    said = say_steadily(put_in_words(ahead([8], [-8], [8]), state), state)
    assert [one.phrase for one in said] == [UP, UP, UP]
    assert [one.spans[0].phrase for one in said] == [UP, UP, UP]
    assert [one.spans[0].of_the_moment for one in said] == [None, DOWN, None]
