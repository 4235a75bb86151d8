"""The lesson: an instructor whose instructions come from the person who watches this environment."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.apps.teach.clock import Clock
from ibe_rl.apps.teach.live_explainer import LiveExplainer, explanation_fields, what_if_fields
from ibe_rl.apps.teach.outcomes import Outcomes
from ibe_rl.apps.teach.server import Server
from ibe_rl.apps.teach.session import NOBODY, ORACLE, Said, TeachingSession
from ibe_rl.envs.snapshots import stoppable
from ibe_rl.envs.wrappers import drawn, task_of
from ibe_rl.instructors.recorded import LessonWriter, RecordedEpisode
from ibe_rl.instructors.taught import NOT_TAUGHT, Told, told_of
from ibe_rl.task import PERCEPT, Task
from ibe_rl.types import Array, Explanation, Moment

FRAME_S = 0.004
"""Shortest interval between two frames; no screen shows more."""


class Stage(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The environment that a person watches, with the score of its episode.

    Attributes:
        total_reward: return of the episode so far.
        steps: length of the episode so far.
        success: whether it has ended in success.
        ended: the same of the previous episode, None if it had no step.
        percept: what the agent perceives now; None where that is the state.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]):
        super().__init__(env)
        self.total_reward, self.steps, self.success = 0.0, 0, False
        self.ended: dict[str, Any] | None = None
        self.percept: Array | None = None

    def reset(self, **settings: Any) -> Any:
        """See ``gymnasium.Env``."""
        score = {"return": round(self.total_reward, 1), "steps": self.steps, "success": self.success}
        self.ended = score if self.steps else None
        self.total_reward, self.steps, self.success = 0.0, 0, False
        state, info = self.env.reset(**settings)
        self.percept = info.get(PERCEPT)
        return state, info

    def step(self, action: Any) -> Any:
        """See ``gymnasium.Env``."""
        after = self.env.step(action)
        self.total_reward += float(after[1])
        self.steps += 1
        self.percept = after[4].get(PERCEPT)
        self.success = bool(after[4][task_of(self.env).success_key])
        return after


class Lesson:
    """The instructor of one environment; shows each step on the pages and records it.

    Args:
        stage: the environment.
        desk: the teaching session.
        server: serves the pages.
        speaker: explains what the agent does.
        clock: paces the steps.
        record: writes the instructions of each episode.
    """

    def __init__(
        self,
        stage: Stage,
        desk: TeachingSession,
        server: Server,
        speaker: LiveExplainer,
        clock: Clock,
        record: LessonWriter,
    ):
        self._stage, self._desk, self._server, self._speaker = stage, desk, server, speaker
        self._clock, self._record, self._task = clock, record, task_of(stage)
        self._episode, self._shown_at = -1, 0.0
        self._said: list[tuple[Array, Said]] = []
        self.outcomes = Outcomes(self._task)
        self._writing, self._finished = threading.Lock(), False

    def reset(self, rows: Array) -> None:
        """Write the previous episode's record and begin a new one."""
        if not rows[0]:
            return
        self.keep()
        self._episode += 1
        self._desk.begin(self._episode)
        if self._stage.ended is not None:
            self._server.post("ended", {"episode": self._episode - 1, **self._stage.ended})
        shown = scene(self._stage, self._episode)
        self.outcomes.begin(shown)
        self._server.post("scene", shown)

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``; returns when the step is due."""
        if rows[0]:
            self._show(states[0])
            self._clock.wait()
            said = self._desk.take()
            with self._writing:
                self._said.append((self._number(said, states[:1]), said))
        instruction, given = self._last()
        return instruction[None], np.array([[given]], np.float32)

    @property
    def told(self) -> Told:
        """See ``ibe_rl.instructors.mixed.Teacher``."""
        if not self._said:
            return NOT_TAUGHT
        said = self._said[-1][1]
        mark = (0, 0) if said.wrong is None else (self._episode - said.wrong.episode + 1, said.wrong.step)
        return told_of(said.by, mark)

    def keep(self) -> None:
        """Write the episode so far, and begin the next record."""
        with self._writing:
            self._write()
            self._said = []

    def finish(self) -> None:
        """Write the episode so far and nothing after it; any thread may call this.

        The environment may still be stepped to the end of a batch, which is not learnt from.
        """
        with self._writing:
            self._write()
            self._finished = True

    def _write(self) -> None:
        if self._said and not self._finished:
            self._record.write(
                RecordedEpisode(
                    self._episode,
                    instructions=[value.tolist() for value, _ in self._said],
                    given=[int(self._given(value, said)) for value, said in self._said],
                    by=[said.by for _, said in self._said],
                    heard=[said.heard for _, said in self._said],
                    words=[] if self._task.words is None else [told(value, self._task)[1] for value, _ in self._said],
                    marks=[
                        [step, said.wrong.episode, said.wrong.step]
                        for step, (_, said) in enumerate(self._said)
                        if said.wrong
                    ],
                )
            )

    def _number(self, said: Said, states: Array) -> Array:
        if said.by == ORACLE:
            return np.asarray(self._task.rule(states)[0], np.float32)
        if self._task.words is not None and said.value is not None:
            return self._task.words.one_hot(int(said.value))
        return np.full(self._task.instruction_size, said.value or 0.0, np.float32)

    def _last(self) -> tuple[Array, float]:
        if not self._said:
            return np.zeros(self._task.instruction_size, np.float32), 0.0
        value, said = self._said[-1]
        return value, float(self._given(value, said))

    def _given(self, value: Array, said: Said) -> bool:
        """Whether anything was said; a rule in words may be silent."""
        return said.by != NOBODY and (self._task.words is None or bool(value.any()))

    def _show(self, state: Array) -> None:
        """Post the current frame: the scene, the instruction of the previous step, the explanation."""
        now = time.monotonic()
        if now - self._shown_at < FRAME_S and self._said:
            return
        self._shown_at = now
        frame = self._frame(state)
        self._server.post("frame", frame)
        if outcome := self.outcomes.step(len(self._said), state, frame["shapes"]):
            self._server.post("outcome", outcome)
        if self._speaker.due():
            instruction, given = self._last()
            moment = Moment(state.copy(), instruction, bool(given), self._snapshot(), self._stage.percept)
            step = len(self._said)
            hear = partial(self._explained, self._episode, step, moment.state)
            self._speaker.ask(moment, hear, self._episode, step)

    def _explained(self, episode: int, step: int, state: Array, said: Explanation) -> None:
        """Post an explanation; runs in the explainer's thread."""
        fields = {**explanation_fields(said, self._task), **what_if_fields(said, self._task.scene_path)}
        self._server.post("explanation", {"episode": episode, "step": step, **fields})
        if self._speaker.explainer is not None:
            self.outcomes.hear(episode, step, state, said, self._speaker.explainer)

    def _snapshot(self) -> Any:
        game = stoppable(self._stage.env)
        return game.snapshot() if game else None

    def _frame(self, state: Array) -> dict[str, Any]:
        value, said = self._said[-1] if self._said else (None, Said(None, NOBODY, 0))
        at = None if self._task.scene_path is None else self._task.scene_path(state).round(2).tolist()
        instruction, word = (None, None) if said.by == NOBODY or value is None else told(value, self._task)
        return {
            "episode": self._episode,
            "step": len(self._said),
            "shapes": outlines(self._stage, "figure"),
            "at": at,
            "instruction": instruction,
            "word": word,
            "by": said.by,
            "heard": said.heard,
            "return": round(self._stage.total_reward, 1),
        }


def told(instruction: Array, task: Task) -> tuple[float | None, str | None]:
    """An instruction ``(d,)`` as a page shows it: a number, or a slot and its word; None for no word."""
    if task.words is None:
        return float(instruction[0]), None
    slot = int(np.argmax(instruction))
    return (float(slot), task.words.name_at(slot)) if instruction[slot] else (None, None)


def scene(stage: Stage, episode: int) -> dict[str, Any]:
    """The static part of an episode's scene."""
    return {
        "episode": episode,
        "size": list(task_of(stage).scene_size),
        "background": outlines(stage, "background"),
    }


def outlines(game: gymnasium.Env[Any, Any], part: str) -> list[dict[str, Any]]:
    """The outlines of a part of the scene, for environments that provide them."""
    return [
        {"points": shape.points.round(2).tolist(), "colour": list(shape.colour), "closed": shape.closed}
        for shape in drawn(game, part)
    ]
