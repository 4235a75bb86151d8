"""What the pages are told of what the agent has understood: during the lesson, and in sum after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import sayable
from ibe_rl.ibe.meaning_lines import meaning_lines
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.instructors.cloned import MIN_STEPS, ClonedInstructor
from ibe_rl.instructors.taught import taught_episodes, taught_rows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import CANNOT_TELL, Array, Episode
from ibe_rl.view.palette import of_clusters
from ibe_rl.vocabulary.lateness import in_words
from ibe_rl.vocabulary.refresh import Refresh
from ibe_rl.vocabulary.who_is_late import TEACHER, Delays
from ibe_rl.vocabulary.words import MEANS_NOTHING

FEW_WINDOWS = 50
"""A word with fewer windows in good episodes has hardly been heard there."""
CHECKED_EPISODES = 60


def vocabulary(frame: int, explainer: ExplainerState, task: Task) -> dict[str, Any]:
    """The vocabulary as a page displays it; of words, the number of a cluster is the share of its first word."""
    mapping = explainer.mapping
    assert isinstance(mapping, ClusterMapping)
    known = sayable(mapping.expressions, mapping.meanings)
    columns = (
        mapping.ids.tolist(),
        _first(mapping.expressions, task).tolist(),
        _first(mapping.mean_instructions, task).tolist(),
        np.where(known, phrases_of(mapping.expressions, task.phrases), CANNOT_TELL).tolist(),
        (mapping.sizes / mapping.sizes.sum()).tolist(),
        of_clusters(mapping.ids).tolist(),
        known.tolist(),
    )
    names = ("id", "expression", "mean_instruction", "phrase", "share", "colour", "known")
    clusters = [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
    meaning = meaning_lines(mapping.meanings, task)
    return {"frame": frame, "horizon_steps": explainer.horizon_steps, "clusters": clusters, "meaning": meaning}


def _first(values: Array, task: Task) -> Array:
    return values[:, 0] if task.words is None else values.max(axis=1)


def understanding_line(refresh: Refresh, task: Task) -> str:
    """In one line, what the agent has understood and what it lacks."""
    counts = heard_windows(refresh, task)
    known = known_words(refresh.standing, task)
    rare = [name for name, count in counts.items() if count < FEW_WINDOWS]
    unclear = [name for name in counts if name not in known and name not in rare]
    has, lacks = _listed(known), _listed(rare, "or")
    parts = [f"I understand {has}." if known else "I do not understand your words yet."]
    parts += [f"I have not heard {lacks} in good episodes yet."] if rare else []
    parts += [f"I have heard {_listed(unclear)}, but cannot tell what that means."] if unclear and known else []
    parts += [f"{one.text[0].upper()}{one.text[1:]}." for one in refresh.word_notices if one.kind != MEANS_NOTHING]
    return " ".join([*parts, *_lateness(refresh)])


def heard_windows(refresh: Refresh, task: Task) -> dict[str, int]:
    """Windows in good episodes by number, or by word as it is called now."""
    counts = refresh.windows_by_instruction
    if task.words is None:
        return dict(counts)
    names = task.words.names
    return dict(zip(names, [*counts.values(), *[0] * len(names)], strict=False))


def known_words(mapping: ClusterMapping, task: Task) -> list[str]:
    """What the person can say whose meaning is known: words, or numbers with their sign."""
    meanings = mapping.meanings
    if task.words is not None:
        return [name for name, one in zip(task.words.names, meanings, strict=False) if one.known]
    if not meanings:
        return []
    of_sign = {-1: meanings[0].negative, 0: meanings[0].known, 1: meanings[0].positive}
    return [f"{value:+g}" if value else "0" for value in task.instruction_values if of_sign[int(np.sign(value))]]


def lateness_message(delays: Delays) -> dict[str, Any] | None:
    """How late the person is, as a page displays it; None if they have said nothing yet."""
    late = delays.get(TEACHER)
    return None if late is None else {**asdict(late), "text": in_words(TEACHER, late)}


def _lateness(refresh: Refresh) -> list[str]:
    """How late the person is, in a sentence; nothing where that is not known."""
    late = refresh.delays.get(TEACHER)
    return [f"{in_words(TEACHER, late).capitalize()}."] if late is not None and late.known and late.steps else []


def not_yet(episodes: int, needed: int) -> str:
    """Before the first vocabulary."""
    return f"I look for what your words mean once I have seen {needed} episodes; so far {episodes}."


def consistency(episodes: Sequence[Episode]) -> float | None:
    """Share of steps at which a person says what they say in similar states of their other episodes.

    Silence counts as something said. None if there is too little to compare.
    """
    halves, agreed = (episodes[::2], episodes[1::2]), []
    for taught, other in (halves, halves[::-1]):
        clone = ClonedInstructor(taught[0].instructions.shape[1]) if taught and other else None
        if clone is None or sum(map(len, taught)) < MIN_STEPS:
            return None
        columns = [(one.states[:-1], one.instructions, one.given[:, None]) for one in taught]
        clone.learn(*(np.concatenate(column) for column in zip(*columns, strict=True)))
        for one in other:
            said, given = clone.instruct(one.states[:-1], np.ones(len(one), bool))
            agreed.append(((said == one.instructions).all(axis=1)) & (given[:, 0] == one.given))
    return float(np.mean(np.concatenate(agreed)))


def lesson_summary(log: TrajectoryLog, task: Task, refresh: Refresh | None) -> dict[str, Any]:
    """What a person has taught, for the page after the lesson.

    Args:
        log: of the run.
        task: of the environment.
        refresh: the last one; None if no vocabulary has been learnt.
    """
    rows = taught_rows(log)[-CHECKED_EPISODES:]
    episodes, marked = taught_episodes(log, rows.tolist())
    spoken = [one for one in episodes if np.any(one.given)]
    counts = _said(spoken, task)
    heard = heard_windows(refresh, task) if refresh else {}
    mapping = refresh.standing if refresh else None
    return {
        "episodes": len(episodes),
        "marked": marked,
        "words": [
            {"word": name, "said_steps": counts.get(name, 0), "in_good_episodes": heard.get(_short(name, task), 0)}
            for name in counts
        ],
        "meaning": meaning_lines(mapping.meanings, task) if mapping else [],
        "delay": lateness_message(refresh.delays) if refresh else None,
        "understood": understanding_line(refresh, task) if refresh else "I have not learnt a vocabulary.",
        "consistency": consistency(spoken),
    }


def _said(episodes: Sequence[Episode], task: Task) -> dict[str, int]:
    """Steps at which each word, or number, was given."""
    values = values_of(task)
    return {
        name: sum(int(np.sum(one.given & (one.instructions == value).all(axis=1))) for one in episodes)
        for name, value in values.items()
    }


def _short(name: str, task: Task) -> str:
    """The name under which windows are counted: of numbers, the number."""
    if task.words is not None:
        return name
    value = float(values_of(task)[name][0])
    return f"{value:+g}" if value else "0"


def _listed(names: Sequence[str], last: str = "and") -> str:
    quoted = [f"'{name}'" for name in names]
    return f" {last} ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
