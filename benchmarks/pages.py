"""The tables of the benchmarks in pages of docs: they stand between two marks that name the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ibe_rl.storage.run_folder import write_atomically


def fill(page: Path, tables: Mapping[str, Sequence[str]], command: str) -> None:
    """Put the lines of each part between its marks in a page; a page that is not there gets the tables only.

    Raises:
        ValueError: if the page has no such marks; it is unchanged then.
    """
    places = "".join(f"{_begin(part, command)}\n{_end(part)}\n" for part in tables)
    text = page.read_text() if page.exists() else places
    for part, lines in tables.items():
        before, begin, rest = text.partition(_begin(part, command))
        _, end, after = rest.partition(_end(part))
        if not end:
            allowed = f"{_begin(part, command)}, and below it {_end(part)}"
            raise ValueError(f"{page}: has no place for the table {part}; allowed is one with {allowed}")
        text = "\n".join([before + begin, "", *lines, "", end + after])
    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(page, lambda stream: stream.write(text.encode()))


def _begin(part: str, command: str) -> str:
    return f"<!-- {part}: python -m {command} -->"


def _end(part: str) -> str:
    return f"<!-- end of {part} -->"
