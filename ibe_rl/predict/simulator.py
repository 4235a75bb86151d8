"""The exact predictor: copies of the environment, set to the moments and stepped (the paper's Algorithm 1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.data import Array, Moment, Policy, observe


class Simulator:
    """Rolls the policy out in the environment's own engine; the environments of the moments stay untouched.

    A prediction ends where the environment says that the episode does; the time limit is not part of it.

    Args:
        make_env: makes one environment whose unwrapped self has ``snapshot`` and ``restore``.
        rule: the environment's instruction rule, states ``(N, S)`` to instructions ``(N, d)``.
        future_instruction: what the policy is told inside the prediction: "hold" keeps the moment's
            instruction, all that a person's student can know; "rule" asks the rule in the predicted states.
        moments_at_once: environments kept, stepped side by side.
        seed: of the engine's noise. Each prediction draws its own, since nobody knows the future's.
        own_noise: False repeats the draws of the original instead: only for testing the engine.
    """

    def __init__(
        self,
        make_env: Callable[[], gymnasium.Env[Any, Any]],
        rule: Callable[[Array], Array],
        future_instruction: str = "hold",
        moments_at_once: int = 256,
        seed: int = 0,
        own_noise: bool = True,
    ):
        self._make_env, self._rule, self._own_noise = make_env, rule, own_noise
        self._follow_rule = future_instruction == "rule"
        self._at_once = moments_at_once
        self._seeds = np.random.SeedSequence(seed)
        self._games: list[Any] = []

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Array:
        """See ``ibe_rl.data.Predictor``."""
        parts = [moments[first : first + self._at_once] for first in range(0, len(moments), self._at_once)]
        return np.concatenate([self._roll(part, policy, horizon_steps) for part in parts])

    def _roll(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Array:
        games = self._at(moments)
        paths = np.repeat(np.array([m.state for m in moments], np.float32)[:, None], horizon_steps + 1, axis=1)
        instruction = np.array([m.instruction for m in moments], np.float32)
        given = np.array([[m.given] for m in moments], np.float32)
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

    def _at(self, moments: Sequence[Moment]) -> list[Any]:
        """Take an environment for each moment and set it there."""
        while len(self._games) < len(moments):
            game = self._make_env().unwrapped
            game.reset(seed=0)
            self._games.append(game)
        noises = self._seeds.spawn(len(moments)) if self._own_noise else [None] * len(moments)
        for game, moment, noise in zip(self._games, moments, noises, strict=False):
            game.restore(moment.snapshot, None if noise is None else np.random.default_rng(noise))
        return self._games[: len(moments)]
