"""Learn the vocabulary from the log as it stands, and say what it stands on."""

from __future__ import annotations

import json
from collections.abc import Mapping as Dict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.config import MappingConfig
from ibe_rl.data import Array, ConfigError, Episode, Task
from ibe_rl.ibe import ClusterMapping, PaperMapping, TooLittleDataError, Windows, cut_windows, phrase, top_episodes
from ibe_rl.log import TrajectoryLog
from ibe_rl.run_folder import write_json

OTHER_EPISODES = 300
"""How many of the episodes that are not among the best are read for comparison."""


@dataclass(frozen=True)
class Refresh:
    """A vocabulary and what it was learnt from.

    Attributes:
        frame: training frames when it was learnt.
        mapping: the vocabulary.
        top: the windows of the best episodes that it was learnt from.
        others: windows with an instruction of other episodes, a sample, for comparison only.
        episodes_logged: whole episodes in the log.
        episodes_used: the best ones among them.
        episodes_by_context: of the best ones.
        windows_by_context: windows used, likewise.
        windows_by_instruction: windows used, by the instruction they began with.
    """

    frame: int
    mapping: ClusterMapping
    top: Windows
    others: Windows
    episodes_logged: int
    episodes_used: int
    episodes_by_context: Dict[str, int]
    windows_by_context: Dict[str, int]
    windows_by_instruction: Dict[str, int]


def check_mapping(config: MappingConfig, task: Task) -> None:
    """Refuse a mapping that cannot work in this environment.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if config.horizon_steps > task.max_episode_steps:
        raise ConfigError(
            f"mapping.horizon_steps={config.horizon_steps}: allowed is at most {task.max_episode_steps}, "
            "the length of the longest episode"
        )
    unknown = [name for name in config.dimensions if name not in task.state_names]
    if unknown:
        allowed = ", ".join(task.state_names)
        raise ConfigError(f"mapping.dimensions={list(config.dimensions)}: allowed are {allowed}")


def learn_vocabulary(
    log: TrajectoryLog, config: MappingConfig, task: Task, seed: int, last: ClusterMapping | None = None
) -> Refresh:
    """Learn the vocabulary from the best episodes of the log.

    Args:
        log: with whole episodes in it.
        config: see ``MappingConfig``.
        task: the environment's own names.
        seed: of the clustering; with the same log it gives the same vocabulary.
        last: the vocabulary so far; with ``config.warm_start`` its clusters are where the new ones start.

    Raises:
        TooLittleDataError: if there are too few episodes or windows for a vocabulary; the message says which.
    """
    index, contexts = log.index, log.context_names
    if not len(index):
        raise TooLittleDataError("no episode has ended yet")
    best = top_episodes(
        index["total_reward"], config.top_fraction, contexts if config.top_within == "context" else None
    )
    episodes = log.read(np.flatnonzero(best))
    top = cut_windows(episodes, config.horizon_steps, config.window_end)
    top = top[np.asarray(top.given)]
    if not len(top):
        longest = max(len(episode) for episode in episodes)
        raise TooLittleDataError(
            f"the best {len(episodes)} of {len(index)} episodes have no window of {config.horizon_steps} steps with "
            f"an instruction (the longest has {longest} steps)"
        )
    mapping = (
        _estimator(config, task, seed, last if config.warm_start else None).fit(top.delta, top.instruction).mapping_
    )
    return Refresh(
        frame=log.frames,
        mapping=mapping,
        top=top,
        others=_other_windows(log, ~best, config, seed) or top[:0],
        episodes_logged=len(index),
        episodes_used=len(episodes),
        episodes_by_context=_count(contexts[best], task.contexts),
        windows_by_context=_count(contexts[best][top.episode], task.contexts),
        windows_by_instruction=_count_instructions(top.instruction, task),
    )


def _estimator(config: MappingConfig, task: Task, seed: int, last: ClusterMapping | None) -> PaperMapping:
    return PaperMapping(
        n_clusters=config.n_clusters,
        normalisation=config.normalisation,
        dimensions=[task.state_names.index(name) for name in config.dimensions] or None,
        n_init=config.n_init,
        start=last.centre_changes() if last else None,
        max_fit_windows=config.max_fit_windows,
        random_state=seed,
    )


def _other_windows(log: TrajectoryLog, others: Array, config: MappingConfig, seed: int) -> Windows | None:
    rows = np.random.default_rng(seed).permutation(np.flatnonzero(others))[:OTHER_EPISODES]
    episodes: Sequence[Episode] = log.read(rows)
    if not episodes:
        return None
    windows = cut_windows(episodes, config.horizon_steps, config.window_end)
    return windows[np.asarray(windows.given)]


def _count(names: Array, all_names: Sequence[str]) -> dict[str, int]:
    return {name: int(np.sum(names == name)) for name in all_names}


def _count_instructions(instructions: Array, task: Task) -> dict[str, int]:
    """Windows by the value of the instruction; with several numbers each is counted under its own name."""
    values = [f"{value:+g}" if value else "0" for value in task.instruction_values]
    columns = instructions.T
    names = values if len(columns) == 1 else [f"{column}: {v}" for column in range(len(columns)) for v in values]
    counts = [int(np.sum(np.isclose(column, value))) for column in columns for value in task.instruction_values]
    return dict(zip(names, counts, strict=True))


def save_refresh(folder: Path, refresh: Refresh, config: MappingConfig, task: Task) -> Path:
    """Write a refresh as JSON, for people and for ``load_mapping``; returns the file."""
    mapping = refresh.mapping
    clusters = [
        {
            "id": i,
            "size": int(mapping.sizes[i]),
            "mean_instruction": mapping.mean_instructions[i].tolist(),
            "expression": mapping.expressions[i].tolist(),
            "phrase": phrase(mapping.expressions[i], task.phrases),
            "purity": float(mapping.purities[i]),
        }
        for i in range(len(mapping.sizes))
    ]
    path = folder / f"{refresh.frame:012d}.json"
    episodes = {"logged": refresh.episodes_logged, "used": refresh.episodes_used}
    windows = {"used": len(refresh.top), "by_context": refresh.windows_by_context}
    write_json(
        path,
        {
            "frame": refresh.frame,
            "horizon_steps": config.horizon_steps,
            "episodes": episodes | {"by_context": refresh.episodes_by_context},
            "windows": windows | {"by_instruction": refresh.windows_by_instruction},
            "clusters": clusters,
            "state_names": list(task.state_names),
            "mapping": mapping.to_dict(),
        },
    )
    return path


def load_mapping(path: Path) -> tuple[ClusterMapping, int, int]:
    """Read a saved refresh: the mapping, its horizon in steps, and the frame it was learnt at.

    Raises:
        ValueError: if the file is damaged.
    """
    try:
        saved: dict[str, Any] = json.loads(path.read_text())
        return ClusterMapping.from_dict(saved["mapping"]), int(saved["horizon_steps"]), int(saved["frame"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is not a readable refresh: {error}") from None
