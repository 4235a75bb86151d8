"""What an environment declares has to fit together."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, WORDS

from ibe_rl.ibe.vocabulary import phrase


def test_each_number_is_called_by_the_dimension_that_it_is_about():
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(1, 0), explained_band=(1, 2), explained_range=())
    assert both.number_names == ("speed", "height")
    assert both.instruction_size == 2
    assert both.explained_range == (1, 1)
    assert both.observation_size == 3 + 2 + 1


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        (
            {"explained": (0, 1)},
            r"^Task\.explained=\(0, 1\) has 2 entries but Task\.phrases 1: allowed is one for each",
        ),
        ({"explained_band": ()}, r"^Task\.explained_band=\(\) has 0 entries but Task\.phrases 1"),
        ({"explained_range": (1, 2)}, r"^Task\.explained_range=\(1, 2\) has 2 entries but Task\.phrases 1"),
        ({"explained": (3,)}, r"^Task\.explained=\(3,\): allowed are 0 to 2$"),
        ({"explained": (-1,)}, r"^Task\.explained=\(-1,\): allowed are 0 to 2$"),
    ],
)
def test_what_does_not_fit_together_is_refused(wrong: dict[str, Any], expected: str):
    with pytest.raises(ValueError, match=expected):
        replace(TASK, **wrong)


@pytest.mark.parametrize(
    "words",
    ["{degree", "{", "a}", "{0}", "{}", "{much}", "{degree!r}", "{degree:>10}", "{degree.real}", "{degree[0]}", "{{}"],
)
def test_what_stands_in_braces_is_the_degree_alone(words: str):
    for which in ("negative", "positive"):
        with pytest.raises(
            ValueError, match=rf"^phrase {re.escape(repr(words))}: allowed in braces is {{degree}} only"
        ):
            replace(WORDS, **{which: words})


@pytest.mark.parametrize("words", ["100 % %s {degree}left", "{{{degree}left}}", "$x$ [left]"])
def test_all_other_signs_are_said_as_they_are(words: str):
    words_with_signs = replace(WORDS, zero=words, positive=words)
    assert phrase(np.array([0.0]), [words_with_signs]) == words
    said = words.replace("{degree}", WORDS.degrees[-1][1]).replace("{{", "{").replace("}}", "}")
    assert phrase(np.array([1.0]), [words_with_signs]) == said


@pytest.mark.parametrize("which", ["zero", "negative", "positive"])
def test_a_phrase_is_a_text(which: str):
    with pytest.raises(ValueError, match=r"^phrase None: allowed is a text$"):
        replace(WORDS, **{which: None})


@pytest.mark.parametrize(
    "degrees", [(), ((0.5, "a"), (0.2, "b")), (("a", 0.2),), {"a": 0.2}, (0.2,), None, ((0.2, 1),)]
)
def test_degrees_are_pairs_with_rising_limits(degrees: Any):
    with pytest.raises(ValueError, match=r"^degrees=.*: allowed are pairs \(lower limit, word\) with rising limits"):
        replace(WORDS, degrees=degrees)
