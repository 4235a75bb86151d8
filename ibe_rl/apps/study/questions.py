"""Questions as data: the comprehension check, demographics and scales, each a YAML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ibe_rl.config.limits import nearest
from ibe_rl.types import ConfigError

MOST_OPTIONS, MOST_CHARACTERS = 101, 2_000


@dataclass(frozen=True)
class Question:
    """Something that is asked.

    Attributes:
        text: of it.
        options: to choose from; empty: a text is written.
        right: index of the right option; None where no option is right.
        optional: may be left out.
        reversed: of a scale's item, the first option is the highest.
    """

    text: str
    options: tuple[str, ...] = ()
    right: int | None = None
    optional: bool = False
    reversed: bool = False

    def takes(self, answer: Any) -> bool:
        """Whether this is an answer to it: the index of an option, a text, or None where it is optional."""
        if answer is None:
            return self.optional
        if self.options:
            return type(answer) is int and 0 <= answer < len(self.options)
        return isinstance(answer, str) and len(answer) <= MOST_CHARACTERS


KEYS = {name: one.type for name, one in Question.__dataclass_fields__.items()}


def read_questions(values: Any, source: str) -> list[Question]:
    """Read a file of questions: a list ``questions``, and ``options`` for those that have none of their own.

    Args:
        values: of the file; ``lead`` is shown above its questions; ``title``, ``source`` and ``terms`` may say where
            they come from.
        source: path of the file, for messages.

    Raises:
        ConfigError: naming the file, the question, the value and what is allowed.
    """
    known = ("questions", "options", "title", "lead", "source", "terms", "optional")
    if not isinstance(values, dict) or not isinstance(values.get("questions"), list):
        raise ConfigError(f"{source}: allowed is a list `questions`, and {', '.join(known[1:])}")
    if not isinstance(values.get("lead", ""), str):
        raise ConfigError(f"{source}: lead={values['lead']}: allowed is a text")
    if unknown := [str(name) for name in values if name not in known]:
        raise ConfigError(f"{source}: {unknown[0]}: allowed are {', '.join(known)}{nearest(unknown[0], known)}")
    shared = {"options": values.get("options", []), "optional": values.get("optional", False)}
    return [_question(one, shared, f"{source}: question {at}") for at, one in enumerate(values["questions"], start=1)]


def _question(given: Any, shared: dict[str, Any], where: str) -> Question:
    one = {**shared, **({"text": given} if isinstance(given, str) else given if isinstance(given, dict) else {})}
    if unknown := [str(name) for name in one if name not in KEYS]:
        raise ConfigError(f"{where}: {unknown[0]}: allowed are {', '.join(KEYS)}{nearest(unknown[0], list(KEYS))}")
    if not isinstance(one.get("text"), str) or not one["text"].strip():
        raise ConfigError(f"{where}: text={one.get('text')}: allowed is a text")
    options = one["options"]
    if (
        not isinstance(options, Sequence)
        or isinstance(options, str)
        or len(options) == 1
        or len(options) > MOST_OPTIONS
    ):
        raise ConfigError(f"{where}: options={options}: allowed are 2 to {MOST_OPTIONS} options, or none for a text")
    right = one.get("right")
    if right is not None and not (type(right) is int and 0 <= right < len(options)):
        raise ConfigError(f"{where}: right={right}: allowed is the place of an option, 0 to {len(options) - 1}")
    for name in ("optional", "reversed"):
        if type(one.get(name, False)) is not bool:
            raise ConfigError(f"{where}: {name}={one[name]}: allowed is true or false")
    return Question(**{**one, "options": tuple(map(str, options))})
