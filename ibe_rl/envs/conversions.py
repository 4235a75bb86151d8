"""Takes what an environment gives into the types that its spaces say, or refuses it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

REAL_KINDS = "fiub"
"""Kinds of numpy's dtypes that hold real numbers."""


class UnfitError(ValueError):
    """An observation that does not fit its space."""


def taken(space: gymnasium.Space[Any], value: Any, what: str, names: Sequence[str] = ()) -> Any:
    """A copy of an observation in the dtype of its space.

    Args:
        space: of the observation.
        value: the observation.
        what: its name, for errors.
        names: of its numbers, for errors.

    Raises:
        UnfitError: if it does not fit the space or is not finite.
    """
    if isinstance(space, spaces.Dict):
        if not isinstance(value, Mapping) or not space.keys() <= value.keys():
            raise UnfitError(f"{what} is {shortened(value)}; allowed is a dict with {', '.join(map(str, space))}")
        return {key: taken(inner, value[key], f"{what}[{key!r}]") for key, inner in space.items()}
    if isinstance(space, spaces.Tuple):
        if not isinstance(value, Sequence) or len(value) != len(space):
            raise UnfitError(f"{what} is {shortened(value)}; allowed is a tuple of {len(space)}")
        return tuple(
            taken(inner, part, f"{what}[{i}]") for i, (inner, part) in enumerate(zip(space, value, strict=True))
        )
    if not isinstance(space, spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary):
        return deepcopy(value)  # text, say, which nobody reads
    array = _numbers(space, value, what, names)
    return int(array) if isinstance(space, spaces.Discrete) else array


def _numbers(space: gymnasium.Space[Any], value: Any, what: str, names: Sequence[str]) -> np.ndarray:
    try:
        array = np.array(value)
    except (TypeError, ValueError):  # a ragged list
        array = np.array(None)
    allowed = f"{space.dtype} numbers of shape {space.shape}, as its space says"
    if array.dtype.kind not in REAL_KINDS:
        raise UnfitError(f"{what} is {shortened(value)}; allowed are {allowed}")
    if array.shape != space.shape:
        raise UnfitError(f"{what} has the shape {array.shape}; allowed are {allowed}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        index = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        name = f"{names[index[0]]} ({what}[{index[0]}])" if len(names) == array.size else f"{what}{[*index] or ''}"
        raise UnfitError(f"{name} is {array[index]}; allowed are finite numbers")
    cast = array.astype(space.dtype, copy=False)
    if cast.dtype.kind != "f" and not np.array_equal(cast, array):
        raise UnfitError(f"{what} is {shortened(value)}; allowed are {allowed}")
    if isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary):
        asked = int(cast) if isinstance(space, spaces.Discrete) else cast
        if not space.contains(asked):
            raise UnfitError(f"{what} is {shortened(value)}; allowed is one of {space}")
    return cast


def as_number(value: Any) -> float | None:
    """A finite number, or an array of one, as float; None for anything else."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in REAL_KINDS or array.size != 1:
        return None
    number = float(array.reshape(-1)[0])
    return number if isfinite(number) else None


def as_flag(value: Any) -> bool | None:
    """A bool, 0 or 1, or an array of one such, as bool; None for anything else."""
    number = as_number(value)
    return bool(number) if number in (0.0, 1.0) else None


def shortened(value: Any) -> str:
    """A value for a message, in one line."""
    return " ".join(repr(value).split())[:120]
