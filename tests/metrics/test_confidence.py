"""What a confidence is worth, counted by hand; and one that is learnt."""

import json
from typing import Any

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import brier_score_loss

from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.metrics.confidence import EDGE, Calibration, brier, ece, risk_at, risk_coverage
from ibe_rl.types import Array

NAN = float("nan")
SAID = np.array([1.0, 0.9, 0.6, 0.6, 0.2])
TRUE = np.array([True, False, True, False, False])
ONCE = np.ones((1, 5))
WEIGHTS = np.array([[1, 1, 1, 1, 1], [2, 0, 0, 1, 1], [0, 0, 0, 0, 0]], np.float32)


def test_brier_is_the_mean_squared_distance():
    found = brier(SAID, TRUE, WEIGHTS)
    assert found == pytest.approx([(0.81 + 0.16 + 0.36 + 0.04) / 5, (0.36 + 0.04) / 4, NAN], nan_ok=True)


def test_brier_knows_the_best_and_the_worst():
    assert brier(TRUE.astype(float), TRUE, ONCE) == 0
    assert brier(1.0 - TRUE, TRUE, ONCE) == 1
    assert brier(np.full(5, 0.5), TRUE, ONCE) == 0.25


def test_ece_is_the_weighted_gap_of_the_bins():
    """In one bin 1 and .9, one of two true; then .6 twice, one of two true; then .2, not true."""
    assert ece(SAID, TRUE, WEIGHTS[:1]) == pytest.approx((2 * 0.45 + 2 * 0.1 + 1 * 0.2) / 5)


def test_ece_follows_the_weights():
    found = ece(SAID, TRUE, WEIGHTS)
    assert found[1:] == pytest.approx([(2 * 0 + 1 * 0.6 + 1 * 0.2) / 4, NAN], nan_ok=True)


@pytest.mark.parametrize(
    ("bins", "error"),
    [(1, abs(3.3 - 2) / 5), (2, (abs(3.1 - 2) + 0.2) / 5), (5, (2 * 0.45 + 2 * 0.1 + 1 * 0.2) / 5)],
)
def test_ece_takes_any_number_of_bins(bins: int, error: float):
    """With two bins all but .2 are together."""
    assert ece(SAID, TRUE, ONCE, bins) == pytest.approx(error)


def test_a_bin_holds_its_lower_end():
    """.4 and .5 are apart by their own gaps, .5 and .6 cancel each other out, 1 is in the last bin."""
    outcome, rows = np.array([True, False]), np.ones((1, 2))
    assert ece(np.array([0.4, 0.5]), outcome, rows, bins=2) == pytest.approx((0.6 + 0.5) / 2)
    assert ece(np.array([0.5, 0.6]), outcome, rows, bins=2) == pytest.approx(abs(-0.5 + 0.6) / 2)
    assert ece(np.array([1.0, 0.9]), outcome, rows, bins=10) == pytest.approx(0.9 / 2)


def test_a_share_that_keeps_its_word_has_no_calibration_error():
    assert ece(np.full(5, 0.4), TRUE, ONCE) == pytest.approx(0)


@pytest.mark.parametrize("wrong", [-0.1, 1.1, NAN])
def test_a_confidence_is_a_probability(wrong: float):
    said = np.array([0.5, wrong, 0.5, 0.5, 0.5])
    for score in (brier, ece):
        with pytest.raises(ValueError, match=rf"confidence={wrong}: allowed is 0 to 1"):
            score(said, TRUE, ONCE)


@pytest.mark.parametrize(
    ("share", "risk"),
    [
        (0.2, 0),
        (0.4, 1 / 2),
        (0.6, 1.5 / 3),  # one of the two at .6, each counts half
        (0.8, 2 / 4),
        (0.9, 2.5 / 4.5),
        (1.0, 3 / 5),
    ],
)
def test_the_risk_among_the_most_confident(share: float, risk: float):
    assert risk_at(SAID, TRUE, ONCE, share) == pytest.approx(risk)


def test_the_risk_follows_the_weights():
    """Row 1: 1 twice, .6 (false), .2 (false); of four, 3.2 are kept."""
    assert risk_at(SAID, TRUE, WEIGHTS) == pytest.approx([2 / 4, 1.2 / 3.2, NAN], nan_ok=True)


