"""What each arm says of an episode, and what simulated observers then expect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.apps.study.scenes import Scene
from ibe_rl.apps.study.settings import IBE, NONE, PAPER
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.explain.phrasing import AHEAD_STEPS, ExplainerState, put_in_words
from ibe_rl.explain.steady import say_steadily
from ibe_rl.explain.what_if import told_twins, values_of
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.ibe.word_meaning import expected_motion
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics.observer import Observer, carries_on
from ibe_rl.task import Task
from ibe_rl.types import Array, Explanation, ExpressionMapping, Instructor, Moment, Predictor

_DIGITS = 4


def instructor_of(run: TrainedRun) -> Instructor:
    """Who instructs the agent of a run."""
    return make_instructor(stand_in(run.config.instructor, run.folder), run.task)


@dataclass(frozen=True)
class SpokenFrames:
    """What is said at consecutive frames.

    Attributes:
        expressions: the first number of each, 0 where nothing is known; of words, the movement that they let expect.
        phrases: one a frame.
        known: False where the agent does not know.
    """

    expressions: tuple[float, ...]
    phrases: tuple[str, ...]
    known: tuple[bool, ...]

    def as_json(self) -> dict[str, Any]:
        """For the page."""
        return {"expressions": [round(one, _DIGITS) for one in self.expressions], "phrases": list(self.phrases)}

    def stretched(self, frames: int) -> SpokenFrames:
        """The same over another number of frames."""
        at = ((np.arange(frames) * len(self.phrases)) // frames).tolist()
        return SpokenFrames(
            tuple(self.expressions[index] for index in at),
            tuple(self.phrases[index] for index in at),
            tuple(self.known[index] for index in at),
        )


@dataclass(frozen=True)
class Speaker:
    """An agent that says what it will do, in its own vocabulary and in the paper's.

    Attributes:
        run: the agent.
        predictor: of its future.
        paper: the paper's vocabulary; None if none could be learnt.
        futures: sampled at each moment; what most of them are called is said.
        min_confidence: below it the agent says that it does not know. The paper's agent always says something.
    """

    run: TrainedRun
    predictor: Predictor
    paper: ClusterMapping | None
    futures: int
    min_confidence: float

    def say(self, moments: Sequence[Moment], if_told: str = "", every_steps: int = 1) -> dict[str, SpokenFrames]:
        """What it says at some moments, by arm.

        Args:
            moments: of one episode.
            if_told: what it would do if it were told this value; empty: what it will do.
            every_steps: from one moment to the next.
        """
        run, shape = self.run, (len(moments), self.futures)
        futures = [moment for moment in moments for _ in range(self.futures)]
        twins = told_twins(futures, {if_told: values_of(run.task)[if_told]}) if if_told else []
        predicted = self.predictor.rollout([*futures, *twins], run.policy, run.horizon_steps + max(AHEAD_STEPS))
        paths, trusted = predicted.paths[-len(futures) :], predicted.trusted_steps[-len(futures) :]
        paths = paths.reshape(*shape, *paths.shape[1:])
        words, steps = run.task.phrases, run.horizon_steps
        known = run.what_if_calibration if if_told else run.calibration
        states = {IBE: ExplainerState(run.mapping, steps, words, {}, self.futures, known, self.min_confidence)}
        if self.paper is not None:
            states[PAPER] = ExplainerState(self.paper, steps, words, {}, self.futures)
        said = {arm: put_in_words(paths, state, trusted.reshape(shape)) for arm, state in states.items()}
        said[IBE] = say_steadily(said[IBE], states[IBE], every_steps)
        return {arm: _spoken(said[arm], states[arm].mapping, run.task) for arm in states}

    def really(self, deltas: Array) -> SpokenFrames:
        """What its own vocabulary calls real changes ``(N, S)``."""
        expressions = self.run.mapping.express(deltas)
        phrases = phrases_of(expressions, self.run.task.phrases)
        values = expected_motion(self.run.mapping, expressions, self.run.task.explained)[:, 0]
        return SpokenFrames(tuple(values.tolist()), tuple(phrases.tolist()), (True,) * len(deltas))


def _spoken(said: Sequence[Explanation], mapping: ExpressionMapping, task: Task) -> SpokenFrames:
    values = expected_motion(mapping, np.array([one.expression for one in said]), task.explained)[:, 0]
    return SpokenFrames(
        tuple(float(value) if one.known else 0.0 for one, value in zip(said, values, strict=True)),
        tuple(one.said for one in said),
        tuple(one.known for one in said),
    )


def words_of_others(said: Sequence[SpokenFrames], random: np.random.Generator) -> list[SpokenFrames]:
    """Each episode gets the words of another one; all of them are said once, so no word is more or less frequent."""
    order = random.permutation(len(said))
    found = [*said]
    for one, other in zip(order, np.roll(order, 1), strict=True):
        found[one] = said[other].stretched(len(said[one].phrases))
    return found


@dataclass(frozen=True)
class Asked:
    """What simulated observers know of an episode when they are asked.

    Attributes:
        before: ``(S,)`` the last state but one that is seen.
        state: ``(S,)`` the last one.
        horizon_steps: until what is asked for.
    """

    before: Array
    state: Array
    horizon_steps: int


def expectations(
    asked: Asked,
    said: Mapping[str, SpokenFrames],
    speaker: Speaker,
    observer: Observer,
    scene: Scene,
    options: list[str],
) -> dict[str, dict[str, Any]]:
    """What the simulated observer expects with each arm's words, as truth is kept.

    Without words the motion goes on; if that is no option, the middle one is chosen. Where an agent does not know, it
    is as without words.

    Args:
        asked: what is seen.
        said: by arm.
        speaker: whose words.
        observer: calibrated before.
        scene: tells where a value is in the picture.
        options: phrases to choose from.
    """
    task, explained = speaker.run.task, speaker.run.task.explained[0]
    position, drift = asked.state[explained], asked.state - asked.before
    motion = drift[[explained]] if task.motion is None else task.motion(asked.state[None])[0, :1]
    goes_on = carries_on(np.array([position], float), motion.astype(float), asked.horizon_steps)[0]
    [phrase] = speaker.really(drift[None] * asked.horizon_steps).phrases

    def place(value: float) -> float:
        state = asked.state.astype(float)
        state[explained] = value
        return round(float(scene.share(state[None])[0]), _DIGITS)

    without = {"at": place(float(goes_on)), "choice": options.index(phrase) if phrase in options else len(options) // 2}
    found = {NONE: without}
    for arm, words in said.items():
        read = observer.reads(np.array([position], float), np.array(words.expressions[-1:]))[0]
        heard = {"at": place(float(read)), "choice": options.index(words.phrases[-1])} if words.known[-1] else without
        found[arm] = heard
    return found
