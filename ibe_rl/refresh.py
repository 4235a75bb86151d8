"""Learn the vocabulary from the log as it stands, and say what it stands on."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping as Dict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.config import MappingConfig
from ibe_rl.data import Array, ConfigError, Episode, Task
from ibe_rl.ibe import (
    ClusterMapping,
    PaperMapping,
    TooLittleDataError,
    Transition,
    Windows,
    cut_windows,
    phrase,
    top_episodes,
)
from ibe_rl.log import TrajectoryLog
from ibe_rl.metrics import VocabularyDrift
from ibe_rl.run_folder import write_json

OTHER_EPISODES = 300
"""How many of the episodes that are not among the best are read for comparison."""


@dataclass(frozen=True)
class Change:
    """What a refresh changed.

    Attributes:
        last: the vocabulary before.
        since_frame: training frames when that was learnt.
        transition: what became of its clusters.
        drift: how far the new vocabulary is from it, on windows that are the same at every refresh.
        policy_drift: share of states, the same at every refresh, in which the policy acts otherwise than then.
        last_scores: see ``vocabulary_scores``; of the vocabulary before, on the newest episodes.
        staleness: by how much the new one puts these into words better than the one before (``motion_auc``).
    """

    last: ClusterMapping
    since_frame: int
    transition: Transition
    drift: VocabularyDrift
    policy_drift: float
    last_scores: Dict[str, float]
    staleness: float


@dataclass(frozen=True)
class Refresh:
    """A vocabulary and what it was learnt from.

    Attributes:
        frame: training frames when it was learnt.
        mapping: the vocabulary.
        top: the windows of the best episodes that it was learnt from.
        others: windows with an instruction of other episodes, a sample, for comparison only.
        episodes_logged: whole episodes in the log.
        episodes_counted: those of them that the best were chosen from.
        episodes_used: the best ones.
        episodes_by_context: of the best ones.
        windows_by_context: windows used, likewise.
        windows_by_instruction: windows used, by the instruction they began with.
        change: what came of the vocabulary before, None if this is the first.
        scores: see ``vocabulary_scores``; of this vocabulary, on the newest episodes.
        taken: False if the vocabulary before was good enough and stays.
    """

    frame: int
    mapping: ClusterMapping
    top: Windows
    others: Windows
    episodes_logged: int
    episodes_counted: int
    episodes_used: int
    episodes_by_context: Dict[str, int]
    windows_by_context: Dict[str, int]
    windows_by_instruction: Dict[str, int]
    change: Change | None = None
    scores: Dict[str, float] = field(default_factory=dict)
    taken: bool = True

    @property
    def standing(self) -> ClusterMapping:
        """The vocabulary that is spoken from now on."""
        return self.mapping if self.taken or self.change is None else self.change.last


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
        last: the vocabulary so far, where the new one starts unless ``config.memory`` is None.

    Raises:
        TooLittleDataError: if there are too few episodes or windows for a vocabulary; the message says which.
    """
    index, contexts = log.index, log.context_names
    if not len(index):
        raise TooLittleDataError("no episode has ended yet")
    counted = _counted(index["frame"], log.frames, config.newest_frames)
    best = np.zeros(len(index), bool)
    best[counted] = top_episodes(
        index["total_reward"][counted],
        config.top_fraction,
        contexts[counted] if config.top_within == "context" else None,
    )
    episodes = log.read(np.flatnonzero(best))
    top = cut_windows(episodes, config.horizon_steps, config.window_end)
    top = top[np.asarray(top.given)]
    if not len(top):
        longest = max(len(episode) for episode in episodes)
        raise TooLittleDataError(
            f"the best {len(episodes)} of {len(counted)} episodes have no window of {config.horizon_steps} steps with "
            f"an instruction (the longest has {longest} steps)"
        )
    return Refresh(
        frame=log.frames,
        mapping=_estimator(config, task, seed, last).fit(top.delta, top.instruction).mapping_,
        top=top,
        others=_other_windows(log, counted[~best[counted]], config, seed) or top[:0],
        episodes_logged=len(index),
        episodes_counted=len(counted),
        episodes_used=len(episodes),
        episodes_by_context=_count(contexts[best], task.contexts),
        windows_by_context=_count(contexts[best][top.episode], task.contexts),
        windows_by_instruction=_count_instructions(top.instruction, task),
    )


def _counted(ended_at: Array, frames: int, newest_frames: int | None) -> Array:
    """Rows of the episodes that count.

    Raises:
        TooLittleDataError: if there are none.
    """
    counted = np.flatnonzero(ended_at > (-1 if newest_frames is None else frames - newest_frames))
    if not len(counted):
        raise TooLittleDataError(f"no episode has ended in the newest {newest_frames:,} frames")
    return counted


def _estimator(config: MappingConfig, task: Task, seed: int, last: ClusterMapping | None) -> PaperMapping:
    return PaperMapping(
        n_clusters=config.n_clusters,
        normalisation=config.normalisation,
        dimensions=[task.state_names.index(name) for name in config.dimensions] or None,
        n_init=config.n_init,
        last=None if config.memory is None else last,
        memory=config.memory or 0.0,
        max_fit_windows=config.max_fit_windows,
        random_state=seed,
    )


def _other_windows(log: TrajectoryLog, others: Array, config: MappingConfig, seed: int) -> Windows | None:
    rows = np.random.default_rng(seed).permutation(others)[:OTHER_EPISODES]
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
            "id": int(mapping.ids[i]),
            "size": int(mapping.sizes[i]),
            "mean_instruction": mapping.mean_instructions[i].tolist(),
            "expression": mapping.expressions[i].tolist(),
            "phrase": phrase(mapping.expressions[i], task.phrases),
            "purity": float(mapping.purities[i]),
            "evidence": float(mapping.evidence[i]),
        }
        for i in range(len(mapping.sizes))
    ]
    path = folder / f"{refresh.frame:012d}.json"
    episodes = {"logged": refresh.episodes_logged, "counted": refresh.episodes_counted, "used": refresh.episodes_used}
    windows = {"used": len(refresh.top), "by_context": refresh.windows_by_context}
    write_json(
        path,
        {
            "frame": refresh.frame,
            "horizon_steps": config.horizon_steps,
            "episodes": episodes | {"by_context": refresh.episodes_by_context},
            "windows": windows | {"by_instruction": refresh.windows_by_instruction},
            "clusters": clusters,
            "scores": _without_nan(refresh.scores),
            "change": None if refresh.change is None else _change(refresh.change),
            "state_names": list(task.state_names),
            "mapping": mapping.to_dict(),
        },
    )
    return path


def _change(change: Change) -> dict[str, Any]:
    return {
        "since_frame": change.since_frame,
        "transition": change.transition.to_dict(),
        "vocabulary_drift": asdict(change.drift),
        "policy_drift": change.policy_drift,
        "scores_before": _without_nan(change.last_scores),
        **_without_nan({"staleness": change.staleness}),
    }


def _without_nan(values: Dict[str, float]) -> dict[str, float | None]:
    """JSON has no word for what cannot be told; null is the nearest."""
    return {name: None if math.isnan(value) else value for name, value in values.items()}


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
