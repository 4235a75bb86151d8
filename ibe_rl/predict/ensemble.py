"""The learned predictor: an ensemble of small dynamics models, trained on the log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Self

import numpy as np

from ibe_rl.config.limits import KEPT, TINY, setting
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.envs.acting import Acting
from ibe_rl.predict.experience import ActionColumns, Steps, held_out, newest_episodes, with_percepts
from ibe_rl.predict.members import Layers, Scale, layers_from_dict, layers_to_dict, make_layers, train_members
from ibe_rl.predict.rolling import Act, Begin, Rolled, roll
from ibe_rl.predict.simulator import Rule
from ibe_rl.predict.trust import Trust, measure
from ibe_rl.predict.twins import originals_of, twins_apart
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import IMAGE, Part, Task
from ibe_rl.types import Array, ConfigError, Moment, Policy, Prediction, columns_of, observe, percepts_of

FROM_NOTHING = 3
"""Factor on the updates of the first refresh."""


@dataclass
class EnsembleConfig(PredictorConfig):
    """Small dynamics models trained on the log; needs no snapshot of the environment, and one process.

    Training continues at each refresh; the first one takes three times the updates.
    """

    kind: str = setting("ensemble", kept=True)
    moments_at_once: int = setting(2_560, low=1, learnt=False)  # futures that fit the processor's cache
    members: int = setting(5, low=2, high=100, kept=True)  # networks in the ensemble
    hidden: list[int] = field(default_factory=lambda: [32, 32], metadata=KEPT)  # layer widths of each
    updates: int = setting(400, low=1)  # per refresh, of all members
    minibatch_size: int = setting(1_024, low=1)  # steps in a gradient step
    learning_rate: float = setting(5e-3, low=TINY, high=1.0)  # falls to 0 at each refresh
    newest_frames: int = setting(400_000, low=1)  # about this many frames of the log
    max_uncertainty: float = setting(
        1.0, low=0.0, learnt=False
    )  # expected error over the spread of changes; not trusted above


class Ensemble:
    """Learns one-step dynamics, and rolls the policy out in them.

    Each future follows one member. At intervals all members are compared; where they disagree too much the rest of the
    future is not trusted. Members are deterministic: futures of a moment differ by member only.

    Where the agent does not perceive the state itself, state and percept are learnt together, as one row ``(S + P,)``.

    Args:
        config: see ``EnsembleConfig``.
        actions: of the environment.
        state_size: S, with the percept S + P.
        rule: the environment's instruction rule, states ``(N, S)`` to instructions ``(N, d)``.
        seed: of the weights and of all draws.
        perceived_from: where the percept begins in the row: 0, or S.
    """

    kind, settings, learns = "ensemble", EnsembleConfig, True

    def __init__(
        self,
        config: EnsembleConfig,
        actions: ActionColumns,
        state_size: int,
        rule: Rule,
        seed: int,
        perceived_from: int = 0,
    ):
        self._config, self._actions, self._rule, self._seed = config, actions, rule, seed
        self._sizes = (state_size + actions.size, *config.hidden, state_size + 1)
        self._times, self._perceived_from = 0, perceived_from
        self._layers: Layers = make_layers(config.members, self._sizes, seed)
        self._scale: Scale | None = None
        self._trust: Trust | None = None

    @classmethod
    def make(cls, config: EnsembleConfig, *, rule: Rule, seed: int, env: Any, **_: Any) -> Self:
        """See ``ibe_rl.predict.KeptPredictor``."""
        size, parts = int(env.observation_space.shape[0]), _parts(env)
        both = size + sum(part.size for part in parts)
        return cls(config, ActionColumns.of(env.action_space), both, rule, seed, size if parts else 0)

    @staticmethod
    def check(config: EnsembleConfig, env: Any) -> None:
        """Refuse empty or non-positive layer widths, images, and unsupported actions.

        Raises:
            ConfigError: naming the key, the value and what is allowed.
        """
        ActionColumns.of(env.action_space)
        if not config.hidden or min(config.hidden) < 1:
            raise ConfigError(f"predictor.hidden={list(config.hidden)}: allowed are one or more widths of at least 1")
        if images := [part for part in _parts(env) if part.kind == IMAGE]:
            raise ConfigError(
                f"predictor={config.kind}: the agent perceives an image of {images[0].shape}, which it does not "
                "predict; allowed is predictor=simulator, or predictor=regression, which predicts the state alone"
            )

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """Continue training on the newest episodes of the log.

        Args:
            log: of a run.
            until_frame: use episodes that ended by this frame of the training; None: all.

        Raises:
            ValueError: if there is no such episode.
            FloatingPointError: if the weights are NaN or infinite.
        """
        config, seed = self._config, self._seed + 1_000 * (self._times + 1)
        newest = newest_episodes(log, config.newest_frames, until_frame)
        learnt, judged = held_out([with_percepts(episode) for episode in newest])
        steps = Steps.of(learnt, self._actions)
        self._scale = Scale.of(steps)
        updates = config.updates * (1 if self._times else FROM_NOTHING)
        layers = train_members(
            self._layers,
            self._scale,
            steps,
            updates=updates,
            minibatch_size=config.minibatch_size,
            learning_rate=config.learning_rate,
            seed=seed,
        )
        if not all(bool(values.isfinite().all()) for layer in layers for values in layer):
            raise FloatingPointError("the weights of the predictor are not finite numbers")
        self._layers = layers
        self._times += 1
        self._trust = measure(judged, self._scale, self._actions, self._roll, seed)

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """See ``ibe_rl.types.Predictor``.

        Raises:
            ValueError: before the first ``learn``.
        """
        if self._trust is None:
            raise ValueError("the ensemble has not been trained yet")
        states, instruction, given = columns_of(moments)
        memories, size = [moment.memory for moment in moments], states.shape[1]
        if self._perceived_from:
            states = np.concatenate([states, percepts_of(moments)], axis=1, dtype=np.float32)
        held = np.array([moment.twin is not None for moment in moments])
        follow = partial(self._follow, policy, instruction, given, held, memories)
        batches = [*twins_apart(originals_of(moments), self._config.members)]
        rolled = [
            self._roll(states[batch.layout], batch.of_rows(follow), horizon_steps).at(batch.places) for batch in batches
        ]
        order = np.argsort(np.concatenate([batch.rows for batch in batches]))
        paths = np.concatenate([each.paths for each in rolled])[order]
        error = self._trust.expected_error(np.concatenate([each.apart for each in rolled])[order])
        trusted = self._trust.trusted_steps(error, self._config.max_uncertainty, horizon_steps)
        return Prediction(paths[..., :size], trusted, error[:, -1])

    def _roll(self, states: Array, begin: Begin, horizon_steps: int) -> Rolled:
        assert self._scale is not None
        return roll(self._layers, self._scale, states, begin, horizon_steps, self._config.moments_at_once)

    def _follow(
        self, policy: Policy, instruction: Array, given: Array, held: Array, memories: Sequence[Any], futures: Array
    ) -> Act:
        """How the policy acts in these futures ``(R,)``, all held or none; its input buffer is allocated once."""
        first, by_rule = self._perceived_from, self._config.future_instruction == "rule" and not held[futures[0]]
        size = self._sizes[-1] - 1 - first
        seen = observe(np.zeros((len(futures), size), np.float32), instruction[futures], given[futures])
        acting, rows = Acting(policy, [memories[future] for future in futures.tolist()]), range(len(futures))

        def act(step: int, states: Array) -> Array:
            seen[:, :size] = states[:, first:]
            if by_rule and step:
                seen[:, size:-1], seen[:, -1] = self._rule(states[:, :first] if first else states), 1.0
            return self._actions(acting(seen, rows, None))

        return act

    def forget(self) -> None:
        """Nothing to forget: predictions depend only on what it has learnt."""

    def state_dict(self) -> dict[str, Any]:
        """What it has learnt, as arrays and plain values; empty before that."""
        if self._scale is None or self._trust is None:
            return {}
        return {
            "times": self._times,
            "layers": layers_to_dict(self._layers),
            "scale": self._scale.to_dict(),
            "trust": {"spread": self._trust.spread, "error_per_gap": self._trust.error_per_gap},
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``, for an ensemble made with the same settings.

        Raises:
            ValueError: if the state does not fit them.
            KeyError: if an entry is missing.
        """
        if not state:
            return
        layers, scale = layers_from_dict(state["layers"], self._layers), Scale(**state["scale"])
        if any(len(column) != self._sizes[-1] - 1 for column in scale.to_dict().values()):
            raise ValueError(f"its states have {len(scale.mean)} dimensions, expected {self._sizes[-1] - 1}")
        trust = Trust(np.asarray(state["trust"]["spread"]), float(state["trust"]["error_per_gap"]))
        self._times, self._layers, self._scale, self._trust = int(state["times"]), layers, scale, trust

    def close(self) -> None:
        """Nothing to close."""


def _parts(env: Any) -> Sequence[Part]:
    """Of the percept; none where it is the state."""
    task: Task | None = env.get_wrapper_attr("task") if env.has_wrapper_attr("task") else None
    return () if task is None else task.parts
