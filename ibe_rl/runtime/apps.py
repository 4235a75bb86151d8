"""Applications that the scripts offer and that the core never imports: found by name when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ibe_rl.types import ConfigError

APPS = {
    "agent=": "ibe_rl.apps.external.study:open_external",
    "sweep=": "ibe_rl.apps.sweep.report:report_sweep",
    "task=figures": "ibe_rl.apps.paper.experiments:reproduce",
}
"""Setting to the function, as ``module:name``, that does what it asks for."""


def load_app(setting: str) -> Callable[..., Any]:
    """The function behind a setting.

    Raises:
        ConfigError: if the application, or something that it needs, is not installed.
    """
    module, _, name = APPS[setting].partition(":")
    try:
        found: Callable[..., Any] = getattr(import_module(module), name)
    except ImportError as error:
        raise ConfigError(f"{setting}: needs {module}, which cannot be imported ({error})") from None
    return found
