"""Code that a person names in a setting, as ``module:name``."""

from __future__ import annotations

import importlib
import inspect
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from ibe_rl.types import ConfigError


def import_named(key: str, name: str, allowed: str, made: bool = False) -> Any:
    """Import what ``module:name`` names; the module may lie where the program was started.

    Args:
        key: of the setting.
        name: its value.
        allowed: what may be named, for the error.
        made: of a class take an object that is made without arguments.

    Raises:
        ConfigError: if it is not there, or raises anything on the way.
    """
    module, _, attribute = name.partition(":")
    try:
        found = getattr(import_from_here(module), attribute)
        return found() if made and inspect.isclass(found) else found
    except Exception as error:  # whatever code of somebody else raises
        raise ConfigError(f"{key}={name}: allowed is {allowed} ({raised(error)})") from None


def import_from_here(module: str) -> ModuleType:
    """Import a module that may lie where the program was started."""
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    return importlib.import_module(module)


def raised(error: Exception) -> str:
    """What somebody else's code raised, in short."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
