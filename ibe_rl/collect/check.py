"""Settings of collection that would be ignored."""

from __future__ import annotations

from ibe_rl.config.settings import CollectConfig
from ibe_rl.runtime.apps import load_app
from ibe_rl.types import ConfigError


def check_collect(config: CollectConfig) -> None:
    """Refuse a setting that would be ignored.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if config.engine == "ray":
        load_app("collect.engine=ray").check_ray(config)
    elif config.address is not None:
        raise ConfigError(
            f"collect.address={config.address} with collect.engine={config.engine}: allowed is null, "
            "or collect.engine=ray, which connects to it"
        )
    if config.ahead_batches > 1 and not config.overlap:
        raise ConfigError(
            f"collect.ahead_batches={config.ahead_batches} with collect.overlap=false: allowed is 1, "
            "or collect.overlap=true, without which no batch is collected ahead"
        )
