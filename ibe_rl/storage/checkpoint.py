"""Checkpoints on disk; loading one runs no code from the file."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
import torch

from ibe_rl.storage.run_folder import CHECKPOINTS, write_atomically
from ibe_rl.types import ConfigError

LATEST, BEST = "latest.pt", "best.pt"
EVALUATED, BETWEEN, PREDICTOR = "policy", "between", "predictor"
"""File prefixes: policies saved at an evaluation or between two, and predictors saved at a refresh."""


def save_policy(folder: Path, frames: int, state: dict[str, Any], kind: str = EVALUATED) -> Path:
    """Save the weights of the greedy policy or of a predictor."""
    path = folder / f"{kind}_{frames:012d}.pt"
    write_atomically(path, lambda stream: torch.save(state, stream))
    return path


def save_state(run_folder: Path, state: dict[str, Any]) -> None:
    """Atomically replace the state of a run by the current one; that of the best evaluation is kept."""
    folder = run_folder / CHECKPOINTS
    write_atomically(folder / LATEST, lambda stream: torch.save(state, stream))
    if state["frames"] == state["counts"]["best_frames"]:
        link(folder, LATEST, BEST)


def as_tensors(values: Any) -> Any:
    """Convert arrays to tensors in nested dicts, lists and tuples."""
    return _each(values, np.ndarray, torch.from_numpy)


def as_arrays(values: Any) -> Any:
    """The inverse of ``as_tensors``."""
    return _each(values, torch.Tensor, torch.Tensor.numpy)


def _each(values: Any, kind: type, convert: Callable[[Any], Any]) -> Any:
    if isinstance(values, kind):
        return convert(values)
    if isinstance(values, dict):
        return {name: _each(value, kind, convert) for name, value in values.items()}
    if isinstance(values, list | tuple):
        return type(values)(_each(value, kind, convert) for value in values)
    return values


def link(folder: Path, name: str, also: str) -> None:
    """Hard-link a state under another name; safe because states are replaced and never written to."""
    temporary = folder / f"{also}.partial"
    temporary.unlink(missing_ok=True)
    os.link(folder / name, temporary)
    temporary.replace(folder / also)


def policies(folder: Path, *kinds: str) -> dict[int, Path]:
    """Frames to weight files, in rising order; by default the policies of the evaluations."""
    named = re.compile(rf"(?:{'|'.join(kinds or (EVALUATED,))})_(\d+)\.pt")
    found = {int(match[1]): path for path in folder.glob("*.pt") if (match := named.match(path.name))}
    return dict(sorted(found.items()))


def load(path: Path) -> Any:
    """Load a checkpoint of tensors and plain values.

    Raises:
        ConfigError: if the file is missing, damaged, or would have to run code.
    """
    try:
        _check_whole(path)
        # mmap: torch reads no further than the end of the file, whatever sizes it declares
        return deepcopy(torch.load(path, weights_only=True, mmap=True))  # a copy, as the file may change
    except Exception as error:  # torch raises a dozen types for damaged files
        first = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise ConfigError(f"{path}: not a readable checkpoint ({first})") from None


def _check_whole(path: Path) -> None:
    """Check what torch does not: checksums, and contents that need more memory than the file has bytes."""
    with ZipFile(path) as archive:
        if any(part.compress_type != ZIP_STORED for part in archive.infolist()):
            raise ValueError("it is packed")
        if damaged := archive.testzip():
            raise ValueError(f"{damaged} in it is damaged")
        if any(b"bytearray" in archive.read(name) for name in archive.namelist() if name.endswith(".pkl")):
            raise ValueError("a bytearray in it")  # a few bytes can declare any size
