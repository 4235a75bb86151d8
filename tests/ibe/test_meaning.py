"""What is known of words: what can be said, which side, and how it is kept."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ibe_rl.ibe import Evidence, Meaning, sayable

BEST = Evidence("best", 0.5, 0.25, 0.75, 30)
ENDS = Evidence("satisfaction", -1.0, -1.5, -0.5, 20)


@pytest.mark.parametrize(
    ("low", "high", "sign"), [(0.1, 0.9, 1), (-0.9, -0.1, -1), (-0.1, 0.9, 0), (0.0, 0.9, 0), (-0.9, 0.0, 0)]
)
def test_evidence_points_where_its_whole_interval_does(low: float, high: float, sign: int) -> None:
    assert Evidence("pays", (low + high) / 2, low, high, 9).sign == sign


def test_nobody_has_asked_so_all_counts_as_known() -> None:
    assert (Meaning().negative, Meaning().positive, Meaning().known) == (True, True, True)


@pytest.mark.parametrize(
    ("negative", "positive", "known"), [(True, False, True), (False, True, True), (False, False, False)]
)
def test_one_word_is_enough_to_know_something(negative: bool, positive: bool, known: bool) -> None:
    assert Meaning(negative, positive).known is known


def test_what_is_unknown_has_a_reason() -> None:
    assert Meaning.unknown("why", 7) == Meaning(False, False, "why", (), 7)


def test_words_called_by_the_instructions_of_the_best_need_the_best_to_have_followed() -> None:
    followed = Meaning(True, False, "seen", (ENDS, BEST), 30)
    assert followed.as_the_best_did() is followed
    for others in ((ENDS, replace(BEST, effect=-0.5)), (ENDS, replace(BEST, effect=0.0))):
        found = replace(followed, evidence=others).as_the_best_did()
        assert found == Meaning(False, False, "the best episodes did the opposite", others, 30)


def test_too_few_of_the_best_say_nothing_of_them() -> None:
    found = Meaning(True, True, "seen", (ENDS,), 9).as_the_best_did()
    assert found == Meaning(False, False, "too few of the best episodes have instructions", (ENDS,), 9)


def test_what_is_unknown_anyway_keeps_its_reason() -> None:
    unknown = Meaning.unknown("why", 7)
    assert unknown.as_the_best_did() is unknown


def test_along_the_opposite_all_evidence_is_the_opposite() -> None:
    meaning = Meaning(True, False, "seen", (BEST, ENDS), 30)
    turned = meaning.turned()
    assert turned.evidence == (Evidence("best", -0.5, -0.75, -0.25, 30), Evidence("satisfaction", 1.0, 0.5, 1.5, 20))
    assert [one.sign for one in turned.evidence] == [-1, 1]
    assert replace(turned, evidence=()) == replace(meaning, evidence=())  # the words stay which they are
    assert turned.turned() == meaning


def test_it_comes_back_from_json() -> None:
    for meaning in (Meaning(True, False, "seen", (BEST, ENDS), 30), Meaning.unknown("why", 0), Meaning()):
        assert Meaning.from_dict(json.loads(json.dumps(meaning.to_dict()))) == meaning


SAVED = Meaning(True, False, "seen", (BEST,), 30).to_dict()
ONE = SAVED["evidence"][0]
DAMAGED: dict[str, Any] = {
    "nothing": {},
    "a list": [],
    "no value": None,
    **{f"no {name}": {key: value for key, value in SAVED.items() if key != name} for name in SAVED},
    **{
        f"no {name} of the evidence": SAVED | {"evidence": [{key: value for key, value in ONE.items() if key != name}]}
        for name in ONE
    },
    "no evidence at all": SAVED | {"evidence": None},
    "evidence of nothing": SAVED | {"evidence": ["best"]},
    "words for a number": SAVED | {"episodes": "many"},
    "endless episodes": SAVED | {"episodes": float("inf")},
    "an endless effect": SAVED | {"evidence": [ONE | {"effect": float("inf")}]},
    "no interval": SAVED | {"evidence": [ONE | {"low": float("nan")}]},
    "too large a number": SAVED | {"evidence": [ONE | {"high": 10**400}]},
}


@pytest.mark.parametrize("how", DAMAGED)
def test_a_damaged_one_is_refused(how: str) -> None:
    with pytest.raises(ValueError, match="the meaning is damaged"):
        Meaning.from_dict(DAMAGED[how])


EXPRESSIONS = np.array([[1.0], [0.2], [0.0], [-0.2], [-1.0]])


@pytest.mark.parametrize(
    ("meaning", "can"),
    [
        (Meaning(True, True), [True] * 5),
        (Meaning(False, True), [True, True, True, False, False]),
        (Meaning(True, False), [False, False, True, True, True]),
        (Meaning(False, False), [False] * 5),
    ],
)
def test_only_known_words_can_be_said_and_no_movement_with_any(meaning: Meaning, can: list[bool]) -> None:
    assert sayable(EXPRESSIONS, (meaning,)).tolist() == can


def test_all_numbers_must_be_known() -> None:
    expressions = np.array([[1.0, 1], [1, -1], [0, 1], [-1, 0]])
    assert sayable(expressions, (Meaning(False, True), Meaning(True, False))).tolist() == [False, True, False, False]


def test_where_nobody_has_asked_all_can_be_said() -> None:
    assert sayable(EXPRESSIONS, ()).tolist() == [True] * 5
