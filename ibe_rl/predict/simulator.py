"""The exact predictor: steps copies of the environment from the moments (the paper's Algorithm 1)."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Self

import numpy as np

from ibe_rl.config.settings import PredictorConfig
from ibe_rl.envs.acting import Acting
from ibe_rl.envs.snapshots import step_games
from ibe_rl.predict.twins import in_parts, originals_of, places_of, twins_to_roll
from ibe_rl.runtime.pool import ProcessPool
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Moment, Policy, Prediction, columns_of, observe, percepts_of

MakeEnv = Callable[[], Any]
Rule = Callable[[Array], Array]
_Part = tuple[Sequence[Moment], Sequence[Any]]
"""Moments and their noise seeds."""


class Simulator:
    """Rolls the policy out in the environment's own engine; the original environments stay untouched.

    A prediction ends where the episode terminates; the time limit is not part of it.

    Args:
        make_env: makes one environment whose ``unwrapped`` has ``snapshot`` and ``restore``.
        rule: the environment's instruction rule, states ``(N, S)`` to instructions ``(N, d)``.
        future_instruction: instruction inside the prediction: "hold" keeps the moment's, all that the student of a
            person can know; "rule" applies the rule to the predicted states.
        moments_at_once: environments per process, stepped together.
        processes: that divide the moments; 1: this process. Results agree to 1e-3 until a contact, where a copy
            shows traces of its earlier episodes. More than 1 take seconds to start, and ``make_env``, ``rule`` and
            the policy must be picklable.
        seed: of the engine's noise. Each prediction draws its own, as the future noise is unknown.
        own_noise: False repeats the draws of the original; only for testing the engine.
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
        self._copies = _EnvCopies(make_env, rule, future_instruction == "rule")
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
        originals = originals_of(moments)
        own = np.flatnonzero(originals == np.arange(len(moments)))
        drawn = self._seeds.spawn(len(own)) if self._own_noise else [None] * len(own)
        noises = dict(zip(own.tolist(), drawn, strict=True))
        rows = in_parts(own, twins_to_roll(moments, self._copies.follow_rule), self._at_once)
        parts = [([moments[row] for row in part], [noises[originals[row]] for row in part]) for part in rows]
        rolled = np.concatenate(list(self._roll_all(parts, policy, horizon_steps)))
        return Prediction.exact(rolled[places_of(rows, originals)])

    def _roll_all(self, parts: Sequence[_Part], policy: Policy, horizon_steps: int) -> Iterable[Array]:
        if self._processes == 1 or len(parts) == 1:
            return [self._copies.roll(part, policy, horizon_steps) for part in parts]
        self._pool = self._pool or ProcessPool(self._copies, self._processes)
        try:
            return list(self._pool.map("roll", [(part, policy, horizon_steps) for part in parts]))
        except BrokenProcessPool:  # one of them was killed
            self.close()
            return [self._copies.roll(part, policy, horizon_steps) for part in parts]

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """Nothing to learn: it steps the environment itself."""

    def forget(self) -> None:
        """Use new copies from now on: old ones show traces of earlier episodes."""
        self._copies.clear()
        try:
            if self._pool:
                self._pool.each("clear")
        except BrokenProcessPool:  # one of them was killed
            self.close()

    def state_dict(self) -> dict[str, Any]:
        """The number of noise seeds drawn, all that predictions depend on after ``forget``."""
        return {"drawn": self._seeds.n_children_spawned}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""
        self._seeds = np.random.SeedSequence(self._seeds.entropy, n_children_spawned=state["drawn"])

    def close(self) -> None:
        """Stop the processes, if there are any."""
        if self._pool:
            self._pool.close()
        self._pool = None


class _EnvCopies:
    """Copies of the environment, reused for the next moments."""

    def __init__(self, make_env: MakeEnv, rule: Rule, follow_rule: bool):
        self._make_env, self._rule, self.follow_rule = make_env, rule, follow_rule
        self._copies: list[Any] = []

    def __getstate__(self) -> dict[str, Any]:
        """What another process gets: games cannot be sent there, it makes copies of its own."""
        return self.__dict__ | {"_copies": []}

    def clear(self) -> None:
        """Drop the copies.

        They sit in reference cycles, and gc does not see the engine's native memory. Without an explicit collection a
        training grows by 1 MB per refresh.
        """
        if self._copies:
            self._copies = []
            gc.collect()

    def roll(self, part: _Part, policy: Policy, horizon_steps: int) -> Array:
        """Paths ``(N, H + 1, S)``; seed None repeats the original's noise."""
        moments, noises = part
        copies = self._at(moments, noises)
        states, instruction, given = columns_of(moments)
        percepts, paths = percepts_of(moments), np.repeat(states[:, None], horizon_steps + 1, axis=1)
        running, by_rule = np.arange(len(moments)), np.array([moment.twin is None for moment in moments])
        acting = Acting(policy, [moment.memory for moment in moments])
        for step in range(1, horizon_steps + 1):
            states = paths[running, step - 1]
            if self.follow_rule and step > 1 and (asked := by_rule[running]).any():
                instruction[running[asked]], given[running[asked]] = self._rule(states[asked]), 1.0
            rows = running.tolist()
            actions = acting(observe(percepts[running], instruction[running], given[running]), rows, copies)
            choices = actions.tolist() if actions.ndim == 1 else actions  # gymnasium checks plain ints faster
            paths[running, step], percepts[running], ended = step_games([copies[row] for row in rows], choices)
            for row in running[ended]:
                paths[row, step:] = paths[row, step]
            running = running[~ended]
            if not len(running):
                break
        return paths

    def _at(self, moments: Sequence[Moment], noises: Sequence[Any]) -> list[Any]:
        """Restore each moment in an environment of its own."""
        while len(self._copies) < len(moments):
            copy = self._make_env().unwrapped
            copy.reset(seed=0)
            self._copies.append(copy)
        for copy, moment, noise in zip(self._copies, moments, noises, strict=False):
            copy.restore(moment.snapshot, None if noise is None else np.random.default_rng(noise))
        return self._copies[: len(moments)]
