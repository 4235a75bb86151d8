"""Questions are data, and a mistake in a file is named."""

from __future__ import annotations

from typing import Any

import pytest

from ibe_rl.apps.study.questions import Question, read_questions
from ibe_rl.types import ConfigError


def test_options_are_shared_or_a_question_s_own() -> None:
    read = read_questions(
        {"options": [1, 2, 3], "questions": ["a", {"text": "b", "options": ["x", "y"], "right": 1}]}, "scale.yaml"
    )
    assert read == [Question("a", ("1", "2", "3")), Question("b", ("x", "y"), right=1)]


@pytest.mark.parametrize(
    ("question", "fits", "fits_not"),
    [
        (Question("", ("a", "b")), [0, 1], [2, -1, None, "a", True, 0.0]),
        (Question("", ("a", "b"), optional=True), [None, 0], [2]),
        (Question("", optional=False), ["", "words"], [None, 3, "x" * 2001]),
    ],
)
def test_what_is_an_answer(question: Question, fits: list[Any], fits_not: list[Any]) -> None:
    assert all(map(question.takes, fits))
    assert not any(map(question.takes, fits_not))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (None, "allowed is a list `questions`"),
        ({"questions": "one"}, "allowed is a list `questions`"),
        ({"questions": [], "optins": []}, "optins: allowed are .*did you mean options"),
        ({"questions": [{"txt": "a"}]}, "question 1: txt: allowed are text.*did you mean text"),
        ({"questions": ["a", 3]}, "question 2: text=None: allowed is a text"),
        ({"questions": [{"text": " "}]}, "question 1: text= : allowed is a text"),
        ({"questions": [{"text": "a", "options": ["one"]}]}, "options=.*allowed are 2 to 101 options"),
        ({"questions": [{"text": "a", "options": "ab"}]}, "options=ab: allowed are 2 to 101 options"),
        ({"questions": [{"text": "a", "options": ["x", "y"], "right": 2}]}, "right=2: .*0 to 1"),
        ({"questions": [{"text": "a", "options": ["x", "y"], "right": "x"}]}, "right=x: allowed is the place"),
        ({"questions": [{"text": "a", "reversed": "yes"}]}, "reversed=yes: allowed is true or false"),
    ],
)
def test_what_is_wrong_is_named(values: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^scale.yaml: .*{message}"):
        read_questions(values, "scale.yaml")
