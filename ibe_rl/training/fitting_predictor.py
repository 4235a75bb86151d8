"""A learned predictor takes over where nobody named one and the environment cannot be copied exactly."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import gymnasium

from ibe_rl.config.hydra_setup import given_settings
from ibe_rl.config.kinds import implementation
from ibe_rl.config.settings import PredictorConfig, TrainConfig
from ibe_rl.envs.errors import CopyError
from ibe_rl.envs.trial import try_copy
from ibe_rl.predict import check_predictor
from ibe_rl.types import ConfigError

NAMED = ("predictor", "predictor.kind")
LEARNED = ("ensemble", "regression")
"""The first that can work in the environment takes over."""


def with_fitting_predictor(cfg: TrainConfig, env: gymnasium.Env[Any, Any]) -> tuple[TrainConfig, list[str]]:
    """The settings of a new run, with a learned predictor if the default cannot work.

    Args:
        cfg: of the run; a predictor that was named on the command line, or by a config file, stays.
        env: one of its environments.

    Returns:
        The settings, and a note if another predictor takes over.

    Raises:
        ConfigError: if the environment cannot be copied and no learned predictor can work in it.
    """
    if cfg.predictor.kind != PredictorConfig.kind or any(one.partition("=")[0] in NAMED for one in given_settings()):
        return cfg, []
    try:
        try_copy(cfg.env)
    except CopyError as error:
        found = _learned(cfg, env)
        if found is None:
            raise
        note = f"{error.reason}; so predictor={found.kind} takes over, which learns from the log (docs/PREDICTORS.md)"
        return replace(cfg, predictor=found), [note]
    return cfg, []


def _learned(cfg: TrainConfig, env: gymnasium.Env[Any, Any]) -> PredictorConfig | None:
    """The settings of the first learned predictor that can work here, with what all predictors share as it was."""
    shared = {one.name: getattr(cfg.predictor, one.name) for one in fields(PredictorConfig) if one.name != "kind"}
    for name in LEARNED:
        config: PredictorConfig = implementation("predictor", name).settings(**shared, kind=name)
        try:
            check_predictor(config, cfg.instructor, env)
        except ConfigError:
            continue
        return config
    return None
