"""What is known of the words, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from by_hand import TASK, WORDS

from ibe_rl.ibe import Evidence, Meaning, meaning_lines, positive_phrase
from ibe_rl.ibe.meaning_lines import NOT_INFERRED

WHY = "the reward favours the opposite of what ends the instruction"
UP, DOWN = "“going up”", "“going down”"
RISES = (1.0, 0.1, -0.5)
BEST, PAYS = Evidence("best", 1.234, 1.0, 1.5, 40), Evidence("pays", -0.3, -0.4, -0.2, 40)
STOPS = Evidence("satisfaction", 1.0, 0.5, 1.5, 40)


@pytest.mark.parametrize(
    ("meaning", "line"),
    [
        (Meaning(), f"{UP} and {DOWN}: +1 asks for a movement"),
        (
            Meaning(reason="from what ends the instruction", direction=RISES),
            f"{UP} and {DOWN}: +1 asks height to rise and floor to fall, from what ends the instruction",
        ),
        (Meaning(False, False, WHY), f"I cannot tell what {UP} means: {WHY}"),
        (
            Meaning(False, False, WHY, (BEST, PAYS, STOPS), 412),
            f"I cannot tell what {UP} means: {WHY} (the best episodes moved +1.23 standard deviations the instructed "
            "way; following is not rewarded; 412 episodes)",
        ),
        (  # which way would be followed?
            Meaning(False, False, "the only evidence is what is rewarded", (BEST, PAYS), 412),
            f"I cannot tell what {UP} means: the only evidence is what is rewarded (412 episodes)",
        ),
        (Meaning(True, False), f"{DOWN}: +1 asks for a movement, but I cannot tell what {UP} means"),
        (Meaning(False, True), f"{UP}: +1 asks for a movement, but I cannot tell what {DOWN} means"),
    ],
)
def test_a_line_says_which_words_are_known_and_why(meaning: Meaning, line: str) -> None:
    assert meaning_lines((meaning,), TASK) == [line]


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [(0.1, 0.3, "following is rewarded"), (-0.1, 0.1, "whether following is rewarded is unclear")],
)
def test_whether_following_pays_is_said(low: float, high: float, words: str) -> None:
    [line] = meaning_lines((Meaning(evidence=(Evidence("pays", 0.0, low, high, 9),)),), TASK)
    assert line.endswith(f" ({words})")


def test_each_number_has_its_line() -> None:
    two = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(0.5, 0.5), explained_range=())
    assert len(meaning_lines((Meaning(), Meaning(False, False)), two)) == 2


def test_that_nobody_has_asked_is_said() -> None:
    assert meaning_lines((), TASK) == [NOT_INFERRED]


def test_the_degree_is_left_out() -> None:
    assert positive_phrase(WORDS) == UP
