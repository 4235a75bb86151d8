"""Declared mirror images, on the real engines: the mirrored start with mirrored actions is the mirrored episode."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.envs import CART_POLE_ID, LANDER_ID
from ibe_rl.envs.cart_pole import CartPoleSnapshot
from ibe_rl.envs.lander import LanderSnapshot
from ibe_rl.envs.lander_task import WIDTH
from ibe_rl.task import Task
from ibe_rl.task.mirror import Mirror

OTHER_SIDE = {"left": "right", "right": "left", "center": "center"}


class EngineNoise:
    """The two numbers that the lander's engines draw a step; the second, across the lander, is mirrored."""

    def __init__(self, draws: Sequence[float], mirrored: bool):
        self._draws, self._mirrored, self._drawn = draws, mirrored, 0

    def random(self) -> float:
        drawn, self._drawn = self._draws[self._drawn], self._drawn + 1
        return 1 - drawn if self._mirrored and self._drawn % 2 == 0 else drawn


def lander_image(snapshot: LanderSnapshot) -> LanderSnapshot:
    bodies = snapshot.bodies[[0, 2, 1]] * [-1, 1, -1, -1, 1, -1]
    bodies[:, 0] += WIDTH
    terrain = snapshot.terrain[::-1]
    return replace(snapshot, bodies=bodies, terrain=terrain, pad=OTHER_SIDE[snapshot.pad])


def cart_pole_image(snapshot: CartPoleSnapshot) -> CartPoleSnapshot:
    return replace(snapshot, state=-snapshot.state, target=OTHER_SIDE[snapshot.target])


def action_image(mirror: Mirror, action: Any) -> Any:
    return mirror.actions[action] if mirror.actions else mirror.of_actions()(action)


def both_sides(kwargs: dict[str, Any], seed: int, image: Callable[[Any], Any], noise: Any) -> Any:
    """States and rewards of an episode of random actions, and of its mirror image, mirrored back."""
    here, there = (gymnasium.make(kwargs["id"], **kwargs["more"]).unwrapped for _ in range(2))
    here.reset(seed=seed)
    there.reset(seed=seed + 1)
    begin, task = here.snapshot(), here.task
    here.restore(begin, noise(seed, False))
    there.restore(image(begin), noise(seed, True))
    here.action_space.seed(seed)
    states, rewards = [], []
    while True:
        action = here.action_space.sample()
        state, reward, terminated, _, _ = here.step(action)
        mirrored, its_reward, its_end, _, _ = there.step(action_image(task.mirror, action))
        if terminated or its_end:
            return task, np.array(states), np.array(rewards)
        states.append((state, task.mirror.of_states(task.state_names)(mirrored)))
        rewards.append((reward, its_reward))


def lander_noise(seed: int, mirrored: bool) -> Any:
    return EngineNoise(np.random.default_rng(seed).random(2_000), mirrored)


CASES = {
    "four actions": ({"id": LANDER_ID, "more": {}}, lander_image, lander_noise),
    "throttles": ({"id": LANDER_ID, "more": {"continuous": True}}, lander_image, lander_noise),
    "two instructions": ({"id": LANDER_ID, "more": {"speed": True}}, lander_image, lander_noise),
    "cart-pole": ({"id": CART_POLE_ID, "more": {"moving": False}}, cart_pole_image, lambda *_: None),
}


@pytest.mark.parametrize("case", CASES)
def test_the_mirrored_episode_is_the_episode_mirrored(case: str):
    kwargs, image, noise = CASES[case]
    steps = 0
    for seed in range(8):
        task, states, rewards = both_sides(kwargs, seed, image, noise)
        aloft = np.cumsum(touching(task, states[:, 0])) == 0  # Box2D's order of contacts is not mirrored
        steps += aloft.sum()
        np.testing.assert_allclose(states[aloft, 0], states[aloft, 1], atol=2e-4)
        np.testing.assert_allclose(rewards[aloft, 0], rewards[aloft, 1], atol=2e-2)
        instructions = task.rule(states[:, 0])
        mirrored = task.rule(task.mirror.of_states(task.state_names)(states[:, 0]))
        assert np.array_equal(mirrored, instructions * task.mirror.instruction)
    assert steps > 100


def touching(task: Task, states: Any) -> Any:
    legs = [task.state_names.index(name) for name in ("left_leg", "right_leg") if name in task.state_names]
    return states[:, legs].any(axis=1)


def test_wind_and_words_have_no_mirror_image():
    assert gymnasium.make(LANDER_ID, enable_wind=True).unwrapped.task.mirror is None
    assert gymnasium.make(LANDER_ID, words=True).unwrapped.task.words is not None
