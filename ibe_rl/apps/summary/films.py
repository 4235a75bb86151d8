"""An episode as a film, where the environment draws it, and as lanes of phrases over time, which every one has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ibe_rl.apps.study.scenes import Scene, as_json
from ibe_rl.apps.summary.episode_in_words import DRAWN_EVERY_STEPS, PlayedEpisode
from ibe_rl.task import Shape, Task
from ibe_rl.types import Array

FILM_PICTURES, PATH_POINTS = 100, 12
"""Of a film, and of a predicted path in it."""
_DOT = 0.006
"""Half the width of a point of the path, as a share of the scene's width."""
LANE_NAMES = {"told": "told", "said": "says", "came": "came"}
"""Columns of an episode to the names of their lanes."""


def film_of(one: PlayedEpisode, task: Task, colours: Mapping[str, Sequence[int]]) -> dict[str, Any]:
    """An episode for the page.

    Args:
        one: the episode.
        task: of its environment.
        colours: of the phrases.

    Returns:
        ``steps``; ``lanes``: of each the ``spans`` of equal words, as first step, steps and text; ``at``: the step of
        each picture; and where the environment is drawn ``size``, ``background`` and ``pictures``, lists of shapes.
    """
    at = list(range(0, len(one), DRAWN_EVERY_STEPS * _sparse(len(one))))
    lanes = [{"name": name, "spans": spans_of(getattr(one, column))} for column, name in LANE_NAMES.items()]
    film: dict[str, Any] = {"steps": len(one), "lanes": lanes, "at": at}
    if task.scene_path is None and not one.watched.figures[0]:
        return film
    scene = Scene(task, (float(task.scene_size[0]), float(task.scene_size[1])))
    pictures = [[*_ahead(one, step, scene, colours), *scene.frame(one.watched, step, 0)] for step in at]
    return film | {"size": list(scene.size), "background": scene.background(one.watched), "pictures": pictures}


def _sparse(steps: int) -> int:
    """Of the kept pictures, every so many are shown."""
    return -(-steps // (DRAWN_EVERY_STEPS * FILM_PICTURES))


def spans_of(words: Sequence[str]) -> list[tuple[int, int, str]]:
    """Stretches of equal words: first step, how many steps, the words.

    >>> spans_of(["left", "left", "right"])
    [(0, 2, 'left'), (2, 1, 'right')]
    """
    groups = [list(steps) for _, steps in groupby(range(len(words)), key=words.__getitem__)]
    return [(steps[0], len(steps), words[steps[0]]) for steps in groups]


def _ahead(one: PlayedEpisode, step: int, scene: Scene, colours: Mapping[str, Sequence[int]]) -> list[dict[str, Any]]:
    """The way that it says it will go, as points in the colour of what it says; none where nothing places a path."""
    if scene.task.scene_path is None:
        return []
    path = scene.points(one.paths[step // DRAWN_EVERY_STEPS])
    some = path[np.linspace(0, len(path) - 1, PATH_POINTS).astype(int)]
    red, green, blue = colours[one.said[step]]
    return [as_json(Shape(_diamond(point, _DOT * scene.size[0]), (red, green, blue), closed=True)) for point in some]


def _diamond(middle: Array, half: float) -> Array:
    return middle + half * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
