"""Names with brackets, emoji codes and control characters are printed as they are."""

from __future__ import annotations

import io

import pytest
from rich.progress import Progress
from rich.table import Table

from ibe_rl.runtime.console import PlainColumn, PlainConsole

NAMES = ["going [left]", "[/left]", "[bold]x[/bold]", ":smile:", "[link=http://x]y", "{x}"]


def plain(width: int = 60) -> tuple[PlainConsole, io.StringIO]:
    stream = io.StringIO()
    return PlainConsole(file=stream, width=width), stream


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_printed_as_it_is(name: str) -> None:
    console, stream = plain()
    table = Table(name, title=f"title {name}")
    table.add_row(f"cell {name}")
    console.print(f"line {name}")
    console.print(table)
    with Progress(PlainColumn("{task.description}"), console=console) as progress:
        progress.add_task(f"bar {name}")
    for where in ("line", "title", "cell", "bar"):
        assert f"{where} {name}" in stream.getvalue()


def test_control_characters_are_written_as_escapes() -> None:
    console, stream = plain()
    table = Table("x")
    table.add_row("\x1b[31mred")
    console.print("\x1b[2J", table)
    with Progress(PlainColumn("{task.description}"), console=console) as progress:
        progress.add_task("\x1b]0;title\x07")
    assert "\x1b" not in stream.getvalue()
    for shown in ("\\x1b[31mred", "\\x1b[2J", "\\x1b]0;title"):
        assert shown in stream.getvalue()


def test_a_narrow_terminal_takes_it_too() -> None:
    console, stream = plain(width=20)
    table = Table("what", "value")
    table.add_row("a long [name] of something", "1")
    console.print(table)
    assert "[name]" in stream.getvalue()
