"""What a motion AUC is worth, at every border, and what is said of it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from by_hand import TASK, WORDS

from ibe_rl.ibe import Meaning
from ibe_rl.metrics.verdict import (
    AN_ECHO,
    GOOD,
    NO_BETTER,
    NO_MEANING,
    NOT_MEASURED,
    REVERSED,
    UNKNOWN,
    WEAK,
    Verdict,
    in_one_line,
    short_number,
    verdict,
    verdicts_of,
    worst,
    wrong_signs,
)

NAN = math.nan
TWO = replace(
    TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(0.5, 0.5), explained_range=(), motion=None
)


@pytest.mark.parametrize(
    ("auc", "echo", "known", "interval", "level", "why"),
    [
        (0.97, 0.61, True, None, GOOD, ""),
        (0.9, 0.61, True, None, GOOD, ""),
        (0.97, NAN, True, None, GOOD, ""),  # nobody ever echoed anything
        (0.97, 0.97, True, None, WEAK, AN_ECHO),
        (0.97, 0.95, True, (0.94, 0.99), WEAK, AN_ECHO),  # not clear of it
        (0.97, 0.95, True, (0.96, 0.99), GOOD, ""),
        (0.89, 0.61, True, None, WEAK, ""),
        (0.6, 0.55, True, None, WEAK, ""),
        (0.75, 0.4, True, (0.48, 0.9), UNKNOWN, NO_BETTER),  # chance lies in the interval
        (0.59, 0.55, True, None, UNKNOWN, NO_BETTER),
        (0.4, 0.55, True, None, UNKNOWN, NO_BETTER),
        (0.39, 0.55, True, None, REVERSED, ""),
        (0.044, 0.61, True, None, REVERSED, ""),
        (0.2, 0.61, True, (0.1, 0.55), UNKNOWN, NO_BETTER),
        (0.2, 0.1, True, (0.1, 0.3), REVERSED, ""),
        (NAN, 0.61, True, None, UNKNOWN, NOT_MEASURED),
        (0.97, 0.61, False, None, UNKNOWN, NO_MEANING),
        (0.044, 0.61, False, None, UNKNOWN, NO_MEANING),
    ],
)
def test_levels(
    auc: float, echo: float, known: bool, interval: tuple[float, float] | None, level: str, why: str
) -> None:
    found = verdict(auc, echo, known, interval)
    assert (found.level, found.why) == (level, why)


def test_the_figures_stand_with_chance_and_the_echo() -> None:
    assert verdict(0.044, 0.61, True).figures == ".04, reversed (chance .50, repeating the last instruction .61)"
    assert verdict(0.97, NAN, True).figures == ".97, good (chance .50)"
    assert verdict(0.97, 0.97, True).figures == f".97, {AN_ECHO} (chance .50, repeating the last instruction .97)"
    interval = verdict(0.75, 0.5, True, (0.7, 0.8), "speed").figures
    assert interval == "speed .75 [.70, .80], weak (chance .50, repeating the last instruction .50)"


def test_no_number_stands_where_words_have_no_meaning() -> None:
    assert verdict(0.97, 0.61, False).figures == f"{NO_MEANING} (chance .50, repeating the last instruction .61)"
    assert verdict(NAN, NAN, True).figures == f"{NOT_MEASURED} (chance .50)"


def test_of_several_numbers_the_worst_counts() -> None:
    each = [verdict(auc, 0.5, known) for auc, known in ((0.97, True), (0.7, True), (0.97, False), (0.1, True))]
    assert [worst(each[:n]).level for n in (1, 2, 3, 4)] == [GOOD, WEAK, UNKNOWN, REVERSED]


def scores(auc: float, echo: float = 0.5) -> dict[str, float]:
    return {"motion_auc": auc, "echo_auc": echo}


def test_a_verdict_for_each_number_that_only_several_name() -> None:
    [only] = verdicts_of([scores(0.97)], (), TASK)
    assert (only.level, only.number) == (GOOD, "")
    first, second = verdicts_of([scores(0.97), scores(0.97)], (Meaning(), Meaning(False, False)), TWO)
    assert (first.level, first.number) == (GOOD, "height")
    assert (second.level, second.why, second.number) == (UNKNOWN, NO_MEANING, "speed")
    assert [one.why for one in verdicts_of([], (), TWO)] == [NOT_MEASURED] * 2
    line = in_one_line([first, second])
    assert line.startswith("AUC of its words for the direction of motion: height .97, good (chance .50, ")
    assert f"; speed {NO_MEANING} (" in line


def test_one_known_side_is_a_meaning() -> None:
    assert verdicts_of([scores(0.97)], (Meaning(negative=False),), TASK)[0].level == GOOD


def test_a_declared_sign_that_the_log_contradicts_is_named() -> None:
    both = verdicts_of([scores(0.97), scores(0.1)], (Meaning(), Meaning()), TWO)
    assert wrong_signs(both, (), TWO) == []  # nobody has asked what the words mean
    assert wrong_signs(both, (Meaning(), Meaning()), TWO) == [
        "env.task.explained=[speed] says that speed rises with +1, but in the log +1 asks it to fall: check the sign"
    ]
    falls, elsewhere = Meaning(direction=(0.0, -1.0, 0.0)), Meaning(direction=(1.0, 0.1, 0.0))
    assert wrong_signs(both, (Meaning(), falls), TWO) == wrong_signs(both, (Meaning(), Meaning()), TWO)
    assert wrong_signs(both, (Meaning(), elsewhere), TWO) == [
        "env.task.explained=[speed] says that speed rises with +1, but in the log +1 asks height to rise: "
        "check the name"
    ]
    unknown = (Meaning(False, False),)
    assert wrong_signs(verdicts_of([scores(0.1)], unknown, TASK), unknown, TASK) == []


def test_numbers_are_short() -> None:
    assert [short_number(value) for value in (0.0, 0.044, 0.5, 0.99, 1.0)] == [".00", ".04", ".50", ".99", "1.00"]


def test_it_is_plain() -> None:
    assert verdict(0.7, 0.5, True) == Verdict(WEAK, "", 0.7, 0.5)
