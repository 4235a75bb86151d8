"""What the files of a recorded run hold, as facts that ``benchmarks.same_numbers`` can compare one by one."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from PIL import Image
from rerun.chunk import RrdReader

from benchmarks.same_runs import ABOUT, OUTPUT

LOG = "output.log"
"""What a run of a sweep printed."""
Facts = dict[str, Any]
"""Of a file: what each value is called, to the value: a plain one or an array."""

VARYING = {
    r"metrics\.csv: .* time/.*": "seconds",
    r"summary\.json: (wall_s|frames_per_s|time_s/.*)": "seconds",
    r"summary\.json: versions/.*": "of what is installed",
    r"checkpoints/.*\.pt: counts/(wall_s|times_s/.*)": "seconds",
    r"checkpoints/.*\.pt: recorder/recorder/id": "drawn anew for each recording",
    r"checkpoints/.*\.pt: recorder/(recorder/bytes|thinning/.*)": "bytes: rerun cuts and packs its chunks by the clock",
    r"checkpoints/.*\.pt: random/(python/1/.*|numpy/1)": "generators that are neither seeded nor drawn from",
    r".*\.rrd: /viewport ViewportBlueprint:root_container .*": "the identity of a panel, as bytes",
    r".*\.rrd: /__properties RecordingInfo:start_time .*": "a time of day",
}
"""Facts that differ between two runs of the same code, ``file: name`` as an expression, and why."""

STORAGE = re.compile(r"(.*/_storage)/_storage/[^/]*")
"""Columns of a replay buffer in a checkpoint. What lies behind its filled part is whatever the memory held before."""

VARYING_LINES = {
    r"frames/s": "speed",
    r"│ (wall_s|frames_per_s|time: \w+) ": "seconds",
}
"""Lines of the terminal, likewise."""

FRAMED = re.compile(r"^(?=[┏┃┡│└])|^ +the run in numbers$")
PADDING = re.compile(r"([ ━─])\1+")
"""In tables with a frame it grows with the longest of their times."""

TIME_OF_DAY = "log_time"
"""The timeline of layouts; those of runs have none."""

PROGRAM = re.compile(r"(?<!\S)\S*?bin/(?=(python|rerun)\b)")
"""The folder of a program, as hints on the terminal have it."""
IDENTITY = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""Drawn anew for each panel of a layout."""


def files(folder: Path, run: str) -> dict[str, Facts]:
    """What a run of a recorded folder left, by file; without what varies.

    Args:
        folder: as ``benchmarks.same_runs.record`` wrote it.
        run: the name of one of its runs.
    """
    about = json.loads((folder / ABOUT).read_text())
    places = {about["folder"]: "FOLDER", about["checkout"]: "CHECKOUT"}
    root = folder / run
    found = {path.relative_to(root).as_posix(): path for path in sorted(root.rglob("*")) if path.is_file()}
    return {name: constant(name, reader(path)(path, places)) for name, path in found.items()}


def constant(file: str, facts: Facts) -> Facts:
    """Facts without those that vary."""
    varies = re.compile("|".join(f"(?:{one})" for one in VARYING))
    within = re.sub(r"^.*/(?=(metrics\.csv|summary\.json|checkpoints/))", "", file)
    return {name: value for name, value in facts.items() if not varies.fullmatch(f"{within}: {name}")}


Reader = Callable[[Path, dict[str, str]], Facts]


def reader(path: Path) -> Reader:
    """How to read a file, by its name."""
    named = {".csv": table, ".json": plain, ".yaml": plain, ".npy": array, ".npz": arrays, ".png": picture}
    named |= {".pt": checkpoint, ".rrd": recording}
    return printed if path.name in (OUTPUT, LOG) else named.get(path.suffix, text)


def table(path: Path, places: dict[str, str]) -> Facts:
    """Each cell of a table."""
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {
        f"row {number} {column}": tidy(str(cell), places)
        for number, row in enumerate(rows)
        for column, cell in row.items()
    }


