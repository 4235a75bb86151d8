"""An opened run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.explain.phrasing import Asking, ExplainerState
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe.interpret import Reactions
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.instructors import make_instructor, named_instructor, stand_in
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import TRAJECTORIES
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Policy

WHAT_IF_CALIBRATION, SPOKEN_CALIBRATION = "what_if", "spoken"
"""Keys in calibration.json: of answers, and of what is spoken step by step."""


@dataclass(frozen=True)
class TrainedRun:
    """An opened run; ``runs.open_trained`` makes it.

    Attributes:
        folder: of the run.
        config: of its training, with the selected horizon.
        task: the environment's own.
        policy: the greedy policy of the last evaluation, or the named external policy.
        policy_frame: training frames when it was saved.
        mapping: the vocabulary of the last refresh before that.
        mapping_frame: training frames when it was learnt.
        horizon_steps: n, the horizon of the vocabulary.
        spans: the vocabularies of other time spans, by their horizon in steps.
        calibration: of the confidence in what is spoken: from ``task=evaluate`` if this vocabulary was evaluated, else
            from the last refresh; None at the first refresh.
        reactions: of the agent to other instructions, as of that refresh; None if not measured.
        scores_of_numbers: see ``metrics.quality.number_scores``, of the refresh; empty if it has none.
        what_if_calibration: of the confidence in answers to what it would do; None before ``task=evaluate``.
    """

    folder: Path
    config: TrainConfig
    task: Task
    policy: Policy
    policy_frame: int
    mapping: ClusterMapping
    mapping_frame: int
    horizon_steps: int
    spans: Mapping[int, ClusterMapping]
    calibration: Calibration | None
    reactions: Reactions | None = None
    scores_of_numbers: Sequence[Mapping[str, float]] = ()
    what_if_calibration: Calibration | None = None

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """A new environment as in the run."""
        return make_env(self.config.env)


def explainer_state(
    run: TrainedRun, futures: int = 1, min_confidence: float = 0.0, what_if: bool = False
) -> ExplainerState:
    """The explainer of a run: its vocabulary, calibration and settings."""
    return ExplainerState(
        mapping=run.mapping,
        horizon_steps=run.horizon_steps,
        words=run.task.phrases,
        spans=run.spans,
        futures=futures,
        calibration=run.calibration,
        min_confidence=min_confidence,
        what_if=Asking(values_of(run.task), calibration=run.what_if_calibration) if what_if else None,
    )


def instructed_by(run: TrainedRun) -> str | None:
    """Who instructs in the episodes that are explained and judged, where a person taught; else None."""
    config = run.config.instructor
    stands_in = stand_in(config, run.folder)
    return None if stands_in is config else named_instructor(make_instructor(stands_in, run.task))


def open_log(folder: Path) -> TrajectoryLog:
    """Open the log of the run in ``folder``.

    Raises:
        ConfigError: if it is missing or damaged.
    """
    if not (folder / TRAJECTORIES / "log.json").is_file():
        raise ConfigError(
            f"run={folder}: it has no log ({TRAJECTORIES}/) to learn other vocabularies from; "
            "allowed is a run with all that train.py left"
        )
    try:
        return TrajectoryLog.open(folder / TRAJECTORIES)
    except ValueError as error:
        raise ConfigError(f"run={folder}: {error}") from None
