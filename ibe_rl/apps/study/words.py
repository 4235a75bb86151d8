"""The words of the pages that belong to no text: on buttons, below a picture, at the end.

texts/LANGUAGE/words.yaml has all of them, KEY: TEXT in each line; the pages know the keys only.
"""

from __future__ import annotations

from typing import Any

from ibe_rl.config.limits import nearest
from ibe_rl.types import ConfigError

WORD_KEYS = (
    # everywhere
    *("progress", "waiting", "next", "optional", "choose", "picture", "play", "watch"),
    # buttons of consent and of the last page; withdrawal
    *("agree", "disagree", "finish", "withdraw", "withdraw_question", "withdraw_yes", "withdraw_no"),
    # the first page, where a person comes in, and why somebody is not let in
    *("begin", "your_code", "refused_full", "refused_id", "refused_begun", "refused_pilot"),
    # headings of pages without a text of their own
    *("heading_demographics", "heading_comprehension", "heading_attention", "heading_scale", "heading_comment"),
    *("comprehension_again", "example", "comment"),
    # trials: what is asked, how to answer, what kind of trial it is, and what really happened
    *("ask_landing", "how_landing", "ask_next_words", "ask_what_if", "ask_which_agent", "first", "second"),
    *("confidence", "confidence_low", "confidence_high", "practice", "transfer"),
    *("happened", "your_answer", "true_answer"),
    # the end
    *("ended_finished", "ended_screened_out", "ended_no_consent", "ended_withdrawn", "ended_unknown"),
    *("completion_code", "go_back"),
)


def read_words(values: Any, source: str) -> dict[str, str]:
    """Read words.yaml.

    Args:
        values: of the file.
        source: its path, for messages.

    Raises:
        ConfigError: naming the file, the key, the value and what is allowed.
    """
    if not isinstance(values, dict):
        raise ConfigError(f"{source}: allowed are words, KEY: TEXT in each line")
    if unknown := [str(key) for key in values if key not in WORD_KEYS]:
        raise ConfigError(f"{source}: {unknown[0]}: allowed are {', '.join(WORD_KEYS)}{nearest(unknown[0], WORD_KEYS)}")
    for key in WORD_KEYS:
        if not isinstance(values.get(key), str) or not values[key].strip():
            raise ConfigError(f"{source}: {key}={values.get(key)}: allowed is a text")
    return dict(values)
