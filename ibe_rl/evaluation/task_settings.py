"""Settings of explain.py that only some of its tasks read."""

from __future__ import annotations

from ibe_rl.config.settings import ExplainConfig
from ibe_rl.types import ConfigError


def refuse_unread(cfg: ExplainConfig) -> None:
    """Refuse settings that the task would not read.

    Raises:
        ConfigError: naming the setting and the task.
    """
    if cfg.metrics and cfg.task not in ("evaluate", "compare"):
        raise ConfigError(
            f"metric=[{','.join(cfg.metrics)}] with task={cfg.task}: allowed with task=evaluate or task=compare"
        )
    if cfg.clip is not None and (cfg.task != "episode" or cfg.sweep_dir is not None):
        task = f"task={cfg.task}" if cfg.sweep_dir is None else f"sweep={cfg.sweep_dir}"
        raise ConfigError(f"clip={cfg.clip} with {task}: allowed with it is task=episode, without sweep=")
