"""Predictors: where a policy will lead, by simulation or from the log.

In: moments of episodes, a policy, the log to learn from, the settings of one kind. A kind is a module here or
elsewhere; see ``KeptPredictor``.
Out: predicted paths of the state, how far they are to be trusted, and what was learnt as a state to resume from.
Imports: ``types``, ``storage``, ``config``, ``instructors``, ``ibe``.
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
    """A predictor that a run keeps: it may learn, and has a state to go on from.

    A kind of predictor is such a class. It is called (or its ``make``, if it has one) with its settings and the keyword
    arguments of ``make_predictor``. Class attributes: ``settings``, a dataclass derived from ``PredictorConfig``;
    ``learns``, True if ``learn`` does anything, else it is asked to work in a copy of the environment;
    ``asks_policy``, False if what it predicts does not depend on the policy; and if need be
    ``check(settings, env)``, which raises ``ConfigError``.
    """

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """See ``ibe_rl.types.Predictor``."""

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """Learn from the log as it stands, or stood at a frame, if there is anything to learn."""

    def forget(self) -> None:
        """Let go of traces of what was predicted before, so that a resumed run predicts the same."""

    def state_dict(self) -> dict[str, Any]:
        """All that later predictions stand on, as arrays and plain values."""

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""

    def close(self) -> None:
        """Stop what it has started."""


def is_learnt(config: PredictorConfig) -> bool:
    """Whether it learns from the log instead of asking a copy of the environment."""
    return bool(getattr(implementation("predictor", config.kind), "learns", False))


def asks_policy(config: PredictorConfig) -> bool:
    """Whether what it predicts depends on the policy."""
    return bool(getattr(implementation("predictor", config.kind), "asks_policy", True))


def check_predictor(config: PredictorConfig, instructor: InstructorConfig, env: Any) -> None:
    """Refuse, before anything is made, a predictor that cannot work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if is_learnt(config) and is_live(instructor):  # it would have to be sent to the process of the lesson
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
    """Make the predictor that ``config`` asks for.

    Args:
        config: of one of the kinds.
        make_snapshot_env: makes one game that can be stopped and taken up again; only asked for the exact one.
        rule: the environment's instruction rule.
        seed: of its chance.
        env: one environment, whose spaces tell what it has to learn.
        horizons_steps: how far ahead is explained, asked when it learns: it may have to be found first.

    Raises:
        ConfigError: if it cannot learn such actions.
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
