"""Arrays on disk: opening one runs no code and allocates no more than the file holds."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from ibe_rl.runtime.operating_system import reserve
from ibe_rl.types import Array


def make_array(path: Path, dtype: np.dtype, shape: tuple[int, ...]) -> Array:
    """Make a memory-mapped ``.npy`` file of zeros, with its disk space reserved.

    Raises:
        OSError: if the disk is full.
    """
    try:
        array = np.lib.format.open_memmap(path, mode="w+", dtype=dtype, shape=shape)
        reserve(path)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from None
    return array


def map_array(path: Path, mode: Literal["r", "r+"] = "r") -> Array:
    """Memory-map a whole ``.npy`` file; ``r+`` writes through to it.

    Raises:
        OSError: for ``r+``, if the disk is full.
        ValueError: if it is missing, cut short, damaged, or would have to run code.
    """
    try:
        with np.errstate(over="raise"):
            array: Array = np.load(path, mmap_mode="r", allow_pickle=False)
        there, declared = path.stat().st_size, array.offset + array.nbytes  # type: ignore[attr-defined]  # a memmap
        if there != declared:
            raise ValueError(f"{there:,} bytes are there, its head declares {declared:,}")
    except Exception as error:  # numpy raises a dozen types for damaged files
        first = str(error).partition(". If you trust")[0].splitlines()[0][:200] if str(error) else type(error).__name__
        raise ValueError(f"{path.name} is not a readable array ({first})") from None
    if mode == "r+":  # after the checks: numpy would fill up a cut file with zeros
        reserve(path)
        array = np.load(path, mmap_mode=mode, allow_pickle=False)
    return array
