"""Where a policy will lead: by the environment's own engine, or by what was learnt from the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ibe_rl.config.settings import EnsembleConfig, HumanConfig, InstructorConfig, PredictorConfig, RegressionConfig
from ibe_rl.predict.ensemble import Ensemble
from ibe_rl.predict.experience import ActionColumns
from ibe_rl.predict.regression import Regression
from ibe_rl.predict.simulator import Simulator, make_simulator
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError, Moment, Policy, Prediction


class KeptPredictor(Protocol):
    """A predictor that a run keeps: it may learn, and has a state to go on from."""

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
    return isinstance(config, EnsembleConfig | RegressionConfig)


def check_predictor(config: PredictorConfig, instructor: InstructorConfig, env: Any) -> None:
    """Refuse, before anything is made, a predictor that cannot work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not is_learnt(config):
        return
    if isinstance(instructor, HumanConfig):  # it would have to be sent to the process of the lesson
        raise ConfigError(f"predictor={config.kind} with instructor=human: allowed is predictor=simulator")
    if isinstance(config, EnsembleConfig):
        ActionColumns.of(env.action_space)
        if not config.hidden or min(config.hidden) < 1:
            raise ConfigError(f"predictor.hidden={list(config.hidden)}: allowed are one or more widths of at least 1")
    if isinstance(config, RegressionConfig) and min([1, *config.spans_steps]) < 1:
        raise ConfigError(f"predictor.spans_steps={list(config.spans_steps)}: allowed is at least 1 for each")


def make_predictor(
    config: PredictorConfig,
    make_copy: Callable[[], Any],
    rule: Callable[[Any], Any],
    seed: int,
    env: Any,
    horizons_steps: Callable[[], Sequence[int]],
) -> KeptPredictor:
    """Make the predictor that ``config`` asks for.

    Args:
        config: of one of the kinds.
        make_copy: makes one game that can be stopped and taken up again; only asked for the exact one.
        rule: the environment's instruction rule.
        seed: of its chance.
        env: one environment, whose spaces tell what it has to learn.
        horizons_steps: how far ahead is explained, asked when it learns: it may have to be found first.

    Raises:
        ConfigError: if it cannot learn such actions.
    """
    if isinstance(config, EnsembleConfig):
        actions, size = ActionColumns.of(env.action_space), int(env.observation_space.shape[0])
        return Ensemble(config, actions, size, rule, seed)
    if isinstance(config, RegressionConfig):
        return Regression(config, seed, lambda: config.spans_steps or [*horizons_steps(), 2 * max(horizons_steps())])
    return make_simulator(config, make_copy, rule, seed)


__all__ = [
    "Ensemble",
    "KeptPredictor",
    "Regression",
    "Simulator",
    "check_predictor",
    "is_learnt",
    "make_predictor",
    "make_simulator",
]
