"""Episodes for people to watch: flown beforehand with seeds, cut after the frames that are seen, explained in each arm.

A stimulus is one JSON file. What a person may not see before the answer is in it too; ``content`` leaves it out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.apps.paper.names import AT_CONTACT, AT_END
from ibe_rl.apps.study.arms import Asked, Speaker, SpokenFrames, expectations, words_of_others
from ibe_rl.apps.study.scenes import FORMAT, Scene, about_episode
from ibe_rl.apps.study.settings import IBE, PLACEBIC, TRUE_FUTURE
from ibe_rl.apps.study.told import ToldFrom
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.limits import nearest
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe.delta import delta_states
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.ibe.word_meaning import expected_motion
from ibe_rl.metrics.observer import Observer
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, ConfigError, Instructor, Policy

BY_LOT = "lot"
UNTIL = (AT_CONTACT, AT_END, BY_LOT)
"""What people are asked about: where it first touches, where the episode ends (the paper), or a moment drawn by lot."""
TRIES_EACH_STIMULUS = 10
"""Most episodes flown for each that is shown."""
MOST_PHRASES = 8
"""Phrases to choose from."""
_PLACES, _DIGITS, _MOVING = 3, 4, 2 / 3


@dataclass(frozen=True)
class CutEpisode:
    """An episode, cut where people are asked.

    Attributes:
        seed: of the episode.
        watched: the episode itself, with what is needed to draw it.
        last: step of the last frame that is seen.
        end: step that people are asked about.
        frames: how many are seen.
        told: what it is told from the last frame on; empty: what the instructor says.
    """

    seed: int
    watched: RecordedRollout
    last: int
    end: int
    frames: int
    told: str = ""

    @property
    def first(self) -> int:
        """Step of the first frame."""
        return self.last - self.frames + 1

    @property
    def states(self) -> Array:
        """Of the whole episode, ``(T + 1, S)``."""
        return self.watched.episode.states


def check_until(until: str | None, task: Task) -> str:
    """Until when a clip would go on: what was asked for, or else what suits the environment.

    Raises:
        ConfigError: if it is none of these, or the environment does not declare what it needs.
    """
    if until not in (None, *UNTIL):
        raise ConfigError(f"until={until}: allowed is one of {', '.join(UNTIL)}{nearest(str(until), UNTIL)}")
    if until == AT_CONTACT and task.first_contact is None:
        raise ConfigError(f"until={until}: {task.name} does not declare first_contact; allowed are {AT_END}, {BY_LOT}")
    return until or (BY_LOT if task.first_contact is None else AT_CONTACT)


def cut_episode(
    seed: int, watched: RecordedRollout, task: Task, horizon_steps: int, until: str, frames: int
) -> CutEpisode | None:
    """Cut an episode a horizon before the step that people are asked about; None if it is too short."""
    episode = watched.episode
    contact = len(episode) if task.first_contact is None else task.first_contact(episode.states)
    latest = contact - horizon_steps
    comes_down = task.first_contact is None or until == BY_LOT or episode.terminated
    if latest < frames or not comes_down:
        return None
    last = len(episode) - horizon_steps if until == AT_END else latest
    if until == BY_LOT:
        last = _drawn_step(episode.states, task, horizon_steps, range(frames, latest + 1), np.random.default_rng(seed))
    return CutEpisode(seed, watched, last, last + horizon_steps, frames)


def _drawn_step(states: Array, task: Task, horizon_steps: int, steps: range, random: np.random.Generator) -> int:
    """One of the steps; two times of three one after which it moves, as much as there are ways to go or to stay."""
    dimensions = list(task.explained)
    change = np.abs(states[[step + horizon_steps for step in steps]] - states[list(steps)])[:, dimensions]
    moves = (change > np.array(task.explained_band)).any(axis=1) == (random.random() < _MOVING)
    kind = np.array(steps)[moves]
    return int(random.choice(kind if len(kind) else np.array(steps)))


def cut_episodes(
    env: gymnasium.Env[Any, Any],
    task: Task,
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    horizon_steps: int,
    until: str,
    frames: int,
) -> Iterator[CutEpisode]:
    """Fly an episode for each seed, and cut those that suit."""
    for seed in seeds:
        found = cut_episode(seed, record_rollout(env, policy, instructor, seed), task, horizon_steps, until, frames)
        if found is not None:
            yield found


def told_otherwise(
    found: Iterator[CutEpisode], env: gymnasium.Env[Any, Any], task: Task, policy: Policy, instructor: Instructor
) -> Iterator[CutEpisode]:
    """Fly cut episodes again with the same seeds, told another value than before at the last frame that is seen.

    What it is told is drawn by lot. Those that then end before the step that people are asked about are left out.
    """
    for one in found:
        name, value = _another(one, task)
        watched = record_rollout(env, policy, ToldFrom(instructor, one.last, value), one.seed)
        if len(watched.episode) >= one.end:
            yield replace(one, watched=watched, told=name)


def _another(one: CutEpisode, task: Task) -> tuple[str, Array]:
    """One of the values that it was not being told."""
    before = one.watched.moments[one.last]
    others = [
        (name, value)
        for name, value in values_of(task).items()
        if not (before.given and np.array_equal(before.instruction, value))
    ]
    return others[np.random.default_rng(one.seed).integers(len(others))]


def balanced_episodes(
    found: Iterator[CutEpisode], scene: Scene, count: int, random: np.random.Generator, step: Callable[[], None]
) -> list[CutEpisode]:
    """The first episodes that end equally often at the left, in the middle and at the right of the picture.

    Where an agent does not go somewhere often enough, other episodes fill up.

    Args:
        found: episodes, as they come.
        scene: tells where they end.
        count: how many are wanted.
        random: draws their order.
        step: called for each that is chosen.

    Raises:
        ConfigError: if there are too few.
    """
    room = [count // _PLACES + (place < count % _PLACES) for place in range(_PLACES)]
    chosen: list[CutEpisode] = []
    spare: list[CutEpisode] = []
    for one in found:
        place = min(int(_PLACES * ends_at(one, scene)), _PLACES - 1)
        if room[place]:
            room[place] -= 1
            chosen.append(one)
            step()
        elif len(spare) < count:
            spare.append(one)
        if len(chosen) == count:
            break
    chosen += spare[: count - len(chosen)]
    if len(chosen) < count:
        raise ConfigError(
            f"{count} episodes are needed, {len(chosen)} are long enough for the frames that are seen and for what is "
            "explained, which comes after; allowed are fewer trials, fewer frames, or a run that learnt more"
        )
    return [chosen[index] for index in random.permutation(count)]


def ends_at(one: CutEpisode, scene: Scene) -> float:
    """Where it really is at the end, as a share of the width."""
    return float(scene.share(one.states[[one.end]])[0])


def stimuli_of(
    chosen: Sequence[CutEpisode],
    speaker: Speaker,
    observer: Observer,
    scene: Scene,
    frame_ms: float,
    random: np.random.Generator,
    step: Callable[[], None] = lambda: None,
) -> list[dict[str, Any]]:
    """Episodes as JSON, with all explanations.

    Args:
        chosen: at least two episodes.
        speaker: explains them.
        observer: simulated, calibrated before.
        scene: how they are drawn.
        frame_ms: time of a frame.
        random: deals the placebic words.
        step: called for each episode.
    """
    said: list[dict[str, SpokenFrames]] = []
    for one in chosen:
        steps = range(one.first, one.last + 1)
        spoken = speaker.say([one.watched.moments[at] for at in steps], one.told)
        said.append({**spoken, TRUE_FUTURE: speaker.really(real_changes(one, speaker.run.horizon_steps))})
        step()
    for each, placebo in zip(said, words_of_others([each[IBE] for each in said], random), strict=True):
        each[PLACEBIC] = placebo
    order = phrases_in_order(speaker, said)
    return [
        _stimulus(one, each, speaker, observer, scene, frame_ms, options_of(order, each, random))
        for one, each in zip(chosen, said, strict=True)
    ]


def _stimulus(
    one: CutEpisode,
    said: dict[str, SpokenFrames],
    speaker: Speaker,
    observer: Observer,
    scene: Scene,
    frame_ms: float,
    options: list[str],
) -> dict[str, Any]:
    asked = Asked(one.states[one.last - 1], one.states[one.last], one.end - one.last)
    return {
        "format": FORMAT,
        "size": list(scene.size),
        "frame_ms": frame_ms,
        "background": scene.background(one.watched),
        "frames": _frames(one, scene, range(one.first, one.last + 1)),
        "later": _frames(one, scene, range(one.last + 1, one.end + 1)),
        "phrases": options,
        "explanations": {arm: words.as_json() for arm, words in said.items()},
        **({"told": one.told} if one.told else {}),
        "truth": {"at": round(ends_at(one, scene), _DIGITS), "choice": options.index(said[TRUE_FUTURE].phrases[-1])},
        "observers": expectations(asked, said, speaker, observer, scene, options),
        **about_episode(one.seed, one.watched.episode),
    }


def real_changes(one: CutEpisode, horizon_steps: int) -> Array:
    """The real changes ``(frames, S)`` over the horizon from each frame, or to the end if that is sooner."""
    return delta_states(one.states, horizon_steps, "clamp")[one.first : one.last + 1]


def phrases_in_order(speaker: Speaker, said: Sequence[dict[str, SpokenFrames]]) -> list[str]:
    """The phrases of the vocabularies, those that were said and those that came true, from -1 to +1."""
    run = speaker.run
    known = [run.mapping, *([speaker.paper] if speaker.paper is not None else [])]
    order: dict[str, float] = {}
    for mapping in known:
        phrases = phrases_of(mapping.expressions, run.task.phrases).tolist()
        values = expected_motion(mapping, mapping.expressions, run.task.explained)[:, 0].tolist()
        for phrase, expression in zip(phrases, values, strict=True):
            order.setdefault(phrase, expression)
    for each in said:
        for words in each.values():
            for phrase, value, sure in zip(words.phrases, words.expressions, words.known, strict=True):
                if sure:
                    order.setdefault(phrase, value)
    return sorted(order, key=lambda phrase: order[phrase])


def options_of(order: Sequence[str], said: dict[str, SpokenFrames], random: np.random.Generator) -> list[str]:
    """Phrases to choose from: what came true, what any arm says last, and others up to ``MOST_PHRASES``."""
    needed = {words.phrases[-1] for words in said.values() if words.known[-1]}
    others = [phrase for phrase in order if phrase not in needed]
    room = max(0, MOST_PHRASES - len(needed))
    needed |= {others[index] for index in random.permutation(len(others))[:room]}
    return [phrase for phrase in order if phrase in needed]


def _frames(one: CutEpisode, scene: Scene, steps: range) -> list[list[dict[str, Any]]]:
    return [scene.frame(one.watched, step, one.first) for step in steps]
