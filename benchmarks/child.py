"""Run a measurement in a process of its own, with one thread: nothing is left over from the one before.

python -m benchmarks.child frames.bare '{"seconds": 5}'      calls the function and prints what it returns
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.plan import ROOT

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS", "NUMEXPR", "VECLIB_MAXIMUM")}
MARK = "measured: "


def measure(function: str, **arguments: Any) -> Any:
    """Call ``module.function`` of this package in a new process.

    Args:
        function: such as ``frames.bare``.
        **arguments: of the function; what JSON can hold.

    Returns:
        What the function returned, by way of JSON.

    Raises:
        RuntimeError: if the process failed.
    """
    output = run([sys.executable, "-m", "benchmarks.child", function, json.dumps(arguments)])
    return json.loads(output.rsplit(MARK, 1)[1])


def run(command: list[str], place: Path = ROOT) -> str:
    """Run a command in the repository, or another place, with one thread a process; returns what it printed.

    Raises:
        RuntimeError: if it failed, with the end of what it printed.
    """
    environment = os.environ | ONE_THREAD
    ended = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True)  # noqa: S603 - our own
    if ended.returncode:
        said = (ended.stdout + ended.stderr)[-2000:]
        raise RuntimeError(f"{' '.join(command[1:])} ended with {ended.returncode}:\n{said}")
    return ended.stdout


def main() -> None:
    """Call what the command line names, and print its result behind whatever it printed itself."""
    module, function = sys.argv[1].split(".")
    result = getattr(importlib.import_module(f"benchmarks.{module}"), function)(**json.loads(sys.argv[2]))
    sys.stdout.write(f"\n{MARK}{json.dumps(result)}\n")


if __name__ == "__main__":
    main()