def test_the_risk_of_moments_really_repeated():
    random = np.random.default_rng(2)
    episode = np.repeat(np.arange(6), 5)
    said, true = random.integers(0, 4, 30) / 4, random.random(30) < 0.5
    weights = episode_weights(episode, 20)
    for row, found in zip(weights.astype(int), risk_at(said, true, weights), strict=True):
        again = np.repeat(said, row), np.repeat(true, row)
        assert found == pytest.approx(risk_at(*again, np.ones((1, 30)))[0])


def test_the_order_of_equals_does_not_matter():
    """As with the clusters of a vocabulary: a few confidences for many moments."""
    random = np.random.default_rng(3)
    said, true = random.integers(0, 3, 50) / 4, random.random(50) < 0.5
    first = risk_at(said, true, np.ones((1, 50)))
    for _ in range(5):
        mixed = random.permutation(50)
        assert risk_at(said[mixed], true[mixed], np.ones((1, 50))) == pytest.approx(first)


def test_only_the_order_of_the_confidences_counts():
    assert risk_at(SAID * 100 - 7, TRUE, WEIGHTS[:2]).tolist() == risk_at(SAID, TRUE, WEIGHTS[:2]).tolist()


@pytest.mark.parametrize("share", [0.0, -1.0, 1.01, NAN])
def test_a_share_is_a_part_of_the_whole(share: float):
    with pytest.raises(ValueError, match=f"share={share}: allowed is above 0 and at most 1"):
        risk_at(SAID, TRUE, ONCE, share)


def test_the_curve_goes_from_the_most_confident_to_all():
    coverage, risk = risk_coverage(SAID, TRUE)
    assert coverage == pytest.approx([1 / 5, 2 / 5, 4 / 5, 1])
    assert risk == pytest.approx([0, 1 / 2, 2 / 4, 3 / 5])
    assert risk == pytest.approx([risk_at(SAID, TRUE, ONCE, share)[0] for share in coverage])


@pytest.fixture
def learnt() -> tuple[Array, Array]:
    """Two features of different spread, the first one tells something, a third one never moves."""
    random = np.random.default_rng(0)
    features = np.column_stack([random.random(4000), random.uniform(0.4, 0.42, 4000), np.full(4000, 0.3)])
    return features, random.random(4000) < 1 / (1 + np.exp(-1.5 * log_odds(features[:, 0])))


NAMES = ("share", "noise", "constant")


def log_odds(shares: Array) -> Array:
    return np.log((shares + EDGE) / (1 - shares + EDGE))


def test_a_calibration_is_a_logistic_regression(learnt: tuple[Array, Array]):
    features, true = learnt
    found = Calibration.fit(features, true, NAMES).probability(features)
    plain = LogisticRegression(C=np.inf, tol=1e-8).fit(log_odds(features[:, :2]) * [1, 100], true)
    assert found == pytest.approx(plain.predict_proba(log_odds(features[:, :2]) * [1, 100])[:, 1], abs=2e-3)


def test_shares_that_are_probabilities_stay_what_they_are(learnt: tuple[Array, Array]):
    features = learnt[0][:, :1]
    fitted = Calibration.fit(features, np.random.default_rng(1).random(4000) < features[:, 0], ["share"])
    shares = np.array([[0.1], [0.4], [0.75], [0.9]])
    assert fitted.probability(shares) == pytest.approx(shares[:, 0], abs=0.03)
    assert np.ptp(fitted.probability(np.array([[1 + 1e-9], [1.0]]))) == 0


@pytest.mark.parametrize("value", [-0.1, 1.1, NAN])
def test_what_is_no_share_is_no_feature(value: float):
    with pytest.raises(ValueError, match=rf"a feature of the confidence is {value}: allowed is 0 to 1"):
        Calibration.fit(np.array([[0.5], [value]]), np.array([True, False]), ["a"])


def test_a_feature_that_never_moved_says_nothing(learnt: tuple[Array, Array]):
    """.1 many times over has a mean that is not quite .1, and so a spread that is not quite 0."""
    features, true = learnt
    features[:, 2] = 0.1
    fitted = Calibration.fit(features, true, NAMES)
    assert fitted.probability(features + 0.5 * np.eye(3)[2]) == pytest.approx(fitted.probability(features))


