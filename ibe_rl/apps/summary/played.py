"""From an explained episode to its words: what was told, what it said, and what came, at every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ibe_rl.apps.summary.episode_in_words import DRAWN_EVERY_STEPS, PlayedEpisode
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe.delta import delta_states
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.metrics.as_told import not_as_told, ways_gone, ways_said, ways_told
from ibe_rl.metrics.quality import outcomes
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Episode, Explanation
from ibe_rl.view.wording import SILENCE


def put_steps_in_words(
    run: TrainedRun, seed: int, watched: RecordedRollout, said: Sequence[Explanation]
) -> PlayedEpisode:
    """An explained episode as the words of its steps, without the moments and most of the pictures."""
    episode, task = watched.episode, run.task
    expressions = np.array([one.expression for one in said], float)
    known = np.array([one.known for one in said], bool)
    changes = delta_states(episode.states, run.horizon_steps, end="clamp")
    given = np.asarray(episode.given, bool)
    told = ways_told(np.asarray(episode.instructions), task)
    tellable = given if task.words is None else given & run.mapping.knows(changes)
    return PlayedEpisode(
        seed=seed,
        watched=_thinned(watched),
        told=told_in_words(episode, task),
        said=[one.said for one in said],
        came=outcomes(episode, run.horizon_steps, run.mapping, task.phrases),
        expressions=expressions,
        came_expressions=run.mapping.express(changes),
        known=known,
        against=not_as_told(told, ways_gone(changes, run.mapping, task), tellable),
        said_against=not_as_told(told, ways_said(expressions, task), given & known),
        contact=None if task.first_contact is None else int(task.first_contact(episode.states)),
        paths=np.array([one.trusted_path for one in said[::DRAWN_EVERY_STEPS]], np.float32),
    )


def told_in_words(episode: Episode, task: Task) -> list[str]:
    """The instruction of each step in words."""
    pairs = zip(np.asarray(episode.instructions), episode.given, strict=True)
    return [phrase(instruction, task.phrases) if given else SILENCE for instruction, given in pairs]


def _thinned(watched: RecordedRollout) -> RecordedRollout:
    figures = [each if step % DRAWN_EVERY_STEPS == 0 else [] for step, each in enumerate(watched.figures)]
    return replace(watched, moments=[], figures=figures)
