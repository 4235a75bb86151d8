"""The paper's prediction task: who watches the beginning of an approach foretells where it will end.

The observers are simulated and fixed beforehand (``ibe_rl.metrics.observer``); they are no people.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    DEFAULT,
    NO_WORDS,
    PAPERS,
    PREDICTED_CHANGE,
    SHUFFLED,
    STRAIGHT,
    SWAPPED,
    TRUE_END,
)
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.evaluation.controls import Flipped
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.explain.phrasing import majority_phrases
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.metrics.bootstrap import Estimate, episode_weights, estimate, weighted_mean
from ibe_rl.metrics.effect import paired_p
from ibe_rl.metrics.observer import Observer, carries_on, observer_errors
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, ExpressionMapping, Instructor, Policy, Predictor

COMPARED = (
    *(
        (DEFAULT, NO_WORDS),
        (PAPERS, NO_WORDS),
        (DEFAULT, PAPERS),
        (DEFAULT, STRAIGHT),
        (DEFAULT, SWAPPED),
        (DEFAULT, SHUFFLED),
    ),
    (NO_WORDS, STRAIGHT),
)
"""Whose errors are tested against whose."""


@dataclass(frozen=True)
class ShownEpisode:
    """An episode of the task.

    Attributes:
        seed: of the episode.
        watched: the episode itself, with what is needed to draw it.
        ends: cut to the step at which what is foretold is reached.
    """

    seed: int
    watched: RecordedRollout
    ends: dict[str, int]


def pick_episodes(
    env: gymnasium.Env[Any, Any],
    task: Task,
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    count: int,
    horizon_steps: int,
    step: Callable[[], None] = lambda: None,
) -> list[ShownEpisode]:
    """Fly until there are enough episodes: the first ones that come down and are long enough before they touch."""
    assert task.first_contact is not None
    found: list[ShownEpisode] = []
    for seed in seeds:
        watched = record_rollout(env, policy, instructor, seed)
        contact = task.first_contact(watched.episode.states)
        if watched.episode.terminated and contact >= SEEN_STEPS + horizon_steps:
            found.append(ShownEpisode(seed, watched, {AT_END: len(watched.episode), AT_CONTACT: contact}))
            step()
        if len(found) == count:
            break
    return found


@dataclass(frozen=True)
class ObservedEpisodes:
    """The prediction task with one agent at one cut: what observers of ``E`` episodes hear, and what they expect.

    Attributes:
        shown: ``E`` episodes.
        cut: where they end.
        task: with ``scene_path``.
        horizon_steps: from the last frame that observers see to the end.
        vocabularies: the paper's and ours.
        said: vocabulary to the expressions ``(E, SEEN_STEPS)`` at the frames they see, the last one as they foretell.
        position: ``(E,)`` where it is then.
        end: ``(E,)`` where it really ends.
        expected: observer to the ends that it expects ``(V, E)``, one row for each of its vocabularies.
    """

    shown: Sequence[ShownEpisode]
    cut: str
    task: Task
    horizon_steps: int
    vocabularies: dict[str, ClusterMapping]
    said: dict[str, Array]
    position: Array
    end: Array
    expected: dict[str, Array]

    def errors(self) -> dict[str, Array]:
        """Observer to its error in each episode ``(E,)``, in % of the width; the mean over its vocabularies."""
        width = self.task.explained_range[0]
        return {
            name: np.mean([observer_errors(row, self.end, width) for row in rows], axis=0)
            for name, rows in self.expected.items()
        }

    def last_seen(self, row: int) -> int:
        """The step at which the observers foretell."""
        return self.shown[row].ends[self.cut] - self.horizon_steps

    def path(self, row: int, first: int, last: int) -> Array:
        """The way ``(n, 2)`` in scene units from one step to another, both included."""
        assert self.task.scene_path is not None
        return self.task.scene_path(self.shown[row].watched.episode.states[first : last + 1])

    def place(self, row: int, expected: float) -> Array:
        """Where ``(2,)`` in the scene it would be at the end, had the explained dimension this value."""
        assert self.task.scene_path is not None
        state = self.shown[row].watched.episode.states[self.shown[row].ends[self.cut]].copy()
        state[self.task.explained[0]] = expected
        return self.task.scene_path(state)


def ask_observers(
    shown: Sequence[ShownEpisode],
    cut: str,
    policy: Policy,
    predictor: Predictor,
    vocabularies: dict[str, ClusterMapping],
    shuffled: Sequence[ExpressionMapping],
    observer: Observer,
    task: Task,
    horizon_steps: int,
    futures: int,
) -> ObservedEpisodes:
    """Let the agent say at every frame that is shown what it will do, and the observers foretell at the last one.

    Args:
        shown: ``E`` episodes.
        cut: where they end.
        policy: that flew them.
        predictor: draws its own noise.
        vocabularies: the paper's and ours.
        shuffled: vocabularies that cannot be right.
        observer: calibrated before.
        task: with ``motion``.
        horizon_steps: from the last frame shown to the end.
        futures: sampled at each frame; what most of them are called is said.
    """
    assert task.motion is not None
    lasts = [one.ends[cut] - horizon_steps for one in shown]
    moments = [
        one.watched.moments[step]
        for one, last in zip(shown, lasts, strict=True)
        for step in range(last - SEEN_STEPS + 1, last + 1)
    ]
    paths = predictor.rollout([moment for moment in moments for _ in range(futures)], policy, horizon_steps).paths
    deltas = (paths[:, -1] - paths[:, 0]).reshape(len(shown), SEEN_STEPS, futures, -1)
    states = np.array([one.watched.episode.states[last] for one, last in zip(shown, lasts, strict=True)])
    ends = np.array([one.watched.episode.states[one.ends[cut]] for one in shown])
    position, end = (each[:, task.explained[0]].astype(float) for each in (states, ends))
    said = {name: _say(mapping, deltas, task) for name, mapping in vocabularies.items()}
    said |= {SWAPPED: _say(Flipped(vocabularies[DEFAULT]), deltas[:, -1:], task)}
    others = [observer.reads(position, _say(mapping, deltas[:, -1:], task)[:, -1]) for mapping in shuffled]
    expected = {
        STRAIGHT: position[None],
        NO_WORDS: carries_on(position, task.motion(states)[:, 0].astype(float), horizon_steps)[None],
        **{name: observer.reads(position, words[:, -1])[None] for name, words in said.items()},
        SHUFFLED: np.array(others),
        PREDICTED_CHANGE: (position + deltas[:, -1, 0, task.explained[0]])[None],
        TRUE_END: end[None],
    }
    heard = {name: said[name] for name in vocabularies}
    return ObservedEpisodes(shown, cut, task, horizon_steps, vocabularies, heard, position, end, expected)


def _say(mapping: ExpressionMapping, deltas: Array, task: Task) -> Array:
    """The expressions ``(E, T)`` of what most futures ``(E, T, F, S)`` are called."""
    flat = deltas.reshape(-1, *deltas.shape[2:])
    _, which, _ = majority_phrases(flat, mapping, task.phrases)
    return mapping.express(flat[np.arange(len(flat)), which])[:, 0].reshape(deltas.shape[:2])


def error_tests(
    errors: dict[str, Array], resamples: int, seed: int
) -> tuple[dict[str, Estimate], list[dict[str, Any]]]:
    """Mean errors with intervals over the episodes, and the tests that are paired by episode; p not yet corrected."""
    count = len(errors[NO_WORDS])
    weights = episode_weights(np.arange(count), resamples, seed)
    means = {name: estimate(weighted_mean(each, weights)) for name, each in errors.items()}
    tests = [
        {
            "explainer": one,
            "minus": other,
            "difference": estimate(weighted_mean(errors[one] - errors[other], weights)).to_dict(),
            "better_episodes": int(np.sum(errors[one] < errors[other])),
            "worse_episodes": int(np.sum(errors[one] > errors[other])),
            "p": paired_p(errors[one] - errors[other], seed=seed),
        }
        for one, other in COMPARED
    ]
    return means, tests


def most_telling(errors: dict[str, Array], explainer: str) -> tuple[int, int]:
    """The episodes in which an explanation helps most and misleads most, against none."""
    gain = errors[NO_WORDS] - errors[explainer]
    return int(np.argmax(gain)), int(np.argmin(gain))
