"""Ways to learn the vocabulary of a finished run that differ from the paper's in one thing, or that lead to ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ibe_rl.ibe import ClusterMapping, IBEConfig, Windows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import Array
from ibe_rl.vocabulary.fitting import fit_windows
from ibe_rl.vocabulary.training_episodes import TrainingEpisodes, best_windows, read_training_episodes

AXIS: dict[str, Any] = {"space": "rule", "normalisation": "movement", "symmetric": True, "power": 1 / 3}
"""What configs/mapping/axis.yaml picks, in the order of the ladder."""
PAPER, OURS = "paper", "axis"


@dataclass(frozen=True)
class Variant:
    """One way to learn the vocabulary.

    Attributes:
        name: in tables.
        group: heading over it there.
        settings: of ``IBEConfig``, where they differ from the paper's.
        told_only: learn from windows whose instruction was not 0 only.
        named: "own"; or the clusters are named anew by the mean movement of their windows: "axis", along the
            instructor's axis; "explained", in the dimension that the task names by hand.
        by_hand: True if it uses which dimension the instructions speak of.
    """

    name: str
    group: str
    settings: dict[str, Any] = field(default_factory=dict)
    told_only: bool = False
    named: str = "own"
    by_hand: bool = False


def variants(task: Task, constant: Sequence[str] = ()) -> list[Variant]:
    """All of them, the paper's first.

    Args:
        task: the environment's own names.
        constant: state dimensions that never change over a window: to leave them out changes nothing.
    """
    names, x = task.state_names, task.state_names[task.explained[0]]
    return [
        Variant(PAPER, "the paper's"),
        Variant("without windows of instruction 0", "which windows", told_only=True),
        Variant("without windows cut short by the end", "which windows", {"window_end": "drop"}),
        Variant("without ends that failed", "which windows", {"failed_ends": "drop"}),
        Variant("best quarter of each context", "which windows", {"top_within": "context"}),
        Variant("all episodes", "which windows", {"top_fraction": 1.0}),
        Variant("followed windows weigh more", "which windows", {"weigh_followed": True}),
        *(Variant(f"k = {k}", "which clusters", {"n_clusters": k}) for k in (4, 16, 32, 64, 128)),
        Variant("soft membership", "which clusters", {"membership": "soft"}),
        *(
            Variant(f"without {name}", "which dimensions", {"dimensions": [n for n in names if n != name]})
            for name in names
            if name not in constant
        ),
        Variant("weighted by mutual information", "which dimensions", {"space": "information"}),
        Variant(f"{x} only", "which dimensions", {"dimensions": [x]}, by_hand=True),
        Variant("sign kept instead of min-max", "which names", {"normalisation": "sign"}),
        Variant("named by movement along the axis", "which names", named="axis"),
        Variant("the same, k = 64", "which names", {"n_clusters": 64}, named="axis"),
        Variant(f"named by movement in {x}", "which names", named="explained", by_hand=True),
        Variant(
            f"{x} only, named by movement in {x}", "which names", {"dimensions": [x]}, named="explained", by_hand=True
        ),
        *_ladder(),
        Variant("without its axis", "axis, less one part", {"symmetric": True}, named="axis"),
        Variant("without its names", "axis, less one part", AXIS | {"normalisation": "sign"}),
        Variant("without symmetry", "axis, less one part", AXIS | {"symmetric": False}),
        Variant("without the cube root", "axis, less one part", AXIS | {"power": 1.0}),
        Variant("without clusters", "axis, less one part", AXIS | {"membership": "direct"}),
        Variant("axis, followed windows weigh more", "axis, and one part more", AXIS | {"weigh_followed": True}),
        Variant("axis, without ends that failed", "axis, and one part more", AXIS | {"failed_ends": "drop"}),
        Variant("axis, best quarter of each context", "axis, and one part more", AXIS | {"top_within": "context"}),
        Variant("axis, soft membership", "axis, and one part more", AXIS | {"membership": "soft"}),
    ]


def _ladder() -> list[Variant]:
    """From the paper's to ours, each rung on top of the one before."""
    rungs = ("+ the instructor's axis", "+ named by movement", "+ symmetric", OURS)
    parts = list(AXIS)
    return [
        Variant(rung, "from the paper's to axis", {part: AXIS[part] for part in parts[: n + 1]})
        for n, rung in enumerate(rungs)
    ]


class School:
    """Learns variants from one log; what they share is read once.

    Args:
        log: of a finished run.
        base: the paper's settings, with the run's horizon.
        task: the environment's own.
    """

    def __init__(self, log: TrajectoryLog, base: IBEConfig, task: Task):
        self.base, self.task, self._log = replace(base, memory=None), task, log
        self._lessons: dict[tuple[Any, ...], TrainingEpisodes] = {}
        self._windows: dict[tuple[Any, ...], Windows] = {}
        self._axes: dict[int, ClusterMapping] = {}

    def lessons(self, config: IBEConfig) -> TrainingEpisodes:
        """The episodes that a variant learns from."""
        key = (config.top_fraction, config.top_within)
        if key not in self._lessons:
            self._lessons[key] = read_training_episodes(self._log, config, seed=0)
        return self._lessons[key]

    def windows(self, config: IBEConfig) -> Windows:
        """The windows that a variant learns from."""
        key = (config.top_fraction, config.top_within, config.window_end, config.failed_ends)
        if key not in self._windows:
            self._windows[key] = best_windows(self.lessons(config).best, config, config.horizon_steps)
        return self._windows[key]

    def learn(self, variant: Variant, seed: int) -> ClusterMapping:
        """Learn a vocabulary from nothing.

        Raises:
            TooLittleDataError: if the log does not carry one.
        """
        config = replace(self.base, **variant.settings)
        windows = self.windows(config)
        if variant.told_only:
            windows = windows[np.any(windows.instruction != 0, axis=1)]
        mapping = fit_windows(windows, self.lessons(config).heard, config, self.task, seed)
        if variant.named == "own":
            return mapping
        if variant.named == "explained":
            return renamed(mapping, windows.delta, windows.delta[:, self.task.explained[0]])
        return renamed(mapping, windows.delta, self.movement(windows.delta, seed))

    def movement(self, delta: Array, seed: int) -> Array:
        """How far changes ``(W, S)`` move along the instructor's axis, ``(W,)``; 1 is what the instruction 1 does."""
        if seed not in self._axes:
            config = replace(self.base, space="rule")
            windows, heard = self.windows(config), self.lessons(config).heard
            self._axes[seed] = fit_windows(windows, heard, config, self.task, seed)
        return self._axes[seed].space.place(delta)[:, 0]


def renamed(mapping: ClusterMapping, delta: Array, movement: Array) -> ClusterMapping:
    """Call each cluster by the mean ``movement`` ``(W,)`` of the changes ``(W, S)`` in it, the farthest being 1."""
    labels = mapping.cluster(delta)
    sizes = np.bincount(labels, minlength=len(mapping.sizes))
    means = np.bincount(labels, movement, len(sizes)) / np.maximum(sizes, 1)
    return replace(mapping, expressions=(means / (np.abs(means).max() or 1))[:, None])
