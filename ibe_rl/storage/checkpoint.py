"""Weights on disk; loading them runs no code from the file."""

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
"""What files of weights begin with: of policies kept at an evaluation, or between two; of a predictor at a refresh."""


def save_policy(folder: Path, frames: int, state: dict[str, Any], kind: str = EVALUATED) -> Path:
    """Keep the greedy policy's weights, or a predictor's."""
    path = folder / f"{kind}_{frames:012d}.pt"
    write_atomically(path, lambda stream: torch.save(state, stream))
    return path


def save_state(run_folder: Path, state: dict[str, Any]) -> None:
    """Replace the state of a run by the present one, in one go; that of the best evaluation stays too."""
    folder = run_folder / CHECKPOINTS
    write_atomically(folder / LATEST, lambda stream: torch.save(state, stream))
    if state["frames"] == state["counts"]["best_frames"]:
        link(folder, LATEST, BEST)


def as_tensors(values: Any) -> Any:
    """The same state with its arrays as tensors, which a checkpoint is made of; any depth of dicts, lists, tuples."""
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
    """Let a full state stay under another name too; it costs nothing, states are replaced and never written to."""
    temporary = folder / f"{also}.partial"
    temporary.unlink(missing_ok=True)
    os.link(folder / name, temporary)
    temporary.replace(folder / also)


def policies(folder: Path, *kinds: str) -> dict[int, Path]:
    """Frames to files of weights kept, in rising order; without ``kinds`` the policies of the evaluations."""
    named = re.compile(rf"(?:{'|'.join(kinds or (EVALUATED,))})_(\d+)\.pt")
    found = {int(match[1]): path for path in folder.glob("*.pt") if (match := named.match(path.name))}
    return dict(sorted(found.items()))


def load(path: Path) -> Any:
    """Read a checkpoint: tensors and plain values only.

    Raises:
        ConfigError: if the file is missing, damaged, or holds anything that would have to run code.
    """
    try:
        _check_whole(path)
        # mapped, torch looks no further than to the end of the file, whatever the sizes in it say
        return deepcopy(torch.load(path, weights_only=True, mmap=True))  # off the file, which may change
    except Exception as error:  # torch raises a dozen types for damaged files
        first = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise ConfigError(f"{path}: not a readable checkpoint ({first})") from None


def _check_whole(path: Path) -> None:
    """Look at what torch does not: checksums, and what would take up more memory than the file has bytes."""
    with ZipFile(path) as archive:
        if any(part.compress_type != ZIP_STORED for part in archive.infolist()):
            raise ValueError("it is packed")
        if damaged := archive.testzip():
            raise ValueError(f"{damaged} in it is damaged")
        if any(b"bytearray" in archive.read(name) for name in archive.namelist() if name.endswith(".pkl")):
            raise ValueError("a bytearray in it")  # of any size that a few bytes name
