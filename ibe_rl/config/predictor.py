"""The settings of the predictors; see ``ibe_rl.config.settings``."""

from __future__ import annotations

from dataclasses import dataclass, field

from ibe_rl.config.limits import TINY, setting


@dataclass
class PredictorConfig:
    """How the future is predicted: in the environment's own engine, from a snapshot."""

    kind: str = setting("simulator", choices=("simulator",))
    future_instruction: str = setting("hold", choices=("hold", "rule"))
    processes: int | None = setting(None, low=1, high=64)  # that share the moments; None: 1, to judge a run 2
    futures: int = setting(3, low=1, high=100)  # sampled from each moment; what most of them are called is said
    moments_at_once: int = setting(32, low=1)  # copies of the environment; more of them crowd the processor's cache


@dataclass
class EnsembleConfig(PredictorConfig):
    """Small networks learn from the log what a step does; needs no snapshot of the environment, and one process.

    It learns at each refresh, going on from what it has learnt before; the first time takes three times the updates.
    """

    kind: str = setting("ensemble", choices=("ensemble",))
    moments_at_once: int = setting(2_560, low=1)  # futures that stay in the processor's cache
    members: int = setting(5, low=2, high=100)
    hidden: list[int] = field(default_factory=lambda: [32, 32])
    updates: int = setting(400, low=1)  # of all members, at each refresh
    minibatch_size: int = setting(1_024, low=1)
    learning_rate: float = setting(5e-3, low=TINY, high=1.0)  # falls to 0 at each refresh
    newest_frames: int = setting(400_000, low=1)  # about so many frames of the log are learnt from
    max_uncertainty: float = setting(1.0, low=0.0)  # expected error over how much changes vary: not trusted beyond


@dataclass
class RegressionConfig(PredictorConfig):
    """A regression from the state to its change, without asking the policy, in one process: the least it can be."""

    kind: str = setting("regression", choices=("regression",))
    future_instruction: str = setting("hold", choices=("hold",))  # it takes no steps
    futures: int = setting(1, low=1, high=100)  # all are the same
    spans_steps: list[int] = field(default_factory=list)  # learnt; empty: the horizons explained, twice the longest
    degree: int = setting(2, low=1, high=3)  # of the polynomial in the state
    newest_frames: int = setting(400_000, low=1)  # about so many frames of the log are learnt from


PREDICTORS = {"ensemble": EnsembleConfig, "regression": RegressionConfig}
"""The kinds of predictor with settings of their own."""
