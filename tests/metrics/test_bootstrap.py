"""Scores on resamples of whole episodes, held against the same scores on moments that are really repeated."""

import json

import numpy as np
import pytest
from scipy.stats import spearmanr
from sklearn.metrics import f1_score, roc_auc_score

from ibe_rl.metrics import bootstrap
from ibe_rl.metrics.bootstrap import (
    Estimate,
    episode_weights,
    estimate,
    weighted_auc,
    weighted_f1,
    weighted_mean,
    weighted_spearman,
)
from ibe_rl.metrics.quality import direction, motion_auc, motion_scores, motion_spearman
from ibe_rl.types import Array

NAN = float("nan")
BAND = 0.5
EPISODE = np.repeat([7, 3, 11, 4, 20], [5, 1, 9, 4, 6])


def repeated(values: Array, weights: Array) -> list[Array]:
    """The moments of each resample, each as often as it was drawn."""
    return [np.repeat(values, row.astype(int)) for row in weights]


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.fixture(params=["ties", "no ties"])
def score(request: pytest.FixtureRequest, random: np.random.Generator) -> Array:
    values = random.normal(size=len(EPISODE))
    return np.round(values) if request.param == "ties" else values


@pytest.fixture(params=[10_000_000, 60, 1], ids=["whole", "in chunks", "row by row"])
def weights(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Array:
    monkeypatch.setattr(bootstrap, "CHUNK", request.param)
    return episode_weights(EPISODE, resamples=20, seed=1)


def test_a_resample_draws_whole_episodes_as_many_as_there_are():
    drawn = episode_weights(EPISODE, resamples=200)
    assert drawn.shape == (201, len(EPISODE))
    assert drawn.dtype == np.float32
    assert (drawn[0] == 1).all()
    first = np.unique(EPISODE, return_index=True)[1]
    for name, moment in zip(np.unique(EPISODE), first, strict=True):
        assert (drawn[:, name == EPISODE] == drawn[:, [moment]]).all()
    assert (drawn[:, first].sum(axis=1) == 5).all()


def test_every_episode_is_drawn_alike_often_however_long_it_is():
    """Of five, each is left out of (4/5)^5 of the resamples."""
    drawn = episode_weights(EPISODE, resamples=20_000)[1:]
    assert drawn.mean(axis=0) == pytest.approx(1, abs=0.03)
    assert (drawn == 0).mean(axis=0) == pytest.approx(0.8**5, abs=0.015)


def test_the_seed_decides_what_is_drawn():
    assert (episode_weights(EPISODE, 10, seed=3) == episode_weights(EPISODE, 10, seed=3)).all()
    assert (episode_weights(EPISODE, 10, seed=3) != episode_weights(EPISODE, 10, seed=4)).any()


def test_without_moments_nothing_can_be_drawn():
    with pytest.raises(ValueError, match="no moments"):
        episode_weights(np.zeros(0, int))


def test_the_mean_under_weights():
    rows = np.array([[1, 1, 1], [0, 3, 1], [0, 0, 0]], np.float32)
    assert weighted_mean(np.array([1.0, 2, 6]), rows) == pytest.approx([3, 3, NAN], nan_ok=True)
    assert weighted_mean(np.array([True, False, False]), rows) == pytest.approx([1 / 3, 0, NAN], nan_ok=True)


def test_auc_counts_pairs_in_the_right_order():
    """Of 0, 1, 1, 2, where the second and the fourth are positive: (1 + .5) + 2 of 4 pairs."""
    rows = np.array([[1, 1, 1, 1], [1, 0, 5, 1], [0, 2, 3, 0], [1, 0, 1, 0], [0, 1, 0, 1], [0, 0, 0, 0]], np.float32)
    found = weighted_auc(np.array([0, 1, 1, 2]), np.array([False, True, False, True]), rows)
    assert found == pytest.approx([3.5 / 4, 1, 0.5, NAN, NAN, NAN], nan_ok=True)


def test_auc_is_that_of_moments_really_repeated(score: Array, weights: Array, random: np.random.Generator):
    positive = score + random.normal(size=len(score)) > 0
    found = weighted_auc(score, positive, weights)
    pairs = zip(repeated(score, weights), repeated(positive, weights), strict=True)
    assert found == pytest.approx([roc_auc_score(truth, said) for said, truth in pairs])


def test_auc_takes_weights_that_are_not_whole(score: Array, random: np.random.Generator):
    positive, weights = random.random(len(score)) < 0.4, random.random((6, len(score)))
    expected = [roc_auc_score(positive, score, sample_weight=row) for row in weights]
    assert weighted_auc(score, positive, weights) == pytest.approx(expected)


def test_auc_of_no_moments_is_not_a_number():
    assert np.isnan(weighted_auc(np.zeros(0), np.zeros(0, bool), np.zeros((3, 0)))).tolist() == [True] * 3


def test_what_is_not_a_number_has_no_rank():
    broken, rows = np.array([0.0, NAN, 1]), np.ones((1, 3))
    with pytest.raises(ValueError, match="nan has no rank"):
        weighted_auc(broken, np.array([True, False, True]), rows)
    with pytest.raises(ValueError, match="nan has no rank"):
        weighted_spearman(np.arange(3), broken, rows)


def test_spearman_is_that_of_moments_really_repeated(score: Array, weights: Array, random: np.random.Generator):
    other = score + random.normal(size=len(score))
    pairs = zip(repeated(score, weights), repeated(other, weights), strict=True)
    expected = [spearmanr(*pair).statistic for pair in pairs]
    assert weighted_spearman(score, other, weights) == pytest.approx(expected)
    assert weighted_spearman(other, score, weights) == pytest.approx(expected)
    assert weighted_spearman(score, -other, weights) == pytest.approx(-np.array(expected))


def test_spearman_of_what_is_constant_on_a_resample_is_not_a_number():
    rows = np.array([[1, 1, 1, 1], [3, 1, 0, 0], [0, 0, 1, 1], [0, 2, 0, 0], [0, 0, 0, 0]], np.float32)
    found = weighted_spearman(np.array([5, 5, 6, 7]), np.array([1, 2, 4, 3]), rows)
    assert found == pytest.approx([spearmanr([5, 5, 6, 7], [1, 2, 4, 3]).statistic, NAN, -1, NAN, NAN], nan_ok=True)


def test_spearman_knows_what_is_constant_under_any_weights():
    """No remainder of a sum may pass for a spread."""
    rows = np.random.default_rng(0).random((200, 9))
    assert np.isnan(weighted_spearman(np.full(9, 0.3), np.arange(9), rows)).all()
    rows[:, 3:] = 0
    assert np.isnan(weighted_spearman(np.array([1, 1, 1, 0, 2, 3, 4, 5, 6]), np.arange(9), rows)).all()


def test_f1_is_scikit_learns_of_moments_really_repeated(weights: Array, random: np.random.Generator):
    said, real = (random.integers(0, 4, len(EPISODE)) for _ in range(2))
    found = weighted_f1(said, real, 5, weights)  # class 4 never occurs
    again = zip(repeated(real, weights), repeated(said, weights), strict=True)
    assert found.tolist() == [f1_score(*both, average="macro") for both in again]


def test_an_estimate_is_row_0_with_the_percentiles_of_the_others():
    rows = np.append(1000.0, np.random.default_rng(0).permutation(101))
    assert estimate(rows) == Estimate(1000.0, pytest.approx(2.5), pytest.approx(97.5))
    assert estimate(rows, level=0.5) == Estimate(1000.0, pytest.approx(25), pytest.approx(75))


def test_resamples_that_cannot_tell_are_left_out():
    rows = np.append(3.0, [NAN, *range(101), NAN, NAN])
    assert estimate(rows) == Estimate(3.0, pytest.approx(2.5), pytest.approx(97.5))


@pytest.mark.parametrize(
    ("rows", "known"),
    [([NAN, 1, 2], [None, None, None]), ([0.5], [0.5, None, None]), ([0.5, NAN, NAN], [0.5, None, None])],
)
def test_an_estimate_that_cannot_tell_says_none(rows: list[float], known: list[float | None]):
    found = estimate(np.array(rows)).to_dict()
    assert found == dict(zip(("value", "low", "high"), known, strict=True))
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_an_estimate_is_made_of_plain_numbers():
    found = estimate(np.array([1, 0, 2], np.float32))
    assert {type(number) for number in (found.value, found.low, found.high)} == {float}


def test_a_change_just_as_large_as_the_band_went_nowhere():
    assert direction(np.array([-2, -0.5, -0.1, 0, 0.5, 0.6]), 0.5).tolist() == [-1, 0, 0, 0, 0, 1]


@pytest.fixture
def scored(random: np.random.Generator) -> dict[str, Array]:
    change = random.normal(size=len(EPISODE))
    return {
        "expression": np.round(change + random.normal(size=len(EPISODE)), 1),
        "change": change,
        "instruction": random.choice([-1.0, 0, 1], len(EPISODE)),
        "hard": random.random(len(EPISODE)) < 0.6,
    }


def test_motion_scores_are_those_of_moments_really_repeated(scored: dict[str, Array], weights: Array):
    """Row 0 among them: there every moment is repeated once."""
    found = motion_scores(**scored, band=BAND, weights=weights)
    assert {name: rows.shape for name, rows in found.items()} == dict.fromkeys(found, (len(weights),))
    for row, counts in enumerate(weights.astype(int)):
        said, change, instruction, hard = (np.repeat(values, counts) for values in scored.values())
        disobeyed = np.where(np.abs(change) > BAND, np.sign(change), 0) != instruction
        expected = {
            "motion_auc": motion_auc(said, change, BAND),
            "motion_auc_disobeyed": motion_auc(said[disobeyed], change[disobeyed], BAND),
            "motion_auc_hard": motion_auc(said[hard], change[hard], BAND),
            "motion_spearman": motion_spearman(said, change),
        }
        assert {name: rows[row] for name, rows in found.items()} == pytest.approx(expected, nan_ok=True)


def test_without_hard_moments_their_score_is_not_a_number(scored: dict[str, Array], weights: Array):
    some = motion_scores(**scored, band=BAND, weights=weights)
    none = motion_scores(**scored | {"hard": None}, band=BAND, weights=weights)
    empty = motion_scores(**scored | {"hard": np.zeros(len(EPISODE), bool)}, band=BAND, weights=weights)
    for other in (none, empty):
        assert np.isnan(other["motion_auc_hard"]).all()
        assert other["motion_auc"].tolist() == some["motion_auc"].tolist()


def test_an_explainer_that_says_the_same_gets_the_same_on_every_resample(scored: dict[str, Array], weights: Array):
    """Paired: the difference between two codes in the same order is 0, not two independent draws."""
    found = motion_scores(**scored, band=BAND, weights=weights)
    other = motion_scores(**scored | {"expression": 3 * scored["expression"] + 1}, band=BAND, weights=weights)
    for name, rows in found.items():
        assert other[name].tolist() == pytest.approx(rows.tolist(), nan_ok=True)
