"""What a page may send."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ibe_rl.apps.study.messages import MAX_ANSWER_BYTES, BadAnswerError, parse_answer

WHOLE = {"page": "trial/1/1", "attempt": 1, "value": {"at": 0.5}, "took_ms": 1200, "hidden_ms": 0}


def test_an_answer_is_read() -> None:
    answer = parse_answer(json.dumps(WHOLE))
    assert (answer.page, answer.attempt, answer.value, answer.took_ms) == ("trial/1/1", 1, {"at": 0.5}, 1200)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"more": 1}, "allowed are page"),
        ({"page": 3}, "page is a text"),
        ({"value": [1]}, "value an object"),
        ({"attempt": True}, "attempt is a whole number"),
        ({"attempt": 101}, "attempt is a whole number"),
        ({"took_ms": -1}, "took_ms is a whole number"),
        ({"hidden_ms": 0.5}, "hidden_ms is a whole number"),
        ({"value": {"at": float("nan")}}, "no JSON"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BadAnswerError, match=message):
        parse_answer(json.dumps({**WHOLE, **changes}))


@pytest.mark.parametrize("body", ["", "{", "[]", "null", "[" * 50_000, " " * (MAX_ANSWER_BYTES + 1), b"\xff\xfe\x00"])
def test_no_message_at_all(body: str | bytes) -> None:
    with pytest.raises(BadAnswerError):
        parse_answer(body)


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists) | st.binary())
def test_nothing_else_is_raised(content: Any) -> None:
    body = content if isinstance(content, bytes) else json.dumps(content)
    with pytest.raises(BadAnswerError):
        parse_answer(body)
