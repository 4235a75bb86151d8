"""Arrays on disk: opening one runs no code, and asks for no more than what is there."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from ibe_rl.data import Array


def map_array(path: Path, mode: Literal["r", "r+"] = "r") -> Array:
    """Map a whole ``.npy`` file into memory; ``r+`` writes through to it.

    Raises:
        ValueError: if it is missing, cut short, damaged, or holds anything that would have to run code.
    """
    try:
        with np.errstate(over="raise"):
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        there, declared = path.stat().st_size, array.offset + array.nbytes
        if there != declared:
            raise ValueError(f"{there:,} bytes are there, its head declares {declared:,}")
        # only now: numpy fills up with zeros what is cut short, as long as it declares to be
        return array if mode == "r" else np.load(path, mmap_mode=mode, allow_pickle=False)
    except Exception as error:  # numpy raises a dozen types for damaged files
        first = str(error).partition(". If you trust")[0].splitlines()[0][:200] if str(error) else type(error).__name__
        raise ValueError(f"{path.name} is not a readable array ({first})") from None