def test_a_calibration_tells_the_true_from_the_false(learnt: tuple[Array, Array]):
    features, true = learnt
    fitted = Calibration.fit(features[:2000], true[:2000], NAMES)
    rest, outcome = fitted.probability(features[2000:]), true[2000:]
    once = np.ones((1, 2000))
    assert rest.shape == (2000,)
    assert brier(rest, outcome, once) == pytest.approx(brier_score_loss(outcome, rest))
    assert brier(rest, outcome, once) < 0.8 * brier(np.full(2000, outcome.mean()), outcome, once)
    assert ece(rest, outcome, once) < 0.05
    assert risk_at(rest, outcome, once, 0.5) < 0.5 * risk_at(rest, outcome, once, 1.0)


@pytest.mark.parametrize(
    ("outcomes", "share"), [([True] * 8, 9 / 10), ([False] * 8, 1 / 10), ([True], 2 / 3), ([], 1 / 2)]
)
def test_one_outcome_gives_the_smoothed_share(outcomes: list[bool], share: float):
    features = np.linspace(0, 1, 2 * len(outcomes)).reshape(-1, 2)
    fitted = Calibration.fit(features, np.array(outcomes, bool), ("a", "b"))
    assert fitted.probability(np.array([[0.0, 0], [100, -100]])) == pytest.approx([share, share])


def test_a_calibration_goes_through_json(learnt: tuple[Array, Array]):
    fitted = Calibration.fit(*learnt, NAMES)
    again = Calibration.from_dict(json.loads(json.dumps(fitted.to_dict())))
    assert again.names == NAMES
    assert again.to_dict() == fitted.to_dict()
    assert again.probability(learnt[0]).tolist() == fitted.probability(learnt[0]).tolist()


SAVED = {"names": ["a", "b"], "mean": [0, 1], "scale": [1, 2], "coefficients": [3, 4], "intercept": [5]}


def test_a_calibration_of_an_earlier_run_is_what_was_saved():
    """On the features as they are: (3 * (2 - 0) / 1 + 4 * (-3 - 1) / 2) + 5 = 3."""
    fitted = Calibration.from_dict(SAVED)
    assert fitted.probability(np.array([[2.0, -3.0]])) == pytest.approx([1 / (1 + np.exp(-3))])


def test_a_calibration_on_log_odds_is_what_was_saved():
    """(3 * (0 - 0) / 1 + 4 * (log(.52 / .52) - 1) / 2) + 5 = 3."""
    fitted = Calibration.from_dict(SAVED | {"log_odds": True})
    assert fitted.probability(np.array([[0.5, 0.5]])) == pytest.approx([1 / (1 + np.exp(-3))])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, None) for name in SAVED),
        ("mean", [0]),
        ("mean", [0, NAN]),
        ("scale", [1, 0]),
        ("coefficients", [[3], [4]]),
        ("coefficients", ["many", 4]),
        ("coefficients", [[3, 1], [4]]),
        ("intercept", []),
        ("intercept", [float("inf")]),
        ("names", ["a"]),
    ],
)
def test_a_damaged_calibration_is_refused(name: str, value: Any):
    with pytest.raises(ValueError, match="the calibration is damaged"):
        Calibration.from_dict(SAVED | {name: value})
    with pytest.raises(ValueError, match=f"the calibration is damaged: KeyError.*{name}"):
        Calibration.from_dict({key: kept for key, kept in SAVED.items() if key != name})


def test_log_odds_are_yes_or_no():
    with pytest.raises(ValueError, match=r"the calibration is damaged.*log_odds=1: allowed are true and false"):
        Calibration.from_dict(SAVED | {"log_odds": 1})


@pytest.mark.parametrize("saved", [None, [], "text", 3])
def test_what_is_no_dictionary_is_no_calibration(saved: Any):
    with pytest.raises(ValueError, match="the calibration is damaged"):
        Calibration.from_dict(saved)


def test_each_feature_has_a_name(learnt: tuple[Array, Array]):
    with pytest.raises(ValueError, match="shape"):
        Calibration.fit(*learnt, NAMES[:2])
