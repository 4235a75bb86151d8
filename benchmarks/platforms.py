"""Are there wheels of all dependencies for each system and each Python that is supported? ``make platforms``.

uv resolves for a system and a Python that are not here. pip can ask for their wheels too, but takes the conditions of
this machine, such as ``python_version >= "3.12"``, for theirs.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from itertools import product

from benchmarks.plan import ROOT

SYSTEMS = {"Linux, x86-64": "x86_64-manylinux_2_28", "macOS 14, Apple silicon": "aarch64-apple-darwin"}
VERSIONS = ("3.11", "3.12", "3.13")
PINS = "constraints.txt"
PURE = "antlr4-python3-runtime"
"""Comes as source only, of pure Python; hydra needs it."""
WITH_TORCH = ("nvidia-", "cuda-", "triton")
"""Pinned by torch itself, on Linux."""


def main() -> int:
    """Print a line for each system and Python; returns 1 if one of them lacks something."""
    with tempfile.TemporaryDirectory() as wheels:
        pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", wheels, "-c", PINS, PURE]
        subprocess.run(pip, cwd=ROOT, check=True)  # noqa: S603 - our own
        lines = [check(system, version, wheels) for system, version in product(SYSTEMS, VERSIONS)]
    sys.stdout.write("\n".join(lines) + "\n")
    return any("wheels, all pinned" not in line for line in lines)


def check(system: str, version: str, wheels: str) -> str:
    """What there is for a system and a Python, in one line.

    Args:
        system: of ``SYSTEMS``.
        version: of Python.
        wheels: folder with a wheel of ``PURE``.
    """
    uv = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate", "--all-extras"]
    target = ["--python-platform", SYSTEMS[system], "--python-version", version]
    command = [*uv, "-c", PINS, "--find-links", wheels, "--only-binary", ":all:", *target, "pyproject.toml"]
    environment = os.environ | {"MACOSX_DEPLOYMENT_TARGET": "14.0"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    if done.returncode:
        return f"{system}, Python {version}: {' '.join(done.stderr.split())}"
    loose = unpinned(done.stdout, (ROOT / PINS).read_text())
    pinned = f"without a pin: {', '.join(loose)}" if loose else "all pinned"
    return f"{system}, Python {version}: {len(done.stdout.splitlines())} wheels, {pinned}"


def unpinned(resolved: str, pins: str) -> list[str]:
    """Which of the resolved packages have no pin; names differ in case, ``-`` and ``_``."""
    known = {plain(line) for line in pins.splitlines()}
    return [line for line in resolved.splitlines() if plain(line) not in known and not line.startswith(WITH_TORCH)]


def plain(pin: str) -> str:
    """A pin as it is compared."""
    return re.sub(r"[-_.]+", "-", pin.partition("==")[0]).lower() + "==" + pin.partition("==")[2]


if __name__ == "__main__":
    sys.exit(main())
