"""Minari, an optional dependency."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ibe_rl.types import ConfigError


def load_minari() -> Any:
    """The module, an optional dependency.

    Raises:
        ConfigError: if it is not installed.
    """
    try:
        import_module("h5py")  # which its datasets are read with
        return import_module("minari")
    except ImportError as error:
        raise ConfigError(f"needs minari ({error}); install the extra ibe_rl[minari]") from None
