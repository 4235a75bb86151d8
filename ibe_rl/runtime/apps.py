"""Applications that the core never imports: they are loaded by name when a setting asks for them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ibe_rl.types import ConfigError

APPS = {
    "--multirun": "ibe_rl.apps.sweep.launch:launch",
    "agent=": "ibe_rl.apps.external.explaining:open_external",
    "collect.engine=ray": "ibe_rl.apps.ray.workers",
    "explain_agent": "ibe_rl.apps.external.explaining:learn_external",
    "instructor=human": "ibe_rl.apps.teach.classroom",
    "minari": "ibe_rl.apps.minari:minari_command",
    "open_run(agent=)": "ibe_rl.apps.external.explaining:open_for",
    "report=true": "ibe_rl.apps.paper.report_context",
    "study": "ibe_rl.apps.study.commands:study_command",
    "study make": "ibe_rl.apps.study.preparing",
    "sweep=": "ibe_rl.apps.sweep.report:report_sweep",
    "task=figures": "ibe_rl.apps.paper.experiments:reproduce",
    "task=summary": "ibe_rl.apps.summary.summarising:sum_up",
}
"""Setting or command to the module, or the function in it, that implements it."""


def load_app(setting: str) -> Any:
    """The module or the function behind a setting.

    Raises:
        ConfigError: if the application or one of its dependencies is not installed.
    """
    module, _, name = APPS[setting].partition(":")
    try:
        found = import_module(module)
    except ImportError as error:
        raise ConfigError(f"{setting}: needs {module}, which cannot be imported ({error})") from None
    return getattr(found, name) if name else found
