"""Logs of any size filled with really flown episodes, and a refresh on them; runs in child processes."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.plan import ROOT
from ibe_rl.collect.rollout import play
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.evaluation.runs import load_run
from ibe_rl.ibe import IBEConfig
from ibe_rl.instructors import make_instructor
from ibe_rl.runtime.operating_system import peak_memory_mb
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Episode, Policy
from ibe_rl.vocabulary.fitting import learn_vocabulary

NOISE = 1e-3
"""Standard deviation in the states, so that no two windows are the same."""


def fill(folder: str, frames: int, capacity: int, flown_frames: int) -> int:
    """Write a log that has seen ``frames`` frames, the flown ones over and over; returns the frames it has seen.

    Args:
        folder: of the log, new.
        frames: to be seen, rounded up to whole episodes.
        capacity: of the log.
        flown_frames: really flown, half of them by the agent of the demo and half with random actions.
    """
    log = TrajectoryLog(Path(folder), capacity, LANDER_TASK.contexts)
    random, number = np.random.default_rng(0), 0
    episodes = fly(flown_frames)
    while log.frames < frames:
        for place in random.permutation(len(episodes)):
            log.add(steps_of_episode(shaken(episodes[place], random), number), LANDER_TASK.context)
            number += 1
            if log.frames >= frames:
                break
    log.flush()
    return log.frames


def fly(frames: int) -> list[Episode]:
    """Episodes of the agent of the demo and of random actions, about the same number of frames of each."""
    random = np.random.default_rng(0)
    trained = load_run(ROOT / "demo").policy
    choices = int(make_gym(LANDER_ID, {}).action_space.n)  # the lander's is discrete
    return fly_with(trained, frames // 2) + fly_with(lambda seen: random.integers(choices, size=len(seen)), frames // 2)


def fly_with(policy: Policy, frames: int) -> list[Episode]:
    """Episodes of a policy, ten at a time, until there are enough frames."""
    envs = [make_gym(LANDER_ID, {}) for _ in range(10)]
    instructor, episodes = make_instructor(InstructorConfig("oracle"), LANDER_TASK), list[Episode]()
    while sum(map(len, episodes)) < frames:
        episodes += play(envs, policy, instructor, range(len(episodes), len(episodes) + len(envs)))
    return episodes


def shaken(episode: Episode, random: np.random.Generator) -> Episode:
    """The episode with a little noise in its states."""
    states = (episode.states + random.normal(0, NOISE, episode.states.shape)).astype(np.float32)
    return replace(episode, states=states)


def steps_of_episode(episode: Episode, number: int) -> dict[str, Array]:
    """An episode as one row of what ``TrajectoryLog.add`` takes."""
    states = episode.states
    last = np.arange(len(episode)) == len(episode) - 1
    columns = {
        "state": states[:-1],
        "next_state": states[1:],
        "action": episode.actions,
        "reward": episode.rewards,
        "instruction": episode.instructions,
        "given": episode.given,
        "done": last,
        "terminated": last & episode.terminated,
        "success": last & episode.success,
        "episode": np.full(len(episode), number),
    }
    return {name: column[None] for name, column in columns.items()}


def refresh(folder: str) -> dict[str, float]:
    """Seconds of a refresh, and by how many megabytes it raised the most memory this process ever held."""
    log = TrajectoryLog.open(Path(folder))
    before, start = peak_memory_mb(), time.perf_counter()
    learnt = learn_vocabulary(log, IBEConfig(horizon_steps=60), LANDER_TASK, seed=0)
    seconds = time.perf_counter() - start
    return {"seconds": seconds, "mb": peak_memory_mb() - before, "windows": len(learnt.top)}
