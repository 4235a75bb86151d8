"""A situation: environment, reward, policy and instructor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from benchmarks.meaning.environments import Reward, World, make_env, make_task
from benchmarks.meaning.rules import MakeInstructor, Rule
from benchmarks.meaning.trial import Trial, Truth, cached, code_version, play_both
from ibe_rl.apps.external.policy import EpsilonGreedy
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.task import Task
from ibe_rl.types import Policy


@dataclass(frozen=True)
class Situation:
    """One case with a known truth.

    Attributes:
        name: of the environment, the rule, the policy and the reward.
        world: the environment.
        rule: of the state; where the instructor follows a plan, only declared.
        policy: the deterministic one.
        reward: None: the environment's own.
        truth: what the word +1 means.
        told: whether the agent reads the instruction.
        make_instructor: None: the rule at every step.
        lamp: whether the state has a lamp, see ``Lamp``.
        horizon_steps: None takes that of the world.
    """

    name: str
    world: World
    rule: Rule
    policy: Policy
    reward: Reward | None
    truth: Truth
    told: bool = True
    make_instructor: MakeInstructor | None = None
    lamp: bool = False
    horizon_steps: int | None = None

    @property
    def steps_ahead(self) -> int:
        """The horizon."""
        return self.horizon_steps or self.world.horizon_steps

    @property
    def task(self) -> Task:
        """The task of the environment."""
        return make_task(self.world, self.name, self.rule, self.truth.direction, self.truth.band)

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """Make the environment."""
        return make_env(self.world, self.task, self.reward, self.lamp)

    def make(self, seed: int, cache: Path | None = None) -> Trial:
        """Play its episodes.

        Args:
            seed: of all draws.
            cache: folder that keeps the episodes for the next time.
        """
        instructor = self.make_instructor or (lambda _: Oracle(self.rule))
        acting = EpsilonGreedy(self.policy, self.world.random_actions, self.make_env().action_space, seed)
        path = None if cache is None else cache / f"{self.name}_{seed}_{code_version()}.npz"
        logged, fresh = cached(path, lambda: play_both(self.make_env, self.policy, acting, instructor, seed))
        return Trial(
            name=self.name,
            seed=seed,
            task=self.task,
            make_env=self.make_env,
            make_instructor=instructor,
            policy=self.policy,
            acting=acting,
            log_episodes=logged,
            fresh=fresh,
            horizon_steps=self.steps_ahead,
            told=self.told,
            sees_instruction=self.told,
        )
