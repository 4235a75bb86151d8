"""The situations: who acts, what is paid, what kind of rule speaks, and in which world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.meaning.flown import Flown, Truth, cached, code_version, fly_both
from benchmarks.meaning.rules import MakeInstructor, Rule
from benchmarks.meaning.worlds import Pay, World, make_game, make_task
from ibe_rl.data import Policy
from ibe_rl.guest import Wandering
from ibe_rl.instruct import Oracle


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

    def make(self, seed: int, cache: Path | None = None) -> Flown:
        """Fly it.

        Args:
            seed: of all draws.
            cache: folder in which the episodes are kept, and found the next time.
        """
        task = make_task(self.world, self.name, self.rule, self.truth.direction, self.truth.band)
        make_env = lambda: make_game(self.world, task, self.pay, self.lamp)  # noqa: E731
        instructor = self.make_instructor or (lambda _: Oracle(self.rule))
        acting = Wandering(self.policy, self.world.random_actions, make_env().action_space, seed)
        path = None if cache is None else cache / f"{self.name}_{seed}_{code_version()}.npz"
        logged, fresh = cached(path, lambda: fly_both(make_env, self.policy, acting, instructor, seed))
        return Flown(
            name=self.name,
            seed=seed,
            task=task,
            make_env=make_env,
            make_instructor=instructor,
            policy=self.policy,
            acting=acting,
            log_episodes=logged,
            fresh=fresh,
            horizon_steps=self.horizon_steps or self.world.horizon_steps,
            told=self.told,
            sees_instruction=self.told,
        )


def situations() -> dict[str, Situation]:
    """All of them by their names."""
    from benchmarks.meaning import games, masses

    every = [*games.SITUATIONS, *masses.SITUATIONS]
    return {one.name: one for one in every}
