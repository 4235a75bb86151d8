"""results.json: one record a figure; running a part again replaces that part's records only."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ibe_rl.runtime.operating_system import processor_name, usable_cores
from ibe_rl.storage.run_folder import write_atomically

PACKAGES = ("ibe_rl", "torch", "torchrl", "tensordict", "gymnasium", "Box2D", "numpy", "scikit-learn", "rerun-sdk")
OTHERS = ("stable_baselines3",)
Record = dict[str, Any]


def stamp(part: str, figures: Sequence[Mapping[str, Any]]) -> list[Record]:
    """Add to each figure its part, the date, the versions and the machine."""
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    about = {"date": date, "versions": versions(), "machine": machine()}
    return [{"part": part, **figure, **about} for figure in figures]


def replace_part(old: Sequence[Record], part: str, new: Sequence[Record], order: Sequence[str]) -> list[Record]:
    """Put the new records of a part in the place of its old ones.

    Args:
        old: records of all parts; the other parts' stay as they are.
        part: the one that was run.
        new: its records.
        order: of the parts in the result.
    """
    kept = [record for record in old if record["part"] != part]
    return sorted([*kept, *new], key=lambda record: order.index(record["part"]))  # stable: within a part as they were


def load(path: Path) -> list[Record]:
    """Read a list of records; a file that is not there has none.

    Raises:
        ValueError: if the file is not such a list.
    """
    if not path.exists():
        return []
    records = json.loads(path.read_text())
    if not (isinstance(records, list) and all("part" in record for record in records)):
        raise ValueError(f"{path}: not a list of records with a part; allowed is what this program wrote")
    return records


def save(path: Path, records: Sequence[Record]) -> None:
    """Write a list of records in one go, one a line so that a change shows as what it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ",\n".join(json.dumps(record, allow_nan=False) for record in records)
    write_atomically(path, lambda stream: stream.write(f"[\n{lines}\n]\n".encode()))


def versions() -> dict[str, str]:
    """Of Python and of the packages that decide the figures."""
    found = {"python": platform.python_version()}
    for name in (*PACKAGES, *OTHERS):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue  # not every part needs every package
    return found


def machine() -> dict[str, Any]:
    """The processor, how many of its cores can be used, and the memory; nothing that names the machine."""
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return {"processor": processor_name(), "cores": usable_cores(), "memory_gb": round(gigabytes, 1)}
