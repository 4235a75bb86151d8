"""The exact predictor: copies of the environment, set to the moments and stepped (the paper's Algorithm 1)."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Self

import numpy as np

from ibe_rl.config.settings import PredictorConfig
from ibe_rl.runtime.pool import ProcessPool
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Moment, Policy, Prediction, columns_of, observe

MakeEnv = Callable[[], Any]
Rule = Callable[[Array], Array]
Part = tuple[Sequence[Moment], Sequence[Any]]
"""Moments, and the seed of the noise for each of them."""


class Simulator:
    """Rolls the policy out in the environment's own engine; the environments of the moments stay untouched.

    A prediction ends where the environment says that the episode does; the time limit is not part of it.

    Args:
        make_env: makes one environment whose unwrapped self has ``snapshot`` and ``restore``.
        rule: the environment's instruction rule, states ``(N, S)`` to instructions ``(N, d)``.
        future_instruction: what the policy is told inside the prediction: "hold" keeps the moment's
            instruction, all that a person's student can know; "rule" asks the rule in the predicted states.
        moments_at_once: environments kept in each process, stepped side by side.
        processes: that share the moments; 1 stays in this one. The result is the same to 1e-3 until something touches
            the ground, where a copy of the game shows traces of whom it played before. With more of them, which
            take seconds to start, ``make_env``, ``rule`` and the policy must be picklable.
        seed: of the engine's noise. Each prediction draws its own, since nobody knows the future's.
        own_noise: False repeats the draws of the original instead: only for testing the engine.
    """

    kind, settings = "simulator", PredictorConfig

    def __init__(
        self,
        make_env: MakeEnv,
        rule: Rule,
        future_instruction: str = "hold",
        moments_at_once: int = 32,
        processes: int = 1,
        seed: int = 0,
        own_noise: bool = True,
    ):
        self._at_once, self._processes, self._own_noise = moments_at_once, processes, own_noise
        self._games = _Games(make_env, rule, future_instruction == "rule")
        self._seeds = np.random.SeedSequence(seed)
        self._pool: ProcessPool | None = None

    @classmethod
    def make(cls, config: PredictorConfig, *, make_snapshot_env: MakeEnv, rule: Rule, seed: int, **_: Any) -> Self:
        """See ``ibe_rl.predict.KeptPredictor``."""
        return cls(
            make_snapshot_env, rule, config.future_instruction, config.moments_at_once, config.processes or 1, seed
        )

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """See ``ibe_rl.types.Predictor``."""
        noises = self._seeds.spawn(len(moments)) if self._own_noise else [None] * len(moments)
        cuts = range(0, len(moments), self._at_once)
        parts = [(moments[cut : cut + self._at_once], noises[cut : cut + self._at_once]) for cut in cuts]
        return Prediction.exact(np.concatenate(list(self._roll_all(parts, policy, horizon_steps))))

    def _roll_all(self, parts: Sequence[Part], policy: Policy, horizon_steps: int) -> Iterable[Array]:
        if self._processes == 1 or len(parts) == 1:
            return [self._games.roll(part, policy, horizon_steps) for part in parts]
        self._pool = self._pool or ProcessPool(self._games, self._processes)
        try:
            return list(self._pool.map("roll", [(part, policy, horizon_steps) for part in parts]))
        except BrokenProcessPool:  # somebody has killed one of them
            self.close()
            return [self._games.roll(part, policy, horizon_steps) for part in parts]

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """There is nothing to learn: it knows the environment itself."""

    def forget(self) -> None:
        """Play with new copies from now on: old ones show traces of whom they played before."""
        self._games.clear()
        self.close()

    def state_dict(self) -> dict[str, Any]:
        """How much noise has been drawn, the only thing that later predictions depend on after ``forget``."""
        return {"drawn": self._seeds.n_children_spawned}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""
        self._seeds = np.random.SeedSequence(self._seeds.entropy, n_children_spawned=state["drawn"])

    def close(self) -> None:
        """Stop the processes, if there are any."""
        if self._pool:
            self._pool.close()
        self._pool = None


class _Games:
    """Copies of the environment, kept for the next moments."""

    def __init__(self, make_env: MakeEnv, rule: Rule, follow_rule: bool):
        self._make_env, self._rule, self._follow_rule = make_env, rule, follow_rule
        self._games: list[Any] = []

    def clear(self) -> None:
        """Forget the copies.

        Each is held by itself in a circle, and Python, which does not see the memory of the engine behind it, leaves
        such circles lie for so long that a training grows by a megabyte a refresh.
        """
        self._games = []
        gc.collect()

    def roll(self, part: Part, policy: Policy, horizon_steps: int) -> Array:
        """Paths ``(N, H + 1, S)``; a seed of None repeats the original's noise."""
        moments, games = part[0], self._at(*part)
        states, instruction, given = columns_of(moments)
        paths = np.repeat(states[:, None], horizon_steps + 1, axis=1)
        flying = np.arange(len(moments))
        for step in range(1, horizon_steps + 1):
            states = paths[flying, step - 1]
            if self._follow_rule and step > 1:
                instruction[flying], given[flying] = self._rule(states), 1.0
            actions = policy(observe(states, instruction[flying], given[flying]))
            choices = actions.tolist() if actions.ndim == 1 else actions  # gymnasium checks plain ints faster
            steps = [games[row].step(action) for row, action in zip(flying.tolist(), choices, strict=True)]
            paths[flying, step] = np.array([after[0] for after in steps])
            ended = np.array([after[2] for after in steps])
            for row in flying[ended]:
                paths[row, step:] = paths[row, step]
            flying = flying[~ended]
            if not len(flying):
                break
        return paths

    def _at(self, moments: Sequence[Moment], noises: Sequence[Any]) -> list[Any]:
        """Take an environment for each moment and set it there."""
        while len(self._games) < len(moments):
            game = self._make_env().unwrapped
            game.reset(seed=0)
            self._games.append(game)
        for game, moment, noise in zip(self._games, moments, noises, strict=False):
            game.restore(moment.snapshot, None if noise is None else np.random.default_rng(noise))
        return self._games[: len(moments)]
