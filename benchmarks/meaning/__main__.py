"""Is a vocabulary ever reversed without a warning? Situations with a truth known by hand, several seeds each.

python -m benchmarks.meaning [--seeds 5] [--only NAME...] [--cache DIR]

Prints a Markdown table. DIR keeps the episodes between two runs; it may be deleted at any time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # two processes share the cores

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.meaning.running import run_all
from benchmarks.meaning.situations import situations
from benchmarks.meaning.table import as_markdown


def main(arguments: Sequence[str] | None = None) -> str:
    """Run what the command line asks for; returns the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.meaning")
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0 on")
    parser.add_argument("--only", nargs="+", choices=sorted(situations()), help="situations", metavar="NAME")
    parser.add_argument("--cache", type=Path, help="folder that keeps the episodes")
    chosen = parser.parse_args(arguments)
    names = chosen.only or list(situations())
    cases = [(name, seed) for name in names for seed in range(chosen.seeds)]
    verdicts = run_all(cases, chosen.cache)
    by_name = {name: [v for (of, _), v in zip(cases, verdicts, strict=True) if of == name] for name in names}
    return as_markdown({name: situations()[name].truth for name in names}, by_name)


if __name__ == "__main__":
    print(main())  # noqa: T201 - talks to a person
