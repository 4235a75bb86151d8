"""All words that the pages use are in words.yaml."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

import pytest

from ibe_rl.apps.study import words
from ibe_rl.apps.study.words import WORD_KEYS, read_words
from ibe_rl.types import ConfigError

WHOLE: dict[Any, Any] = dict.fromkeys(WORD_KEYS, "a word")
IN_SERVER = {"refused_full", "refused_id", "refused_begun", "refused_pilot"}


def test_the_words_are_read() -> None:
    assert read_words(WHOLE, "words.yaml") == WHOLE


def test_no_key_is_listed_twice() -> None:
    assert len(set(WORD_KEYS)) == len(WORD_KEYS)


def test_every_key_is_used_and_every_used_key_is_listed() -> None:
    folder = files(words.__package__)
    scripts = "".join(folder.joinpath(name).read_text() for name in ("page.js", "trial.js"))
    used = set(re.findall(r'"([a-z]+(?:_[a-z]+)*)"', scripts)) | IN_SERVER
    made = {key for key in WORD_KEYS if key.startswith(("ended_", "heading_"))}  # put together in the pages
    assert set(WORD_KEYS) - made - set(re.findall(r"about\.words\.(\w+)", scripts)) <= used
    said = set(re.findall(r'say\("(\w+)"\)', scripts))
    assert said <= set(WORD_KEYS)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (None, "allowed are words"),
        ({**WHOLE, "nxt": "Next"}, "nxt: allowed are progress.*did you mean next"),
        ({**WHOLE, "next": ""}, "next=: allowed is a text"),
        ({**WHOLE, "next": True}, "next=True: allowed is a text"),
        (dict.fromkeys(WORD_KEYS[1:], "x"), f"{WORD_KEYS[0]}=None: allowed is a text"),
    ],
)
def test_what_is_wrong_is_named(values: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^words.yaml: .*{message}"):
        read_words(values, "words.yaml")
