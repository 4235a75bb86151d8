"""Prove that a restructuring changed nothing: the same small seeded runs before and after, compared value by value.

python -m benchmarks.same_numbers record CHECKOUT FOLDER [--only NAME ...]   runs its train.py and explain.py: minutes
python -m benchmarks.same_numbers compare BEFORE AFTER [--only NAME ...]     a table; ends with 1 if anything differs

All it reads are the files that were written and what was printed, so it works with checkouts whose modules have other
names.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.same_facts import Facts, files
from benchmarks.same_runs import ABOUT, CATALOGUE, OUTPUT, record

LONGEST = 100
"""Characters of a value in a table."""
ABSENT = "nothing"
Row = tuple[str, str, list[str]]
"""A run, what of it, and the differences in words."""


def compare(before: Path, after: Path, only: Collection[str] = ()) -> list[Row]:
    """Compare two folders that ``record`` wrote, or ``only`` some of their runs.

    Returns:
        for each run and each kind of file, what differs.

    Raises:
        ValueError: if one is no such folder.
    """
    for name, folder in (("BEFORE", before), ("AFTER", after)):
        if not (folder / ABOUT).is_file():
            raise ValueError(f"{name}={folder}: allowed is a folder that `record` wrote")
    runs = set(only) or {path.name for folder in (before, after) for path in folder.iterdir() if path.is_dir()}
    order = [*CATALOGUE, *sorted(runs - set(CATALOGUE))]
    return [row for run in order if run in runs for row in compare_run(run, files(before, run), files(after, run))]


def compare_run(run: str, before: dict[str, Facts], after: dict[str, Facts]) -> Iterator[Row]:
    """Compare what one run left."""
    kinds: dict[str, list[str]] = {}
    for file in sorted({*before, *after}):
        found = kinds.setdefault(kind(file), [])
        if file in before and file in after:
            found += [f"{file}: {one}" for one in differences(before[file], after[file])]
        else:
            found.append(f"{file}: only {'before' if file in before else 'after'}")
    yield from ((run, what, found) for what, found in kinds.items())


def kind(file: str) -> str:
    """What the table calls a file: the folder that it lies in, or the file itself."""
    if file == OUTPUT:
        return "terminal"
    return file.rpartition("/")[0] or file


def differences(before: Facts, after: Facts) -> Iterator[str]:
    """In words, what is in one and not in the other, or not the same; a value each."""
    for name in dict.fromkeys((*before, *after)):
        old, new = before.get(name, ABSENT), after.get(name, ABSENT)
        if not same(old, new):
            yield f"{name}: {told(old, new)}"


def same(old: Any, new: Any) -> bool:
    """True for the same type and the same bits; NaN is NaN."""
    if isinstance(old, np.ndarray) and isinstance(new, np.ndarray):
        return old.dtype == new.dtype and old.shape == new.shape and old.tobytes() == new.tobytes()
    return type(old) is type(new) and repr(old) == repr(new)


def told(old: Any, new: Any) -> str:
    """A difference in words; of arrays the first place."""
    if not (isinstance(old, np.ndarray) and isinstance(new, np.ndarray)):
        return " → ".join(around(str(old), str(new)))
    if (old.dtype, old.shape) != (new.dtype, new.shape):
        return f"{old.dtype} {old.shape} → {new.dtype} {new.shape}"
    pairs = list(zip(old.ravel().tolist(), new.ravel().tolist(), strict=True))
    places = [place for place, (one, other) in enumerate(pairs) if repr(one) != repr(other)]
    first = tuple(int(index) for index in np.unravel_index(places[0], old.shape)) if places else ()
    words = " → ".join(repr(one) for one in pairs[places[0]]) if places else "other bits of NaN"
    return f"{len(places)} of {old.size} values, first {list(first)}: {words}"


def around(old: str, new: str) -> Iterator[str]:
    """Two texts, of long ones what surrounds the first character that differs."""
    alike = (one == other for one, other in zip(old, new, strict=False))
    first = next((place for place, equal in enumerate(alike) if not equal), min(len(old), len(new)))
    start = max(0, first - LONGEST // 2) if max(len(old), len(new)) > LONGEST else 0
    for said in (old, new):
        part = said[start : start + LONGEST]
        yield f"{'…' * bool(start)}{' '.join(part.split())}{'…' * (start + LONGEST < len(said))}"


def document(rows: list[Row]) -> str:
    """The table in markdown."""
    lines = ["| run | what | equal? | first difference |", "| --- | --- | --- | --- |"]
    for run, what, found in rows:
        result = f"{len(found):,} difference{'s' * (len(found) > 1)}" if found else "equal"
        lines.append(f"| {run} | {what} | {result} | {found[0].replace('|', '/') if found else ''} |")
    return "\n".join(lines)


def make_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.same_numbers", description=__doc__)
    what = parser.add_subparsers(dest="what", required=True)
    recorder = what.add_parser("record", help="run a checkout's scripts")
    recorder.add_argument("checkout", type=Path, metavar="CHECKOUT")
    recorder.add_argument("folder", type=Path, metavar="FOLDER")
    comparer = what.add_parser("compare", help="compare two recorded folders")
    comparer.add_argument("before", type=Path, metavar="BEFORE")
    comparer.add_argument("after", type=Path, metavar="AFTER")
    for one in (recorder, comparer):
        one.add_argument("--only", nargs="+", default=[], metavar="NAME", help=f"{', '.join(CATALOGUE)}; none: all")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Do what the command line asks; returns the exit code."""
    asked = make_parser().parse_args(arguments)
    if asked.what == "record":
        record(asked.checkout, asked.folder, asked.only)
        return 0
    rows = compare(asked.before, asked.after, asked.only)
    sys.stdout.write(document(rows) + "\n")
    return int(any(found for _, _, found in rows))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, ValueError) as error:
        sys.exit(f"error: {error}")
