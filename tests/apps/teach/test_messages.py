"""What a page may say, and what becomes of everything else."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ibe_rl.apps.teach.messages import (
    MAX_BYTES,
    BadMessageError,
    CountAs,
    HandOver,
    Message,
    Name,
    Pause,
    Press,
    Release,
    Sit,
    Speed,
    Typed,
    Wrong,
    parse,
)

MEANT: list[tuple[dict[str, Any], Message]] = [
    ({"kind": "press", "sequence": 3, "episode": 2, "value": -1}, Press(3, 2, -1.0)),
    ({"kind": "press", "sequence": 0, "episode": 0, "value": 0.5}, Press(0, 0, 0.5)),
    ({"kind": "release", "sequence": 4, "episode": 2}, Release(4, 2)),
    ({"kind": "pause", "on": True}, Pause(True)),
    ({"kind": "speed", "times": 4}, Speed(4.0)),
    ({"kind": "speed", "times": None}, Speed(None)),
    ({"kind": "oracle", "on": False}, HandOver(False)),
    ({"kind": "sit"}, Sit()),
    ({"kind": "press", "sequence": 3, "episode": 2, "value": "يمين"}, Press(3, 2, "يمين")),
    ({"kind": "wrong", "episode": 2, "step": 30}, Wrong(2, 30)),
    ({"kind": "name", "slot": 1, "word": "links"}, Name(1, "links")),
    ({"kind": "typed", "text": "nach links"}, Typed("nach links")),
    ({"kind": "counts as", "text": "nach links", "slot": 0}, CountAs("nach links", 0)),
]
BAD = [
    ("", "not JSON"),
    ("{", "not JSON"),
    ("[" * 500, "not JSON"),
    ("[]", "no kind"),
    ("null", "no kind"),
    (
        '{"kind": "fly"}',
        "no kind of message; allowed are press, release, pause, speed, oracle, sit, wrong, name, typed, ",
    ),
    ('{"kind": ["press"]}', "no kind"),
    ('{"kind": "pause"}', "a Pause has on in it"),
    ('{"kind": "sit", "on": true}', "a Sit has nothing in it"),
    ('{"kind": "pause", "on": 1}', "on is neither true nor false"),
    ('{"kind": "release", "sequence": -1, "episode": 0}', "sequence is not a count"),
    ('{"kind": "release", "sequence": true, "episode": 0}', "sequence is not a count"),
    ('{"kind": "release", "sequence": 1.0, "episode": 0}', "sequence is not a count"),
    ('{"kind": "release", "sequence": 99999999999999999999, "episode": 0}', "sequence is not a count"),
    ('{"kind": "press", "sequence": 1, "episode": 0, "value": 1.01}', "value is not a number from -1 to 1"),
    ('{"kind": "press", "sequence": 1, "episode": 0, "value": NaN}', "value is not a number"),
    ('{"kind": "name", "slot": 1, "word": 3}', "word is not a text of at most 200 characters"),
    ('{"kind": "name", "slot": 1, "word": "' + "a" * 201 + '"}', "word is not a text of at most 200 characters"),
    ('{"kind": "press", "sequence": 1, "episode": 0, "value": null}', "value is not a number"),
    ('{"kind": "speed", "times": 0}', "times is not a number from 0.05 to 1000"),
    ('{"kind": "speed", "times": Infinity}', "times is not a number"),
    (b'{"kind": "sit"}', f"not a text of at most {MAX_BYTES} characters"),
    ('{"kind": "sit"}' + " " * MAX_BYTES, f"not a text of at most {MAX_BYTES} characters"),
]
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
NAMES = st.sampled_from(["kind", "sequence", "episode", "value", "on", "times", "step", "slot", "word", "text"])
KINDS = st.sampled_from(["press", "release", "pause", "speed", "oracle", "sit", "wrong", "name", "typed", "counts as"])


@pytest.mark.parametrize(("fields", "message"), MEANT)
def test_what_is_meant_is_understood(fields: dict[str, Any], message: Message):
    assert parse(json.dumps(fields)) == message


@pytest.mark.parametrize(("text", "why"), BAD)
def test_everything_else_is_refused_in_one_line(text: str | bytes, why: str):
    with pytest.raises(BadMessageError, match=why) as caught:
        parse(text)
    assert "\n" not in str(caught.value)


def parsed(text: str | bytes) -> Message | None:
    try:
        return parse(text)
    except BadMessageError:
        return None


@pytest.mark.slow
@given(st.text() | st.binary())
def test_no_text_breaks_it(text: str | bytes):
    parsed(text)


@given(st.dictionaries(NAMES, ANYTHING | KINDS, max_size=6))
def test_no_message_breaks_it(fields: dict[str, Any]):
    message = parsed(json.dumps(fields))
    if isinstance(message, Press | Release):
        assert type(message.sequence) is int
        assert message.sequence >= 0
        assert message.episode >= 0
    if isinstance(message, Press):
        assert -1 <= message.value <= 1
    if isinstance(message, Speed):
        assert message.times is None or 0.05 <= message.times <= 1_000
    if isinstance(message, Pause | HandOver):
        assert type(message.on) is bool
