"""A learned predictor takes over where nobody named one and the environment cannot be copied exactly."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import gymnasium

from ibe_rl.config.hydra_setup import given_settings
from ibe_rl.config.kinds import implementation
from ibe_rl.config.settings import PredictorConfig, TrainConfig
from ibe_rl.envs.errors import CopyError
from ibe_rl.predict import check_predictor
from ibe_rl.types import ConfigError

NAMED = ("predictor", "predictor.kind")
LEARNED = ("ensemble", "regression")
"""The first that can work in the environment takes over."""


def with_learned_predictor(
    cfg: TrainConfig, env: gymnasium.Env[Any, Any], error: CopyError
) -> tuple[TrainConfig, list[str]]:
    """The settings of a new run whose environment cannot be copied, with a learned predictor.

    Args:
        cfg: of the run; a predictor that was named on the command line stays.
        env: one of its environments.
        error: what was found.

    Returns:
        The settings, and a note for the user.

    Raises:
        CopyError: the ``error``, if the predictor was named or no learned one can work here.
    """
    named = any(one.partition("=")[0] in NAMED for one in given_settings())
    found = None if named else _learned(cfg, env)
    if found is None:
        raise error
    note = f"{error.reason}; so predictor={found.kind} takes over, which learns from the log (docs/PREDICTORS.md)"
    return replace(cfg, predictor=found), [note]


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
