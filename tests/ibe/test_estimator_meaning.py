"""A vocabulary whose words are meant as an interpretation says, and not as the best happened to move."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from test_estimator_axis import LIKE_AXIS, heard, moved, said, windows

from ibe_rl.ibe import Evidence, IBEMapping, Interpretation, Meaning, TooLittleDataError, UnknownMeaningWarning
from ibe_rl.types import Array

FIRST = np.array([1.0, 0, 0, 0])
KNOWN = Meaning(reason="seen")
UNKNOWN = Meaning.unknown("nobody moved", 30)
DIRECT = LIKE_AXIS | {"power": 1.0, "membership": "direct"}


def meant(*meanings: Meaning, axes: Array = FIRST[:, None]) -> Interpretation:
    return Interpretation(axes, meanings)


def best(effect: float, **sides: bool) -> Meaning:
    return Meaning(**sides, reason="seen", evidence=(Evidence("best", effect, effect - 0.1, effect + 0.1, 30),))


def fit(interpretation: Interpretation | None, unit: float = 2.0, **settings: Any) -> IBEMapping:
    estimator = IBEMapping(**({"n_clusters": 7, "random_state": 0} | DIRECT | settings))
    return estimator.fit(*windows(unit), interpretation=interpretation)


def test_it_needs_nothing_else_to_compare_changes_along_its_axes() -> None:
    """2 is what the instruction 1 typically brings about."""
    estimator = fit(meant(KNOWN))
    np.testing.assert_allclose(said(estimator.mapping_, -9, -1, 0, 1, 2, 9), [-1, -0.5, 0, 0.5, 1, 1], atol=0.02)
    assert estimator.meanings_ == estimator.mapping_.meanings == (KNOWN,)


@pytest.mark.parametrize("scale", [1.0, 1_000.0])
def test_the_length_of_its_axis_says_nothing(scale: float) -> None:
    estimator = fit(meant(KNOWN, axes=scale * FIRST[:, None]))
    np.testing.assert_allclose(said(estimator.mapping_, -1, 1), [-0.5, 0.5], atol=0.01)


def test_what_is_known_stands_against_what_the_best_did() -> None:
    """Told to the right the best went left; the mean movement was 2, and half of it is the smallest unit."""
    estimator = fit(meant(KNOWN), unit=-2.0)
    np.testing.assert_allclose(said(estimator.mapping_, -0.5, 0, 0.5, 1), [-0.5, 0, 0.5, 1], atol=0.01)
    assert fit(meant(KNOWN, axes=-FIRST[:, None]), unit=-2.0).mapping_.express(moved(2.0))[0, 0] == -1


def test_what_is_not_known_is_called_as_the_best_did() -> None:
    with pytest.warns(UnknownMeaningWarning):
        estimator = fit(meant(UNKNOWN), unit=-2.0)
    np.testing.assert_allclose(said(estimator.mapping_, -1, 1), [0.5, -0.5], atol=0.01)


def test_where_the_best_followed_little_the_unit_is_half_of_their_mean_movement() -> None:
    """Five in eight go 2 as told, the others 2 the other way: a mean of 0.5 as told, of movements of 2."""
    instruction = np.tile([1.0, -1], 400)
    went = np.where(np.arange(800) // 2 % 8 < 5, instruction, -instruction) * 2
    delta = moved(*(went + np.random.default_rng(0).normal(0, 1e-3, 800)))
    still = np.zeros_like(delta), 0 * instruction  # told nothing, these do not count
    both = np.concatenate([delta, still[0]]), np.concatenate([instruction, still[1]])
    units = {}
    for meaning in (KNOWN, UNKNOWN):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnknownMeaningWarning)
            mapping = IBEMapping(3, **DIRECT, random_state=0).fit(*both, interpretation=meant(meaning)).mapping_
        units[meaning] = 0.1 / said(mapping, 0.1)[0]
    assert units[KNOWN] == pytest.approx(1.0, rel=0.01)
    assert units[UNKNOWN] == pytest.approx(0.5, rel=0.01)


def test_one_known_word_is_enough_for_the_axis() -> None:
    one_sided = Meaning(False, True, "seen")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimator = fit(meant(one_sided), unit=-2.0)
    assert estimator.mapping_.express(moved(2.0))[0, 0] == 1
    assert estimator.mapping_.knows(moved(-2.0, 0.0, 2.0)).tolist() == [False, True, True]


def test_a_warning_says_which_component_is_unknown_and_why() -> None:
    """Of two numbers, about the first and the third dimension."""
    instruction = np.random.default_rng(0).choice([-1.0, 0, 1], (600, 2))
    delta = np.zeros((600, 4))
    delta[:, [0, 2]] = instruction * 2 + np.random.default_rng(1).normal(0, 0.05, (600, 2))
    interpretation = meant(KNOWN, UNKNOWN, axes=np.eye(4)[:, [0, 2]])
    with pytest.warns(UnknownMeaningWarning) as seen:
        estimator = IBEMapping(9, **DIRECT, random_state=0).fit(delta, instruction, interpretation=interpretation)
    assert [str(one.message) for one in seen] == [
        "the meaning of component 1 of the instruction is unknown: nobody moved"
    ]
    assert seen[0].filename == __file__
    assert estimator.meanings_ == (KNOWN, UNKNOWN)
    assert estimator.mapping_.knows(np.array([[2.0, 0, 0, 0]])).tolist() == [False]


def test_a_number_without_an_axis_is_too_little_data() -> None:
    with pytest.raises(TooLittleDataError, match="nobody moved"):
        fit(meant(UNKNOWN, axes=np.zeros((4, 1))))


def test_as_many_meanings_as_axes() -> None:
    with pytest.raises(ValueError, match="shorter"):
        fit(meant(KNOWN, axes=np.eye(4)[:, :2]))


def test_axes_of_dimensions_that_do_not_count_are_none() -> None:
    with pytest.raises(TooLittleDataError, match="nothing has moved under an instruction other than 0"):
        fit(meant(KNOWN), dimensions=[1])


def test_without_any_nothing_is_known_and_nobody_is_warned() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimator = IBEMapping(7, **DIRECT, random_state=0).fit(*windows(), *heard())
    assert estimator.meanings_ == estimator.mapping_.meanings == ()
    with pytest.raises(ValueError, match="space='rule': needs states and state_instructions, or an interpretation"):
        fit(None)


OTHERS: dict[str, dict[str, Any]] = {
    "all": {},
    "information": {},
    "lasso": {"normalisation": "movement"},
    "network": {"hidden": [4]},
}


@pytest.mark.parametrize("space", OTHERS)
def test_other_spaces_name_as_the_best_did_and_know_their_words_if_these_followed(space: str) -> None:
    settings = {"n_clusters": 3, "space": space, "random_state": 0} | OTHERS[space]
    plain = IBEMapping(**settings).fit(*windows())
    followed = best(0.5, negative=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimator = IBEMapping(**settings).fit(*windows(), interpretation=meant(followed))
    assert estimator.meanings_ == (followed,)
    with pytest.warns(UnknownMeaningWarning, match="is unknown: the best episodes did the opposite"):
        opposite = IBEMapping(**settings).fit(*windows(), interpretation=meant(best(-0.5)))
    assert not opposite.meanings_[0].known
    for each in (estimator, opposite):  # the interpretation moves no word
        np.testing.assert_array_equal(each.mapping_.expressions, plain.mapping_.expressions)
        np.testing.assert_array_equal(each.mapping_.centres, plain.mapping_.centres)


def test_other_spaces_need_no_axis_of_it() -> None:
    with pytest.warns(UnknownMeaningWarning, match="nobody moved"):
        IBEMapping(3, random_state=0).fit(*windows(), interpretation=meant(UNKNOWN, axes=np.zeros((4, 1))))


def test_on_the_axis_of_the_rule_words_are_known_though_the_best_did_the_opposite() -> None:
    assert fit(meant(best(-0.5)), unit=-2.0).meanings_ == (best(-0.5),)


def test_once_a_word_is_known_to_mean_the_opposite_the_past_says_nothing() -> None:
    """First called as the best did, then as is known."""
    with pytest.warns(UnknownMeaningWarning):
        before = fit(meant(UNKNOWN), unit=-2.0).mapping_
    after = fit(meant(KNOWN), unit=-2.0, last=before, memory=0.9).mapping_
    np.testing.assert_allclose(said(after, -0.5, 0.5), [-0.5, 0.5], atol=0.01)


def test_what_is_known_comes_back_with_the_mapping() -> None:
    mapping = fit(meant(best(0.5, positive=False)), membership="hard").mapping_
    read = type(mapping).from_dict(mapping.to_dict())
    assert read.meanings == mapping.meanings == (best(0.5, positive=False),)
    assert read.knows(moved(-2.0, 2.0)).tolist() == [True, False]
