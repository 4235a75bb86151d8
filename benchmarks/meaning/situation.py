"""A situation: who acts, what is paid, what kind of rule speaks, and in which world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from benchmarks.meaning.flown import Flown, Truth, cached, code_version, fly_both
from benchmarks.meaning.rules import MakeInstructor, Rule
from benchmarks.meaning.worlds import Pay, World, make_game, make_task
from ibe_rl.apps.external.policy import EpsilonGreedy
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.task import Task
from ibe_rl.types import Policy


@dataclass(frozen=True)
class Situation:
    """One case of which the truth is known.

    Attributes:
        name: of the world, the rule, who acts, what is paid.
        world: the game.
        rule: of the state; where the instructor goes by the clock, only what is declared.
        policy: who acts, without chance.
        pay: what is paid, None: what the game always pays.
        truth: what the word +1 means.
        told: whether the agent was ever told anything, and so reads it.
        make_instructor: who speaks; None: the rule at every step.
        lamp: whether the state has one more number, drawn for each episode.
        horizon_steps: None takes that of the world.
    """

    name: str
    world: World
    rule: Rule
    policy: Policy
    pay: Pay | None
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
        """What is declared."""
        return make_task(self.world, self.name, self.rule, self.truth.direction, self.truth.band)

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """One more game."""
        return make_game(self.world, self.task, self.pay, self.lamp)

    def make(self, seed: int, cache: Path | None = None) -> Flown:
        """Fly it.

        Args:
            seed: of all draws.
            cache: folder in which the episodes are kept, and found the next time.
        """
        instructor = self.make_instructor or (lambda _: Oracle(self.rule))
        acting = EpsilonGreedy(self.policy, self.world.random_actions, self.make_env().action_space, seed)
        path = None if cache is None else cache / f"{self.name}_{seed}_{code_version()}.npz"
        logged, fresh = cached(path, lambda: fly_both(self.make_env, self.policy, acting, instructor, seed))
        return Flown(
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
