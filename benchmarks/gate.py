"""What the gate costs: the share of collection's time that it adds on the lander.

python -m benchmarks.gate            100 pairs of batches
python -m benchmarks.gate 1000

Two collectors in one process take turns, one with the gate and one with gymnasium's own wrappers, as before there was a
gate. Both collect the same steps; the times are of the processor. Other programs disturb them, so medians are compared.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from torchrl.collectors import Collector

from ibe_rl.agents import make_agent
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import CollectConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors.oracle import Oracle

MOST = 0.03
"""Largest share that the gate may add."""
STEPS = 16
"""Of each environment in a batch; short, as a batch without a disturbance is what counts."""


def ungated() -> gymnasium.Env:
    """The lander with gymnasium's wrappers only."""
    return gymnasium.make(LANDER_ID, disable_env_checker=True)


def gated() -> gymnasium.Env:
    """The lander as a run has it."""
    return make_gym(LANDER_ID, {})


def collector_of(make: Callable[[], gymnasium.Env]) -> Collector:
    """A collector in this process, of the default size, with an untrained policy."""
    torch.manual_seed(0)
    collect = CollectConfig()
    envs = [make() for _ in range(collect.envs_per_process)]
    rule = LANDER_TASK.rule if make is ungated else task_of(envs[0]).rule
    agent = make_agent(PPOConfig(), LANDER_TASK.observation_size, envs[0].action_space, total_frames=1_000_000)
    frames = len(envs) * STEPS
    env = make_vector_env(envs, Oracle(rule), 0)
    return Collector(env, agent.policy, frames_per_batch=frames, total_frames=-1, auto_register_policy_transforms=False)


def measure(pairs: int) -> np.ndarray:
    """Processor seconds ``(pairs, 2)`` of batches with and without the gate, after two to warm up."""
    collectors = [collector_of(gated), collector_of(ungated)]
    sources, spent = [iter(one) for one in collectors], np.zeros((pairs + 2, 2))
    for pair in range(pairs + 2):
        for kind in (0, 1) if pair % 2 else (1, 0):
            torch.manual_seed(pair)  # both draw the same actions
            start = time.process_time()
            next(sources[kind])
            spent[pair, kind] = time.process_time() - start
    for one in collectors:
        one.shutdown()
    return spent[2:]


if __name__ == "__main__":
    torch.set_num_threads(1)
    seconds = measure(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
    low, added, high = np.quantile(seconds[:, 0] / seconds[:, 1] - 1, [0.25, 0.5, 0.75])
    print(f"the gate adds {added:+.1%} to collection (quartiles of the pairs {low:+.1%} to {high:+.1%})")  # noqa: T201 - talks to a person
    sys.exit(int(added > MOST))
