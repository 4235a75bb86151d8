"""The words of a run: its file, and what the agent notices about them.

``Task.words`` (also ``ExplainerState.words`` and ``Run.task.words``) is the one object of a run that is shared by all
who speak. A page adds and renames there, and calls ``save_words``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ibe_rl.storage.run_folder import WORD_LIST, read_json, write_atomically
from ibe_rl.task import Task
from ibe_rl.task.words import Words
from ibe_rl.types import ConfigError

MEANS_SAME, MEANS_NOTHING, MEANS_OTHER = "same", "nothing", "changed"
"""Kinds of notices: two words mean the same, one means nothing yet, one has changed its meaning."""


@dataclass(frozen=True)
class WordNotice:
    """What the agent has noticed about words at a refresh.

    Attributes:
        kind: ``MEANS_SAME``, ``MEANS_NOTHING`` or ``MEANS_OTHER``.
        slots: of the words it is about.
        text: one sentence to the instructor, "you use 'left' and 'west' alike".
    """

    kind: str
    slots: tuple[int, ...]
    text: str

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {"kind": self.kind, "slots": list(self.slots), "text": self.text}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> WordNotice:
        """The inverse of ``to_dict``; raises KeyError, TypeError or ValueError if a value is missing."""
        return cls(str(values["kind"]), tuple(map(int, values["slots"])), str(values["text"]))


def save_words(folder: Path, words: Words) -> Path:
    """Write ``words.json`` of a run; returns its path."""
    path = folder / WORD_LIST
    text = json.dumps(words.to_dicts(), ensure_ascii=False, indent=1)
    write_atomically(path, lambda stream: stream.write(text.encode()))
    return path


def take_up_words(folder: Path, task: Task) -> None:
    """Let the words of a task be those that a run has by now, where its folder holds any.

    Raises:
        ConfigError: if the file is damaged.
    """
    kept = None if task.words is None else words_of(folder, len(task.words))
    if task.words is not None and kept is not None:
        task.words.become(kept)


def words_of(folder: Path, slots: int | None = None) -> Words | None:
    """The words of the run in ``folder`` with their present names; None if it has none.

    Args:
        folder: of the run.
        slots: size of its instructions; None: as many as there are words.

    Raises:
        ConfigError: if the file is damaged.
    """
    path = folder / WORD_LIST
    if not path.exists():
        return None
    try:
        return Words.from_dicts(read_json(path), slots)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not the words of a run ({error})") from None
