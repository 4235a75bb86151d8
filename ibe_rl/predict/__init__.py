"""Predictors: where a policy will lead, by simulation or from the log.

In: moments of episodes, a policy, the log to learn from, the settings of one kind. A kind is a module here or
elsewhere; see ``KeptPredictor``.
Out: predicted state paths, how many of their steps to trust, and a state to resume from.
Imports: ``types``, ``task``, ``storage``, ``config``, ``envs``, ``instructors``, ``ibe``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ibe_rl.config.kinds import implementation, made
from ibe_rl.config.settings import InstructorConfig, PredictorConfig
from ibe_rl.instructors import is_live
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError, Moment, Policy, Prediction


class KeptPredictor(Protocol):
    """A predictor of a run: it may learn, and has a state to resume from.

    A kind of predictor is such a class. Its constructor (or its ``make``, if it has one) takes its settings and the
    keyword arguments of ``make_predictor``. Class attributes: ``settings``, a dataclass derived from
    ``PredictorConfig``; ``learns``, True if it learns from the log instead of stepping a copy of the environment;
    ``asks_policy``, False if its predictions do not depend on the policy; and optionally
    ``check(settings, env)``, which raises ``ConfigError``.
    """

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """See ``ibe_rl.types.Predictor``."""

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """Learn from the log, current or as of ``until_frame``; may do nothing."""

    def forget(self) -> None:
        """Drop traces of earlier predictions, so that a resumed run predicts the same."""

    def state_dict(self) -> dict[str, Any]:
        """All that later predictions depend on, as arrays and plain values."""

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""

    def close(self) -> None:
        """Stop its processes."""


def is_learnt(config: PredictorConfig) -> bool:
    """Whether it learns from the log instead of stepping a copy of the environment."""
    return bool(getattr(implementation("predictor", config.kind), "learns", False))


def asks_policy(config: PredictorConfig) -> bool:
    """Whether its predictions depend on the policy."""
    return bool(getattr(implementation("predictor", config.kind), "asks_policy", True))


def check_predictor(config: PredictorConfig, instructor: InstructorConfig, env: Any) -> None:
    """Refuse settings with which the predictor cannot work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if is_learnt(config) and is_live(instructor):  # it would have to be sent to the teaching session's process
        raise ConfigError(f"predictor={config.kind} with instructor={instructor.kind}: allowed is predictor=simulator")
    checks = getattr(implementation("predictor", config.kind), "check", None)
    if checks:
        checks(config, env)


def make_predictor(
    config: PredictorConfig,
    make_snapshot_env: Callable[[], Any],
    rule: Callable[[Any], Any],
    seed: int,
    env: Any,
    horizons_steps: Callable[[], Sequence[int]],
) -> KeptPredictor:
    """Make the predictor of the kind that ``config`` names.

    Args:
        config: settings of one kind.
        make_snapshot_env: makes an environment with ``snapshot`` and ``restore``; only called by the simulator.
        rule: the environment's instruction rule.
        seed: of its random draws.
        env: one environment, for its spaces.
        horizons_steps: the horizons explained, called when it learns: they may be estimated by then.

    Raises:
        ConfigError: if it does not support the action space.
    """
    given = {
        "make_snapshot_env": make_snapshot_env,
        "rule": rule,
        "seed": seed,
        "env": env,
        "horizons_steps": horizons_steps,
    }
    predictor: KeptPredictor = made("predictor", config, **given)
    return predictor


__all__ = ["KeptPredictor", "asks_policy", "check_predictor", "is_learnt", "make_predictor"]
