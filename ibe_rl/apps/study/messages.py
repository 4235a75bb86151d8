"""What a page may send: parsed and limited before anything is done with it."""

from __future__ import annotations

import json
import math
from typing import Any

from ibe_rl.apps.study.answers import Answer
from ibe_rl.apps.study.questions import MOST_CHARACTERS, Question
from ibe_rl.apps.study.schedule import ATTENTION, COMMENT, CONSENT, SCALE, TRIAL, Page
from ibe_rl.apps.study.settings import LANDING

MAX_ANSWER_BYTES = 64 * 1024
MOST_MS = 7 * 24 * 3600 * 1000


class BadAnswerError(ValueError):
    """Not an answer to the page that was shown; the message says why."""


def parse_answer(body: bytes | str) -> Answer:
    """Read the message of a page.

    Raises:
        BadAnswerError: if it is no answer.
    """
    if len(body) > MAX_ANSWER_BYTES:
        raise BadAnswerError(f"longer than {MAX_ANSWER_BYTES} bytes")
    try:
        given = json.loads(body, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise BadAnswerError("no JSON") from None
    if not isinstance(given, dict) or given.keys() != {"page", "attempt", "value", "took_ms", "hidden_ms"}:
        raise BadAnswerError("allowed are page, attempt, value, took_ms and hidden_ms")
    if not isinstance(given["page"], str) or not isinstance(given["value"], dict):
        raise BadAnswerError("page is a text, value an object")
    for name, most in (("attempt", 100), ("took_ms", MOST_MS), ("hidden_ms", MOST_MS)):
        if type(given[name]) is not int or not 0 <= given[name] <= most:
            raise BadAnswerError(f"{name} is a whole number from 0 to {most}")
    return Answer(**given)


def _no_number(name: str) -> float:
    raise ValueError(name)


def check_answer(page: Page, value: dict[str, Any], questions: list[Question], task: str, confidence: bool) -> None:
    """Refuse a value that does not answer a page.

    Args:
        page: that was shown.
        value: what was answered.
        questions: of the page; empty for one without.
        task: of the trials.
        confidence: whether a trial asks for it.

    Raises:
        BadAnswerError: naming the field and what is allowed.
    """
    fields = _fields(page, questions, task, confidence)
    if value.keys() != fields.keys():
        raise BadAnswerError(f"allowed are {', '.join(fields) or 'no fields'}")
    for name, fits in fields.items():
        if not fits(value[name]):
            raise BadAnswerError(f"{name} does not fit")


def _fields(page: Page, questions: list[Question], task: str, confidence: bool) -> dict[str, Any]:
    if page.kind == CONSENT:
        return {"agrees": lambda given: type(given) is bool}
    if page.kind == COMMENT:
        return {"text": lambda given: isinstance(given, str) and len(given) <= MOST_CHARACTERS}
    if page.kind == TRIAL:
        asked = {"at": lambda given: _number(given, 1.0)} if task == LANDING else {"choice": questions[0].takes}
        return asked | ({"confidence": lambda given: _number(given, 100.0)} if confidence else {})
    if page.kind == ATTENTION:
        return {"choice": questions[0].takes}
    if questions or page.kind == SCALE:
        return {"choices": lambda given: _choices(given, questions)}
    return {}


def _number(given: Any, most: float) -> bool:
    return type(given) in (int, float) and math.isfinite(given) and 0 <= given <= most


def _choices(given: Any, questions: list[Question]) -> bool:
    return (
        isinstance(given, list)
        and len(given) == len(questions)
        and all(question.takes(one) for question, one in zip(questions, given, strict=True))
    )