def plain(path: Path, places: dict[str, str]) -> Facts:
    """Each value of JSON or YAML."""
    said = tidy(path.read_text(), places)
    return dict(leaves(json.loads(said) if path.suffix == ".json" else yaml.safe_load(said)))


def array(path: Path, _: dict[str, str]) -> Facts:
    """An array."""
    return {"array": np.load(path, allow_pickle=False)}


def arrays(path: Path, _: dict[str, str]) -> Facts:
    """Several arrays."""
    with np.load(path, allow_pickle=False) as found:
        return dict(found)


def picture(path: Path, _: dict[str, str]) -> Facts:
    """The pixels of a picture."""
    with Image.open(path) as image:
        return {"pixels": np.asarray(image)}


def checkpoint(path: Path, places: dict[str, str]) -> Facts:
    """Each tensor and each plain value of a state."""
    found = dict(leaves(torch.load(path, weights_only=True)))
    for name, value in found.items():
        if isinstance(value, str):
            found[name] = tidy(value, places)
        elif storage := STORAGE.fullmatch(name):
            found[name] = value[: found[f"{storage[1]}/_len"]]
    return found


def recording(path: Path, places: dict[str, str]) -> Facts:
    """Each value of each component of each entity, with its times; of the layout too."""
    source, facts = RrdReader(str(path)), Facts()
    for store in (*source.recordings(), *source.blueprints()):
        rows = sorted(stored(source.stream(store=store)), key=lambda row: row[0])
        identities: dict[str, str] = {}
        counts: dict[str, int] = {}
        for _, entity, times, values in rows:
            for component, value in values.items():
                key = renamed(f"{entity} {component}", identities)
                counts[key] = number = counts.get(key, -1) + 1
                facts[f"{key} {number}"] = renamed(tidy(repr((times, value)), places), identities)
    return facts


def stored(chunks: Any) -> Iterator[tuple[bytes, str, dict[str, Any], dict[str, Any]]]:
    """Rows of chunks: an identity that grows with time, the entity, its times, and the values of its components."""
    for chunk in chunks:
        whole = chunk.to_record_batch()
        batch = whole.select([name for name in whole.schema.names if name != TIME_OF_DAY])
        kinds = {field.name: (field.metadata or {}).get(b"rerun:kind") for field in batch.schema}
        for row in batch.to_pylist():
            given = {name: value for name, value in row.items() if value is not None}
            times, values = ({name: given[name] for name in given if kinds[name] == of} for of in (b"index", b"data"))
            yield row["rerun.controls.RowId"], str(chunk.entity_path), times, values


def renamed(said: str, identities: dict[str, str]) -> str:
    """Text with random identities numbered by when they first appear."""
    return IDENTITY.sub(lambda found: identities.setdefault(found[0], f"id{len(identities)}"), said)


def printed(path: Path, places: dict[str, str]) -> Facts:
    """Each line that a terminal showed."""
    varies = re.compile("|".join(VARYING_LINES))
    lines = [line.rstrip() for line in tidy(path.read_text(), places).splitlines() if not varies.search(line)]
    unframed = (PADDING.sub(r"\1", line) if FRAMED.match(line) else line for line in lines)
    return {f"line {number}": line for number, line in enumerate(unframed)}


def text(path: Path, places: dict[str, str]) -> Facts:
    """Each line of any other file; bytes that are no text count too."""
    lines = tidy(path.read_bytes().decode(errors="backslashreplace"), places).splitlines()
    return {f"line {number}": line for number, line in enumerate(lines)}


def tidy(said: str, places: dict[str, str]) -> str:
    """Text without what only tells where and when it was made."""
    for place in sorted(places, key=len, reverse=True):
        said = said.replace(place, places[place])
    return PROGRAM.sub("", said)


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The values in dicts, lists and tuples of any depth, by where they are; tensors as arrays."""
    below = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else None
    if below is None:
        yield name, value.numpy() if isinstance(value, torch.Tensor) else value
    elif not value:
        yield name, repr(value)
    else:
        for key, one in below:
            yield from leaves(one, f"{name}/{key}" if name else str(key))
