"""Consoles of rich that print the texts of users as they are."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.progress import Task, TextColumn
from rich.text import Text

from ibe_rl.runtime.printed import visible


class PlainConsole(Console):
    """A console without markup and emoji codes: ``[left]`` and ``:smile:`` are printed as they are.

    Args:
        options: of rich's ``Console``.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "emoji": False, "highlight": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        """See ``rich``; control characters are written as escapes."""
        return super().render_str(visible(text), **options)


class PlainColumn(TextColumn):
    """A column of a progress bar without markup, emoji codes and control characters.

    Args:
        text_format: as of rich's ``TextColumn``.
    """

    def __init__(self, text_format: str) -> None:
        super().__init__(text_format, markup=False)

    def render(self, task: Task) -> Text:
        """See ``rich``."""
        return Text(visible(super().render(task).plain))
