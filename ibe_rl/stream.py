"""A run as a rerun recording: curves, vocabularies and watched episodes, written to a file and nowhere else.

A viewer that hangs can block whoever sends to it, so nothing here opens a connection; ``ibe_rl.relay`` serves
the growing file from a process of its own.

Two timelines: ``frames``, training frames, step j of an episode watched at frame F lying at F + j; and
``watched_step``, which counts the steps of all watched episodes one after the other, so that playing it is a
film of them, each with the vocabulary of its time. Curves are on ``frames`` only.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

import numpy as np
import rerun as rr

from ibe_rl import picture, view
from ibe_rl.data import Array, Explanation, Task, Watched
from ibe_rl.ibe import phrase

if TYPE_CHECKING:
    from ibe_rl.refresh import Refresh

APPLICATION = "ibe_rl"
SILENCE = "(silent)"
HOLD_S = 30.0
"""Longest time that rows of curves wait to be sent. They wait at all because a viewer that follows the newest
data would leave the watched episode with every batch."""


@dataclass(frozen=True)
class _Place:
    """Where something begins on both timelines."""

    frame: int
    step: int

    def columns(self, steps: Array | Sequence[int]) -> list[rr.TimeColumn]:
        offsets = np.asarray(steps, dtype=np.int64)
        return [
            rr.TimeColumn(view.FRAMES, sequence=self.frame + offsets),
            rr.TimeColumn(view.WATCHED_STEP, sequence=self.step + offsets),
        ]


class NoRecorder:
    """Takes what a ``Recorder`` takes and writes nothing."""

    def batch(self, frames: int, values: Mapping[str, float]) -> None:
        """Do nothing."""

    def refresh(self, refresh: Refresh) -> None:
        """Do nothing."""

    def skipped(self, frames: int, reason: str) -> None:
        """Do nothing."""

    def watched(self, frames: int, watched: Watched, said: Sequence[Explanation]) -> None:
        """Do nothing."""

    def flush(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class Recorder:
    """Writes one run to one file.

    Args:
        path: the file, written anew; its folder must exist.
        task: what the environment declares of itself.
        run_name: title of the recording in the viewer.
        training: False lays out the panels for watched episodes alone.
    """

    def __init__(self, path: Path, task: Task, run_name: str, training: bool = True) -> None:
        self._task = task
        self._recording = rr.RecordingStream(APPLICATION, recording_id=str(uuid4()))
        self._recording.set_sinks(rr.FileSink(path), default_blueprint=view.blueprint(task, training))
        self._recording.set_log_time_enabled(False)
        self._recording.send_recording_name(run_name)
        view.style(self._recording, task)
        self._next = _Place(0, 0)
        self._curves: dict[str, list[tuple[int, float]]] = defaultdict(list)
        self._sent_at = time.monotonic()
        self._vocabulary: Refresh | None = None
        self._shades: dict[str, Array] = {}  # of each phrase, as it was first said
        self._open = True

    def batch(self, frames: int, values: Mapping[str, float]) -> None:
        """Add one row of training curves; it is sent with the next refresh or episode, or after ``HOLD_S``.

        Args:
            frames: training frames so far.
            values: metric to value; any may be missing, those that are not finite are left out.
        """
        for key, value in values.items():
            if key != view.FRAMES and math.isfinite(value):
                self._curves[key].append((frames, value))
        if time.monotonic() - self._sent_at > HOLD_S:
            self._send_curves()

    def refresh(self, refresh: Refresh) -> None:
        """Show a new vocabulary: its clusters, expressions, what it was learnt from, and a line in the log."""
        self._send_curves()
        self._vocabulary = refresh
        place = self._at(refresh.frame)
        self._set_time(place)
        view.log_clusters(self._recording, self._task, refresh)
        view.log_bars(self._recording, self._task, refresh)
        self._recording.log("now", rr.TextDocument(self._standing(None), media_type="text/markdown"))
        line = f"{refresh.frame:,} frames: vocabulary learnt anew from {refresh.episodes_used:,} episodes"
        self._log_line(line, view.GREEN)

    def skipped(self, frames: int, reason: str) -> None:
        """Say in the log that a refresh was due at ``frames`` and why there was none."""
        self._send_curves()
        self._set_time(self._at(frames))
        self._log_line(f"{frames:,} frames: no new vocabulary, {reason}", view.PINK)

    def watched(self, frames: int, watched: Watched, said: Sequence[Explanation]) -> None:
        """Show one watched episode.

        Args:
            frames: training frames when it was flown.
            watched: the episode, ``T`` steps.
            said: ``T`` explanations, one a step.

        Raises:
            ValueError: if there is not one explanation for each step.
        """
        steps = len(watched.moments)
        if len(said) != steps or not steps:
            raise ValueError(f"{len(said)} explanations for an episode of {steps} steps")
        self._send_curves()
        place = self._at(frames)
        instructed = [self._instructed(moment.instruction, moment.given) for moment in watched.moments]
        if self._task.scene_path is not None:
            self._send_scene(place, watched, said)
            self._send_told(place, instructed)
        self._send_signals(place, watched, said)
        self._send_lanes(place, instructed, said)
        head = f"**{frames:,}** frames, {self._task.context_option} **{watched.episode.context}**"
        self._send_now(place, head, instructed, said)
        self._send_spoken(place, watched, said)
        self._next = _Place(place.frame + steps + 1, place.step + steps + 1)

    def flush(self) -> None:
        """Write all that was added so far. Called after every batch, it makes the viewer leave the episode."""
        self._send_curves()
        self._recording.flush()

    def close(self) -> None:
        """Write the rest and the end of the file; a second call does nothing."""
        if self._open:
            self._open = False
            self.flush()
            self._recording.disconnect()

    def _at(self, frames: int) -> _Place:
        """The place for something new; episodes longer than the time between refreshes push it back."""
        return _Place(max(frames, self._next.frame), self._next.step)

    def _set_time(self, place: _Place) -> None:
        self._recording.set_time(view.FRAMES, sequence=place.frame)
        self._recording.set_time(view.WATCHED_STEP, sequence=place.step)

    def _send(self, path: str, times: list[rr.TimeColumn], columns: rr.ComponentColumnList) -> None:
        rr.send_columns(path, times, columns, recording=self._recording)

    def _send_curves(self) -> None:
        for key, rows in self._curves.items():
            frames, values = zip(*rows, strict=True)
            times = [rr.TimeColumn(view.FRAMES, sequence=np.array(frames))]
            self._send(f"curves/{key}", times, rr.Scalars.columns(scalars=np.array(values, float)))
        self._curves.clear()
        self._sent_at = time.monotonic()

    def _log_line(self, text: str, colour: tuple[int, int, int]) -> None:
        self._recording.log("log", rr.TextLog(text, level="INFO", color=colour))

    def _instructed(self, instruction: Array, given: bool) -> str:
        if not given:
            return SILENCE
        words = phrase(instruction, self._task.phrases)
        self._shades.setdefault(words, picture.colours(instruction[:1])[0])
        return words

    def _send_scene(self, place: _Place, watched: Watched, said: Sequence[Explanation]) -> None:
        assert self._task.scene_path is not None
        height = self._task.scene_size[1]
        self._set_time(place)
        view.log_background(self._recording, watched.background, height)
        every = place.columns(np.arange(len(watched.figures)))
        self._send_figures(every, watched, height)
        path = picture.flipped(self._task.scene_path(watched.episode.states), height)
        trails = picture.trails(path)
        self._send("scene/trail", every, rr.LineStrips2D.columns(strips=trails))
        before = place.columns(np.arange(len(said)))
        real = picture.thinned(picture.ahead(path, said[0].horizon_steps))
        self._send("scene/really", before, rr.LineStrips2D.columns(strips=real))
        predicted = picture.flipped(self._task.scene_path(np.stack([one.path for one in said])), height)
        self._send_predicted(place, picture.thinned(predicted), said)

    def _send_predicted(self, place: _Place, predicted: Array, said: Sequence[Explanation]) -> None:
        before, (steps, points) = place.columns(np.arange(len(said))), predicted.shape[:2]
        dots = rr.Points2D.columns(positions=predicted.reshape(-1, 2)).partition([points] * steps)
        self._send("scene/predicted", before, dots)
        shades = picture.colours(np.array([one.expression[0] for one in said]))
        words = [f"says: {one.phrase}" for one in said]
        self._send("scene/says", before, rr.Points2D.columns(positions=predicted[:, -1], colors=shades, labels=words))
        every = said[0].horizon_steps
        kept = picture.kept(predicted, every)
        lines = rr.LineStrips2D.columns(strips=np.concatenate(kept)).partition([len(lines) for lines in kept])
        self._send("scene/said", place.columns(np.arange(len(kept)) * every), lines)

    def _send_figures(self, times: list[rr.TimeColumn], watched: Watched, height: float) -> None:
        if not watched.figures[0]:
            return
        strips = picture.moving_strips(watched.figures, height)
        steps, shapes = strips.shape[:2]
        columns = rr.LineStrips2D.columns(strips=strips.reshape(-1, *strips.shape[2:])).partition([shapes] * steps)
        look = view.look(watched.figures[0])
        self._recording.log("scene/figures", look)
        self._send("scene/figures", times, columns)

    def _send_told(self, place: _Place, instructed: Sequence[str]) -> None:
        rows = picture.changes(instructed)
        top = np.tile([self._task.scene_size[0] / 2, 0.0], (len(rows), 1))
        labels = [f"told: {instructed[i]}" for i in rows]
        self._send("scene/told", place.columns(rows), rr.Points2D.columns(positions=top, labels=labels))

    def _send_signals(self, place: _Place, watched: Watched, said: Sequence[Explanation]) -> None:
        silent = ~np.asarray(watched.episode.given, bool)
        instructions = np.array(watched.episode.instructions, float)
        instructions[silent] = np.nan
        expressions = np.array([one.expression for one in said], float)
        times = place.columns(np.arange(len(said) + 1))
        for name, values in (("instruction", instructions), ("explanation", expressions)):
            values = np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan)  # no line on to the next episode
            columns = rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
            self._send(f"signal/{name}", times, columns)

    def _send_lanes(self, place: _Place, instructed: Sequence[str], said: Sequence[Explanation]) -> None:
        for one in said:
            self._shades.setdefault(one.phrase, picture.colours(one.expression[:1])[0])
        words = list(self._shades)
        states = rr.StateConfiguration(
            values=[SILENCE, *words],
            labels=[SILENCE, *picture.short(words, self._task.phrases)],
            colors=np.array([view.SILENT, *self._shades.values()], np.uint8),
        )
        for lane, spoken in (("instructor", instructed), ("agent", [one.phrase for one in said])):
            self._recording.log(f"says/{lane}", states, static=True)
            rows = picture.changes(spoken)
            times = place.columns([*rows, len(spoken)])
            self._send(f"says/{lane}", times, rr.StateChange.columns(state=[*(spoken[i] for i in rows), ""]))

    def _send_now(self, place: _Place, head: str, instructed: Sequence[str], said: Sequence[Explanation]) -> None:
        rows = picture.changes([(words, one.phrase, one.cluster) for words, one in zip(instructed, said, strict=True)])
        texts = [
            f"{head}  \n{picture.said_lines(instructed[i], said[i])}\n\n{self._standing(said[i].cluster)}" for i in rows
        ]
        columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
        self._send("now", place.columns(rows), columns)

    def _standing(self, spoken: int | None) -> str:
        """The vocabulary in markdown, the cluster just spoken marked; nothing before the first one."""
        return "" if self._vocabulary is None else picture.standing(self._vocabulary, self._task.phrases, spoken)

    def _send_spoken(self, place: _Place, watched: Watched, said: Sequence[Explanation]) -> None:
        rows = picture.changes([one.phrase for one in said])
        end = "success" if watched.episode.success else "no success"
        texts = [f"+{i}  {said[i].phrase}" for i in rows] + [f"+{len(said)}  end of the episode: {end}"]
        shades = picture.colours(np.array([said[i].expression[0] for i in rows]))
        shades = np.concatenate([shades, [view.GREEN if watched.episode.success else view.PINK]]).astype(np.uint8)
        columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts), color=shades)
        self._send("log", place.columns([*rows, len(said)]), columns)
