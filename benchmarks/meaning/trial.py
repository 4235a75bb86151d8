"""The episodes of a situation, logged and for testing, and their cache."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from benchmarks.meaning.rules import MakeInstructor
from ibe_rl.collect.rollout import play
from ibe_rl.envs.instructed_envs import TRAINING_SEEDS, episode_seed
from ibe_rl.storage.run_folder import write_atomically
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode, Policy

AT_ONCE = 16
LOG_EPISODES, TEST_EPISODES = 120, 30
"""Episodes."""


@dataclass(frozen=True)
class Truth:
    """What the word +1 means, written by hand.

    Attributes:
        direction: ``(S,)`` along which +1 asks the state to rise.
        band: change along it over the horizon, beyond which it counts as having moved.
        tellable: whether the log determines the sign of +1.
        reason: in one sentence.
    """

    direction: Array
    band: float
    tellable: bool
    reason: str


@dataclass(frozen=True)
class Trial:
    """A situation with its episodes.

    Attributes:
        name: of the situation.
        seed: of the draws.
        task: its task.
        make_env: makes the environment.
        make_instructor: by the seed of its draws.
        policy: observations ``(N, S + 2)`` to actions, deterministic.
        acting: the same with exploration, as in the log.
        log_episodes: what a vocabulary is learnt from.
        fresh: test episodes, without exploration.
        horizon_steps: horizon of the explanations.
        told: whether the agent was given instructions.
        sees_instruction: whether it reads the instruction.
    """

    name: str
    seed: int
    task: Task
    make_env: Callable[[], gymnasium.Env[Any, Any]]
    make_instructor: MakeInstructor
    policy: Policy
    acting: Policy
    log_episodes: list[Episode]
    fresh: list[Episode]
    horizon_steps: int
    told: bool
    sees_instruction: bool


def play_both(
    make_env: Callable[[], gymnasium.Env[Any, Any]],
    policy: Policy,
    acting: Policy,
    make_instructor: MakeInstructor,
    seed: int,
) -> tuple[list[Episode], list[Episode]]:
    """Episodes for the log, and for testing."""
    envs = [make_env() for _ in range(AT_ONCE)]
    logged = [episode_seed(seed, number) for number in range(LOG_EPISODES)]
    fresh = [TRAINING_SEEDS + episode_seed(seed, number) for number in range(TEST_EPISODES)]
    return (
        play(envs, acting, make_instructor(2 * seed), logged),
        play(envs, policy, make_instructor(2 * seed + 1), fresh),
    )


def cached(
    path: Path | None, play_episodes: Callable[[], tuple[list[Episode], list[Episode]]]
) -> tuple[list[Episode], ...]:
    """Episodes from the cache, or played and cached now.

    Args:
        path: a ``.npz`` file, None keeps nothing.
        play_episodes: plays both lists.
    """
    if path is None:
        return play_episodes()
    if not path.exists():
        lots = play_episodes()
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {f"{i}_{name}": column for i, lot in enumerate(lots) for name, column in _columns(lot).items()}
        write_atomically(path, lambda stream: np.savez(stream, **columns))
    with np.load(path, allow_pickle=False) as arrays:
        found = dict(arrays)
    return tuple(_episodes({name[2:]: column for name, column in found.items() if name[0] == i}) for i in "01")


PER_STEP = ("states", "actions", "rewards", "instructions", "given")
PER_EPISODE = ("terminated", "success", "context")


def _columns(episodes: Sequence[Episode]) -> dict[str, Array]:
    joined = {name: np.concatenate([getattr(one, name) for one in episodes]) for name in PER_STEP}
    single = {name: np.array([getattr(one, name) for one in episodes]) for name in PER_EPISODE}
    return joined | single | {"steps": np.array([len(one) for one in episodes])}


def _episodes(columns: dict[str, Array]) -> list[Episode]:
    steps = columns["steps"]
    pieces = {name: np.split(columns[name], np.cumsum(steps + (name == "states"))[:-1]) for name in PER_STEP}
    return [
        Episode(
            **{name: pieces[name][i] for name in PER_STEP},
            terminated=bool(columns["terminated"][i]),
            success=bool(columns["success"][i]),
            context=str(columns["context"][i]),
        )
        for i in range(len(steps))
    ]


AFTERWARDS = ("__init__", "__main__", "judge", "learning", "running", "situations", "table")
"""Files of this folder that do not influence the episodes."""


@cache
def code_version() -> str:
    """Hash of the code that the episodes depend on."""
    files = sorted(file for file in Path(__file__).parent.glob("*.py") if file.stem not in AFTERWARDS)
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]
