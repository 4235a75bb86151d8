"""The environments: gymnasium's, the lander and a point mass, with wrappers for reward, start and context."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import TimeLimit

from benchmarks.meaning.point_mass import PointMass
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.declare import ANY
from ibe_rl.envs.wrappers import SUCCESS, Declared
from ibe_rl.task import Phrases, Task
from ibe_rl.types import Array

Reward = Callable[[Array, Array, Array, np.random.Generator], float]
"""State before, action, state after and a generator to the reward."""
REWARD_STREAM, LAMP_STREAM, START_STREAM = 0xB1, 0xB2, 0xB3  # independent of the environment's own draws


@dataclass(frozen=True)
class World:
    """An environment.

    Attributes:
        make: makes one without a time limit.
        state_names: ``S`` names.
        steps: time limit of an episode.
        horizon_steps: horizon of the explanations.
        random_actions: share of random actions in the log.
    """

    make: Callable[[], gymnasium.Env[Any, Any]]
    state_names: tuple[str, ...]
    steps: int
    horizon_steps: int
    random_actions: float = 0.15


class OtherReward(gymnasium.Wrapper[Array, Any, Array, Any]):
    """Replaces the reward."""

    def __init__(self, env: gymnasium.Env[Array, Any], reward: Reward):
        super().__init__(env)
        self._reward = reward

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """See ``gymnasium.Env``."""
        state, info = self.env.reset(seed=seed, options=options)
        self._state, self._random = state, np.random.default_rng([REWARD_STREAM, seed or 0])
        return state, info

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Step, with the other reward."""
        state, _, terminated, truncated, info = self.env.step(action)
        reward = self._reward(self._state, np.asarray(action), state, self._random)
        self._state = state
        return state, float(reward), terminated, truncated, info


class Lamp(gymnasium.Wrapper[Array, Any, Array, Any]):
    """Appends a lamp to the state: 1 or -1, drawn at the beginning of each episode."""

    def __init__(self, env: gymnasium.Env[Array, Any]):
        super().__init__(env)
        self.observation_space = spaces.Box(-np.inf, np.inf, (env.observation_space.shape[0] + 1,), np.float32)
        self._lamp = np.float32(1)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """See ``gymnasium.Env``."""
        state, info = self.env.reset(seed=seed, options=options)
        self._lamp = np.float32(np.random.default_rng([LAMP_STREAM, seed or 0]).choice([-1, 1]))
        return np.append(state, self._lamp), info

    def step(self, action: Any) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """See ``gymnasium.Env``."""
        state, *rest = self.env.step(action)
        return (np.append(state, self._lamp), *rest)


class OtherStart(gymnasium.Wrapper[Array, Any, Array, Any]):
    """Draws the initial state of a classic control environment uniformly within ``reach`` ``(S,)`` of 0."""

    def __init__(self, env: gymnasium.Env[Array, Any], reach: Array):
        super().__init__(env)
        self._reach = reach

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Reset to the drawn state."""
        _, info = self.env.reset(seed=seed, options=options)
        state = np.random.default_rng([START_STREAM, seed or 0]).uniform(-self._reach, self._reach)
        self.unwrapped.state = state
        return state.astype(np.float32), info


class Copyable(gymnasium.Wrapper[Array, Any, Array, Any]):
    """Takes snapshots of an environment in pure Python, wrappers included, by a deep copy."""

    @property
    def unwrapped(self) -> Copyable:
        """Itself, so that snapshots include the wrappers inside."""
        return self

    @property
    def task(self) -> Task:
        """As declared."""
        declared: Task = self.env.get_wrapper_attr("task")
        return declared

    def snapshot(self) -> gymnasium.Env[Any, Any]:
        """See ``ibe_rl.envs.snapshots.Stoppable``."""
        return deepcopy(self.env)

    def restore(self, snapshot: gymnasium.Env[Any, Any], noise: np.random.Generator | None = None) -> None:
        """See ``ibe_rl.envs.snapshots.Stoppable``."""
        self.env = deepcopy(snapshot)
        if noise is not None:
            self.env.unwrapped.np_random = noise


def make_env(world: World, task: Task, reward: Reward | None, lamp: bool) -> gymnasium.Env[Any, Any]:
    """The environment of a situation; without ``reward`` it keeps its own."""
    game = TimeLimit(world.make(), world.steps)
    game = game if reward is None else OtherReward(game, reward)
    declared = Declared(Lamp(game) if lamp else game, task)
    return declared if world is LANDER else Copyable(declared)


def make_task(world: World, name: str, rule: Callable[[Array], Array], direction: Array, band: float) -> Task:
    """The task; ``explained`` is the state dimension with the largest share of the direction."""
    names = world.state_names + ("lamp",) * (len(direction) - len(world.state_names))
    return Task(
        name=name,
        state_names=names,
        state_units=("",) * len(names),
        rule=rule,
        instruction_values=(-1.0, 0.0, 1.0),
        phrases=(Phrases("staying", "going {degree}down", "going {degree}up", ((0.15, "slightly "), (0.5, ""))),),
        context=lambda _: ANY,
        contexts=(ANY,),
        context_option="",
        success_key=SUCCESS,
        judges_success=False,
        explained=(int(np.argmax(np.abs(direction))),),
        explained_band=(band,),
        max_episode_steps=world.steps,
    )


def _classic(name: str) -> Callable[[], gymnasium.Env[Any, Any]]:
    return lambda: gymnasium.make(name, disable_env_checker=True).unwrapped


def _lander() -> gymnasium.Env[Any, Any]:
    return gymnasium.make(LANDER_ID, disable_env_checker=True).unwrapped


CART_NAMES = ("x", "vx", "angle", "angular_velocity")
LANDER_NAMES = ("x", "y", "vx", "vy", "angle", "angular_velocity", "left_leg", "right_leg", "goal_x")
TUTORIAL_CART = World(_classic("CartPole-v1"), CART_NAMES, 200, 40)
CART = World(lambda: OtherStart(_classic("CartPole-v1")(), np.array([1.6, 0.3, 0.03, 0.05])), CART_NAMES, 160, 40, 0.1)
PENDULUM = World(_classic("Pendulum-v1"), ("cos", "sin", "angular_velocity"), 120, 8)
CAR = World(_classic("MountainCar-v0"), ("position", "velocity"), 200, 8)
MASS = World(PointMass, ("a", "b", "c", "d"), 100, 20)
LANDER = World(_lander, LANDER_NAMES, 200, 60, 0.05)
