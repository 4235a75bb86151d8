"""A progress bar in the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TimeRemainingColumn

from ibe_rl.runtime.console import PlainColumn, PlainConsole


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a bar of ``total`` steps and yield the function that advances it; hidden without a terminal."""
    console = PlainConsole()
    columns = PlainColumn("{task.description}"), BarColumn(bar_width=30), TimeRemainingColumn(compact=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task(title, total=total)
        yield lambda: progress.advance(bar)
