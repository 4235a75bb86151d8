"""A file of results that goes on where it was stopped, and that several processes may add to."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from ibe_rl.storage.run_folder import read_json, write_json


def kept(results: Path) -> dict[str, Any]:
    """What was found so far, by name; a file that is not there holds nothing."""
    found: dict[str, Any] = read_json(results) if results.exists() else {}
    return found


def forget(results: Path, names: Collection[str]) -> None:
    """Leave out what was found under these names, to be measured again."""
    keep(results, {name: found for name, found in kept(results).items() if name not in names})


def keep(results: Path, found: dict[str, Any]) -> None:
    """Write what was found."""
    results.parent.mkdir(parents=True, exist_ok=True)
    write_json(results, found)


def holds(results: Path, *names: str) -> bool:
    """Whether something was found under these names, each inside the one before."""
    found: Any = kept(results)
    for name in names:
        if name not in found:
            return False
        found = found[name]
    return True


def add(results: Path, value: Any, *names: str) -> None:
    """Add what was found under these names to what the file holds by now."""
    found = inner = kept(results)
    *outer, last = names
    for name in outer:
        inner = inner.setdefault(name, {})
    inner[last] = value
    keep(results, found)
