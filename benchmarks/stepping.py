"""Frames a second of our collector and of gymnasium's own game; runs in child processes."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from typing import Any

import gymnasium
import numpy as np
import torch
from tensordict import TensorDictBase

from ibe_rl.agents import make_agent
from ibe_rl.agents.ppo import PPOConfig, SamplingPolicy
from ibe_rl.collect.collector import Batches, make_collector
from ibe_rl.config.settings import CollectConfig, EnvConfig, InstructorConfig
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.instructed_envs import InstructedEnvs
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of


def collect(settings: dict[str, Any], count: int) -> float:
    """Frames a second of our collector with an untrained PPO, after one batch to warm up.

    Args:
        settings: of ``CollectConfig`` that differ from the default.
        count: batches that are timed.
    """
    with collecting(settings) as endless:
        start = time.perf_counter()
        frames = sum(next(endless).numel() for _ in range(count))
        return frames / (time.perf_counter() - start)


def inside(settings: dict[str, Any], count: int) -> dict[str, float]:
    """Shares of the time in which one process collects: the games, the policy, and what TorchRL does around them."""
    spent = {"games": 0.0, "policy": 0.0}
    for owner, name, what in (
        (InstructedEnvs, "_step", "games"),
        (InstructedEnvs, "_reset", "games"),
        (SamplingPolicy, "forward", "policy"),
    ):
        setattr(owner, name, timed(getattr(owner, name), spent, what))
    with collecting(settings) as endless:
        spent.update(dict.fromkeys(spent, 0.0))
        start = time.perf_counter()
        for _ in range(count):
            next(endless)
        shares = {what: seconds / (time.perf_counter() - start) for what, seconds in spent.items()}
    return shares | {"collector": 1.0 - sum(shares.values())}


def timed(call: Callable[..., Any], spent: dict[str, float], what: str) -> Callable[..., Any]:
    """The same function, its seconds added to ``spent``."""

    def counted(*args: Any, **kwargs: Any) -> Any:
        start = time.perf_counter()
        try:
            return call(*args, **kwargs)
        finally:
            spent[what] += time.perf_counter() - start

    return counted


@contextmanager
def collecting(settings: dict[str, Any]) -> Iterator[Generator[TensorDictBase, None, None]]:
    """Batches without end of an untrained PPO, the first of them left out; nobody learns meanwhile."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    env = make_gym(LANDER_ID, {})
    task = task_of(env)
    agent = make_agent(PPOConfig(), task.observation_size, env.action_space, total_frames=1_000_000)
    collector = make_collector(agent, EnvConfig(LANDER_ID), CollectConfig(**settings), task, InstructorConfig(), seed=0)
    try:
        with closing(Batches(collector, agent, overlap=False)) as endless:
            next(endless)
            yield endless
    finally:
        collector.shutdown()


def bare(seconds: float, processes: int = 2) -> float:
    """Frames a second of gymnasium's own game, summed over processes that step at the same time."""
    context = multiprocessing.get_context("spawn")
    ready, rates = context.Barrier(processes), context.Queue()
    workers = [context.Process(target=step_bare, args=(seconds, seed, ready, rates)) for seed in range(processes)]
    for worker in workers:
        worker.start()
    total = sum(rates.get() for _ in workers)
    for worker in workers:
        worker.join()
    return total


def step_bare(seconds: float, seed: int, ready: Any, rates: Any) -> None:
    """Step one copy with random actions, without any wrapper; it is reset when it is done."""
    env: Any = gymnasium.make("LunarLander-v3").unwrapped
    env.reset(seed=seed)
    actions = np.random.default_rng(seed).integers(4, size=1_000_000).tolist()
    ready.wait()
    start, frames = time.perf_counter(), 0
    while time.perf_counter() < start + seconds:
        _, _, terminated, _, _ = env.step(actions[frames % len(actions)])
        frames += 1
        if terminated:
            env.reset()
    rates.put(frames / (time.perf_counter() - start))
