"""Cases small enough to work out on paper: vocabularies on a line, and a lift that is told where to go."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.ibe import ClusterMapping, IBEConfig
from ibe_rl.ibe.space import Space, scaled
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Phrases, Task
from ibe_rl.types import Array


def plain(dimensions: int) -> Space:
    """Changes as they are."""
    return scaled(np.zeros(dimensions), np.ones(dimensions))


def on_a_line(
    centres: Sequence[float],
    expressions: Sequence[float] | None = None,
    ids: Sequence[int] | None = None,
    evidence: Sequence[float] | None = None,
) -> ClusterMapping:
    """Clusters of the changes of one number, in its own units; their means are their expressions."""
    k = len(centres)
    said = np.reshape(np.linspace(-1, 1, k) if expressions is None else expressions, (k, 1))
    windows = np.ones(k) if evidence is None else np.asarray(evidence)
    names = np.arange(k) if ids is None else np.asarray(ids)
    where = np.reshape(centres, (k, 1))
    return ClusterMapping(plain(1), where, said, said, windows, np.ones(k), windows, names)


def column(*values: float) -> Array:
    """Changes ``(W, 1)`` of one number."""
    return np.array(values, float)[:, None]


WORDS = Phrases("staying", "going {degree}down", "going {degree}up", ((0.3, "a little "), (0.7, "")))
TASK = Task(
    name="lift",
    state_names=("height", "speed", "floor"),
    state_units=("m", "m/s", ""),
    rule=lambda states: np.sign(states[..., 1:2]),
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(WORDS,),
    context=lambda state: "upper" if state[2] else "lower",
    contexts=("lower", "upper"),
    context_option="floor",
    success_key="arrived",
    explained=(0,),
    explained_band=(0.5,),
    max_episode_steps=100,
)
STEPS = 12


def add(
    log: TrajectoryLog,
    reward: float,
    instruction: float,
    floor: int = 0,
    steps: int = STEPS,
    given: bool = True,
    went: float | None = None,
    seen_speed: bool = True,
    told: Array | None = None,
) -> None:
    """Log an episode in which the lift follows the instruction, or ``went``, so many metres a step.

    Without ``seen_speed`` the state says 0 for it, and only where the lift has got to tells what it was told. ``told``
    ``(steps, 3)`` says who spoke.
    """
    random = np.random.default_rng(log.episodes_ended)
    speed = instruction if went is None else went
    height = np.arange(steps + 1) * speed + random.normal(0, 0.01, steps + 1)
    states = np.column_stack([height, np.full(steps + 1, speed * seen_speed), np.full(steps + 1, floor)]).astype(
        np.float32
    )
    last = np.arange(steps) == steps - 1
    columns = {
        "state": states[:-1],
        "action": np.zeros(steps, int),
        "reward": np.full(steps, reward / steps, np.float32),
        "instruction": np.full((steps, 1), instruction if given else 0, np.float32),
        "given": np.full(steps, given),
        "next_state": states[1:],
        "done": last,
        "terminated": last,
        "success": last,
    } | ({} if told is None else {"told": told})
    log.add({name: values[None] for name, values in columns.items()}, TASK.context)


def two_floors(folder: Path) -> TrajectoryLog:
    """Four good episodes below, worse ones above: told up, down, still, still."""
    made = TrajectoryLog(folder, 1_000, TASK.contexts)
    for floor, base in ((0, 100.0), (1, 50.0)):
        for rank, instruction in enumerate((1.0, -1.0, 0.0, 0.0)):
            add(made, base - rank, instruction, floor)
    return made


WAYS = (1.0, -1.0, 0.0)


def stay(observations: Array) -> Array:
    """A policy that has one action only."""
    return np.zeros(len(observations), int)


def config(**changes: Any) -> IBEConfig:
    """Three clusters of five steps, of all whole windows of all episodes, too few to test what the words mean."""
    settings = {"horizon_steps": 5, "spans_steps": [], "n_clusters": 3, "window_end": "drop", "meaning": "assumed"}
    return IBEConfig(**(settings | {"top_fraction": 1.0, "newest_frames": None} | changes))


def better_half(**changes: Any) -> IBEConfig:
    """The same of the better half of the episodes."""
    return config(**({"top_fraction": 0.5} | changes))


def obey(log: TrajectoryLog, reward: float = 1.0, seen_speed: bool = True) -> None:
    """Up, down, still: as told."""
    for instruction in WAYS:
        add(log, reward, instruction, seen_speed=seen_speed)


def defy(log: TrajectoryLog, reward: float = 1.0, seen_speed: bool = True) -> None:
    """Up when told down, down when told up, still when told to stay."""
    for instruction in WAYS:
        add(log, reward, instruction, went=-instruction, seen_speed=seen_speed)


def race(log: TrajectoryLog) -> None:
    """As no lift has gone before: one, two and three metres a step, told down, nothing and up."""
    for instruction, went in ((-1.0, 1.0), (0.0, 2.0), (1.0, 3.0)):
        add(log, 1.0, instruction, went=went)
