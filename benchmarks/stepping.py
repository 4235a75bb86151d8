"""Frames a second of our collector and of gymnasium's own game; runs in child processes."""

from __future__ import annotations

import multiprocessing
import time
from typing import Any

import gymnasium
import numpy as np
import torch

from ibe_rl.agent import make_agent
from ibe_rl.collect import batches, make_collector
from ibe_rl.config import CollectConfig, EnvConfig, InstructorConfig, PPOConfig
from ibe_rl.env import LANDER_ID
from ibe_rl.env.make import make_gym, task_of


def collect(settings: dict[str, int], count: int) -> float:
    """Frames a second of our collector with an untrained PPO, after one batch to warm up.

    Args:
        settings: of ``CollectConfig`` that differ from the default.
        count: batches that are timed.
    """
    torch.set_num_threads(1)
    torch.manual_seed(0)
    env = make_gym(LANDER_ID, {})
    task = task_of(env)
    agent = make_agent(PPOConfig(), task.observation_size, env.action_space, total_frames=1_000_000)
    collector = make_collector(agent, EnvConfig(LANDER_ID), CollectConfig(**settings), task, InstructorConfig(), seed=0)
    endless = batches(collector, agent, overlap=False)
    next(endless)
    start = time.perf_counter()
    frames = sum(next(endless).numel() for _ in range(count))
    seconds = time.perf_counter() - start
    collector.shutdown()
    return frames / seconds


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
