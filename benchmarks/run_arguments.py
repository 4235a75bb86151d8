"""The arguments that several benchmarks have: where they write to, tiny ones, finished runs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from ibe_rl.storage.run_folder import SUMMARY


def finished_runs(module: str, about: str, arguments: Sequence[str] | None) -> argparse.Namespace:
    """``runs``, ``report``, ``quick`` and ``output``, or an error that names what is allowed.

    Args:
        module: of the benchmark.
        about: what it does, for ``--help``.
        arguments: None: those of the command line.

    Raises:
        SystemExit: if they do not fit, or a run is given twice or not finished.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=about)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="finished runs with their logs")
    parser.add_argument("--report", action="store_true", help="measure nothing, only put together what is there")
    asked = with_output(parser, arguments)
    if len({run.resolve() for run in asked.runs}) < len(asked.runs):
        parser.error(f"RUN={' '.join(map(str, asked.runs))}: allowed is each run once")
    for run in asked.runs:
        if not (run / SUMMARY).is_file():
            parser.error(f"RUN={run}: allowed is the folder of a finished run (it has no {SUMMARY})")
    return asked


def with_output(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> argparse.Namespace:
    """Parse, with ``quick`` and ``output`` beside the parser's own arguments.

    Args:
        parser: of the benchmark.
        arguments: None: those of the command line.

    Raises:
        SystemExit: if they do not fit; tiny figures are never written into the repository.
    """
    parser.add_argument("--quick", action="store_true", help="tiny: does everything still work?")
    parser.add_argument("--output", type=Path, help="a folder for all that is written, instead of the repository's")
    asked = parser.parse_args(arguments)
    if asked.quick and not asked.output:
        parser.error("--quick: allowed with --output=FOLDER, its figures mean nothing")
    return asked
