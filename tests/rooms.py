"""The rooms of the package, from the bottom up: the one table for the layers test and CONTRIBUTING's picture.

python tests/rooms.py      prints the picture
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "ibe_rl"
ROOMS = (
    *("types", "task", "runtime", "storage", "config", "envs", "instructors", "agents", "collect"),
    *("ibe", "metrics", "predict", "explain", "vocabulary", "view", "training", "evaluation", "api", "apps"),
)
"""A room imports only rooms that stand before it."""
LOOSE = ("types", "viewer")
"""Modules that lie in the package itself, beside ``__init__`` and ``__main__``."""


def path_of(room: str) -> Path:
    """The file whose docstring says what a room is for."""
    package = PACKAGE / room / "__init__.py"
    return package if package.exists() else PACKAGE / f"{room}.py"


def purpose(room: str) -> str:
    """The first line of a room's docstring."""
    text = ast.get_docstring(ast.parse(path_of(room).read_text())) or ""
    return text.partition("\n")[0].rstrip(".")


def picture() -> str:
    """The rooms with their purposes, the highest first, as CONTRIBUTING shows them."""
    return "\n".join(f"    {room:<12} {purpose(room)}" for room in reversed(ROOMS))


if __name__ == "__main__":
    print(picture())  # noqa: T201 - talks to a person
