"""Imports code that a setting names as ``module:name``."""

from __future__ import annotations

import importlib
import inspect
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from ibe_rl.runtime.printed import raised
from ibe_rl.types import ConfigError

_NAMED: set[str] = set()
"""Modules, or the packages they are in, that were asked for."""


def import_named(key: str, name: str, allowed: str, made: bool = False) -> Any:
    """Import ``module:name``; the module may lie in the working directory.

    Args:
        key: of the setting.
        name: its value.
        allowed: what may be named, for the error.
        made: instantiate a class without arguments.

    Raises:
        ConfigError: if it is missing or raises anything.
    """
    module, _, attribute = name.partition(":")
    try:
        found = getattr(import_from_here(module), attribute)
        return found() if made and inspect.isclass(found) else found
    except Exception as error:  # user code may raise anything
        raise ConfigError(f"{key}={name}: allowed is {allowed} ({raised(error)})") from None


def import_from_here(module: str) -> ModuleType:
    """Import a module that may lie in the working directory."""
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    _NAMED.add(module.partition(".")[0])
    return importlib.import_module(module)


def imported_from_here() -> bool:
    """Whether a module that a setting names lies in the working directory, so that other folders do not have it."""
    named = (sys.modules[name] for name in _NAMED if name in sys.modules and name != __name__.partition(".")[0])
    return Path.cwd() in map(_place_of, named)


def _place_of(module: ModuleType) -> Path | None:
    """The folder in which a module or package lies."""
    file = getattr(module, "__file__", None)
    return None if file is None else Path(file).absolute().parents[file.endswith("__init__.py")]
