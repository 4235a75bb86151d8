"""Settings of explain.py that only some of its tasks read."""

from __future__ import annotations

from ibe_rl.config.settings import ExplainConfig
from ibe_rl.types import ConfigError

OF_AN_EPISODE = ("context", "output", "clip")
"""Settings that only ``task=episode`` reads."""
OF_A_SUMMARY = {"with": "with_run", "with_frame": "with_frame"}
"""Settings that only ``task=summary`` reads, and their fields."""


def refuse_unread(cfg: ExplainConfig) -> None:
    """Refuse settings that the task would not read.

    Raises:
        ConfigError: naming the setting and the task.
    """
    if cfg.metrics and cfg.task not in ("evaluate", "compare"):
        raise ConfigError(
            f"metric=[{','.join(cfg.metrics)}] with task={cfg.task}: allowed with task=evaluate or task=compare"
        )
    task = f"task={cfg.task}" if cfg.sweep_dir is None else f"sweep={cfg.sweep_dir}"
    for name in OF_AN_EPISODE if task != "task=episode" else ():
        if (value := getattr(cfg, name)) is not None:
            raise ConfigError(f"{name}={value} with {task}: allowed with it is task=episode, without sweep=")
    for name, field in OF_A_SUMMARY.items() if task != "task=summary" else ():
        if (value := getattr(cfg, field)) is not None:
            raise ConfigError(f"{name}={value} with {task}: allowed with it is task=summary, without sweep=")
    if cfg.output is not None and cfg.viewer.mode == "off":
        raise ConfigError(f"output={cfg.output} with viewer=off: allowed with it is viewer=file or viewer=live")
