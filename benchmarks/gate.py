"""What the gate costs: the share of collection's time that it adds on the lander.

python -m benchmarks.gate            100 batches
python -m benchmarks.gate 1000

A step through the gate and one through gymnasium's own wrappers, which stood there before, are timed around an
environment that only gives back a step of the lander. Their difference is compared with the time that collecting a step
takes. Other programs only ever add to a time, so the least of many is taken.
"""

from __future__ import annotations

import sys
from timeit import timeit

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers import OrderEnforcing, TimeLimit
from torchrl.collectors import Collector

from ibe_rl.agents import make_agent
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import CollectConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.gate import Gate
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.instructors.oracle import Oracle

MOST = 0.03
"""Largest share that the gate may add."""
STEPS = 16
"""Of each environment in a batch; short, as a batch without a disturbance is what counts."""


def ungated() -> gymnasium.Env:
    """The lander with gymnasium's wrappers only."""
    return gymnasium.make(LANDER_ID, disable_env_checker=True)


class Replay(gymnasium.Env):
    """Gives the same first step of the lander again and again."""

    new_observations = True  # as the lander

    def __init__(self) -> None:
        lander = ungated()
        self.observation_space, self.action_space = lander.observation_space, lander.action_space
        self._beginning, self._answer = lander.reset(seed=0), lander.step(0)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple:
        """See ``gymnasium.Env``."""
        return self._beginning

    def step(self, action: int) -> tuple:
        """See ``gymnasium.Env``."""
        return self._answer


def added_s() -> float:
    """Seconds that a step through the gate takes longer than one through gymnasium's wrappers."""
    limited = [TimeLimit(OrderEnforcing(Replay()), 10**9) for _ in range(2)]
    envs = [Gate(limited[0], LANDER_ID, LANDER_TASK.success_key), limited[1]]
    for env in envs:
        env.reset(seed=0)
    blocks = [[timeit(lambda env=env: env.step(0), number=100) for env in envs] for _ in range(2_000)]
    gate, without = np.min(blocks, axis=0) / 100
    return float(gate - without)


def step_s(batches: int) -> float:
    """Least seconds per step of collecting a batch without the gate, after two to warm up."""
    torch.manual_seed(0)
    envs = [ungated() for _ in range(CollectConfig().envs_per_process)]
    agent = make_agent(PPOConfig(), LANDER_TASK.observation_size, envs[0].action_space, total_frames=1_000_000)
    frames, env = len(envs) * STEPS, make_vector_env(envs, Oracle(LANDER_TASK.rule), 0)
    collector = Collector(
        env, agent.policy, frames_per_batch=frames, total_frames=-1, auto_register_policy_transforms=False
    )
    source = iter(collector)
    least = min([timeit(lambda: next(source), number=1) for _ in range(batches + 2)][2:])
    collector.shutdown()
    return least / frames


if __name__ == "__main__":
    torch.set_num_threads(1)
    added, step = added_s(), step_s(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
    share = added / step
    print(f"the gate adds {added * 1e6:.2f} µs to the {step * 1e6:.1f} µs of a collected step: {share:+.1%}")  # noqa: T201 - talks to a person
    sys.exit(int(share > MOST))
