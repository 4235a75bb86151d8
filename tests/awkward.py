"""A lift between two floors that is as awkward as it is asked to be; its agents shall bring it to height 0."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl.config.settings import TaskConfig
from ibe_rl.config.task_parts import PhrasesConfig
from ibe_rl.envs.functions import with_checks
from ibe_rl.envs.gate import Gate
from ibe_rl.envs.wrappers import Declared
from ibe_rl.task import Phrases, Task

STEPS = 12


class Lift(gymnasium.Env[Any, Any]):
    """Height and speed of a lift; ``change`` alters what ``step`` gives, given the number of the step."""

    action_space: Any = spaces.Discrete(3)

    def __init__(self, change: Callable[[int, list[Any]], Any] | None = None, space: Any = None, seeded: bool = True):
        self.observation_space = space or spaces.Box(-np.inf, np.inf, (2,), np.float32)
        self.change, self.seeded = change, seeded

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        random: Any = self.np_random if self.seeded else np.random  # the mistake that is looked for
        self.steps, self.state = 0, np.array([random.uniform(-1, 1), 0], np.float32)
        return self.state.copy(), {}

    def step(self, action: Any) -> Any:
        self.steps += 1
        self.state += np.float32([0.1 * (int(action) - 1), 0])
        self.state[1] = 0.1 * (int(action) - 1)
        given = [self.state.copy(), 1 - abs(float(self.state[0])), False, False, {"arrived": False}]
        return tuple(given) if self.change is None else self.change(self.steps, given)


class SameBuffer(Lift):
    """It hands out its own state, which it changes at the next step."""

    def reset(self, **asked: Any) -> Any:
        super().reset(**asked)
        return self.state, {}

    def step(self, action: Any) -> Any:
        return self.state, *super().step(action)[1:]


class Stopped(Lift):
    """It has snapshots of its own, which forget the speed if ``forgets``."""

    forgets = False

    def snapshot(self) -> Any:
        return self.state.copy(), self.steps

    def restore(self, snapshot: Any, noise: Any = None) -> None:
        self.state, self.steps = snapshot[0].copy(), snapshot[1]
        if self.forgets:
            self.state[0] = 0


class Forgetful(Stopped):
    forgets = True


class Twice(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Each step is two of the game's."""

    def step(self, action: Any) -> Any:
        self.env.step(action)
        return self.env.step(action)


def up_or_down(states: np.ndarray) -> np.ndarray:
    return -np.sign(np.round(states[..., :1], 1))


def lift_task(**changes: Any) -> Task:
    """The task of a lift."""
    made: dict[str, Any] = {
        "name": "Lift",
        "state_names": ("height", "speed"),
        "state_units": ("", ""),
        "rule": up_or_down,
        "instruction_values": (-1.0, 0.0, 1.0),
        "phrases": (Phrases("staying", "going {degree}down", "going {degree}up", ((0.1, ""),)),),
        "context": lambda state: "below" if state[0] < 0 else "above",
        "contexts": ("below", "above"),
        "context_option": "",
        "success_key": "arrived",
        "explained": (0,),
        "explained_band": (0.05,),
        "max_episode_steps": STEPS,
    }
    return Task(**made | changes)


def behind_gate(change: Any = None, env: Any = None, success: Any = None, **changes: Any) -> Declared:
    """A lift behind its gate, as a run has it."""
    game = gymnasium.wrappers.TimeLimit(env or Lift(change), STEPS)
    task = with_checks(lift_task(**changes), {}, "task")
    return Declared(Gate(game, "env.id=lift", task.success_key, task.state_names), task, success)


def declared_lift(**changes: Any) -> TaskConfig:
    """The same in a config."""
    made: dict[str, Any] = {
        "rule": "awkward:up_or_down",
        "phrases": [PhrasesConfig("staying", "going {degree}down", "going {degree}up")],
        "explained": ["height"],
        "explained_band": [0.05],
        "state_names": ["height", "speed"],
        "success_key": "arrived",
    }
    return TaskConfig(**made | changes)


gymnasium.register("tests/Lift-v0", Lift, max_episode_steps=STEPS)
gymnasium.register("tests/SameBuffer-v0", SameBuffer, max_episode_steps=STEPS)
gymnasium.register("tests/Stopped-v0", Stopped, max_episode_steps=STEPS)
gymnasium.register("tests/Forgetful-v0", Forgetful, max_episode_steps=STEPS)
gymnasium.register("tests/Twice-v0", lambda: Twice(Stopped()), max_episode_steps=STEPS)
