"""What is known of the words, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from by_hand import TASK, WORDS

from ibe_rl.ibe import Meaning, meaning_lines, positive_phrase
from ibe_rl.ibe.meaning_lines import NOBODY_ASKED

WHY = "those who earned most did not do it (412 episodes)"
UP, DOWN = "“going up”", "“going down”"


@pytest.mark.parametrize(
    ("meaning", "line"),
    [
        (Meaning(reason=WHY), f"it is known what {UP} and {DOWN} mean: {WHY}"),
        (Meaning(), f"it is known what {UP} and {DOWN} mean"),
        (Meaning(False, False, WHY), f"I cannot tell what {UP} means: {WHY}"),
        (Meaning(True, False, WHY), f"it is known what {DOWN} means, but I cannot tell what {UP} means: {WHY}"),
        (Meaning(False, True, WHY), f"it is known what {UP} means, but I cannot tell what {DOWN} means: {WHY}"),
    ],
)
def test_a_line_says_which_words_are_known_and_why(meaning: Meaning, line: str) -> None:
    assert meaning_lines((meaning,), TASK) == [line]


def test_each_number_has_its_line() -> None:
    two = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(0.5, 0.5), explained_range=())
    assert len(meaning_lines((Meaning(), Meaning(False, False)), two)) == 2


def test_that_nobody_has_asked_is_said() -> None:
    assert meaning_lines((), TASK) == [NOBODY_ASKED]


def test_the_degree_is_left_out() -> None:
    assert positive_phrase(WORDS) == UP
