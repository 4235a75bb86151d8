"""A run as a rerun recording: curves, vocabularies and watched episodes, written to a file and nowhere else.

A viewer that hangs can block whoever sends to it, so nothing here opens a connection; ``ibe_rl.view.relay`` serves
the growing file from a process of its own. ``ibe_rl.view.run_recorder`` keeps what goes wrong here from the training.

There are two timelines. ``frames`` counts training frames; step j of an episode recorded at frame F lies at F + j.
``film`` counts the steps of all recorded episodes one after the other. Playing it is a film of them, each with
the vocabulary and the curves of its time.
"""

from __future__ import annotations

import math
import time
import warnings
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader
from rerun.error_utils import strict_mode

from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Explanation
from ibe_rl.view import blueprint as view
from ibe_rl.view import chart, picture, sentences
from ibe_rl.view import palette as colours
from ibe_rl.view.curves import Drawing, Rows
from ibe_rl.view.film import Film, Place
from ibe_rl.view.recording_file import RecordingFile, earlier
from ibe_rl.view.wording import literal
from ibe_rl.vocabulary.refresh import Refresh

APPLICATION = "ibe_rl_run"
"""Not that of recordings before the panels had their present names, as rerun keeps one layout for each."""
GREETING = "It has just begun to train. Its first words come with the first refresh."
INTRO_STEPS = 30
"""Of the film, before the first episode: what was trained until then."""
HOLD_S = 30.0
"""Longest time that rows of curves wait to be sent. They wait at all because a viewer that follows the newest
data would leave the watched episode with every batch."""
CURVE_BYTES, VALUE_BYTES, CHARTS_BYTES = 1700, 32, 40_000
"""At most of each curve whenever rows are sent, of each value, and of the pictures of the curves."""
NO_VOCABULARY = "It has none yet."


def _taken(state: Mapping[str, Any]) -> tuple[Place, int, list[int], dict[str, Rows], dict[str, Rows]]:
    """Place, steps drawn, clusters shown, curves that wait and those drawn; raises what there is to raise if none."""
    waiting, drawn = (
        {str(key): [(int(frames), float(value)) for frames, value in rows] for key, rows in curves.items()}
        for curves in (state["curves"], state.get("charts", {}))  # recordings of earlier versions had no charts
    )
    frame, step = state["next"]
    return Place(int(frame), int(step)), int(state["drawn_to"]), [int(one) for one in state["shown"]], waiting, drawn


def strict() -> bool:
    """True if rerun was asked to raise wrong calls instead of warning of them."""
    return strict_mode()


class Recorder:
    """Writes one run to one file.

    Args:
        path: the file, written anew; its folder must exist.
        task: what the environment declares of itself.
        run_name: title of the recording in the viewer.
        training: False lays out the panels for watched episodes alone.
        max_bytes: the file never gets longer; None: no limit.
        state: from ``state_dict``; the recording begins with the ``earlier`` part of the file.

    Raises:
        OSError: if the file cannot be written; ``size``, ``flush`` and ``close`` say so later on.
    """

    def __init__(
        self,
        path: Path,
        task: Task,
        run_name: str,
        training: bool = True,
        max_bytes: int | None = None,
        state: Mapping[str, Any] | None = None,
    ) -> None:
        self._task = task
        taken = (
            _taken(state) if state else None
        )  # before there is a file: what is not closed in order waits at the exit
        self._file = RecordingFile(path, max_bytes)
        self._id = str(state["id"]) if state else str(uuid4())
        self._recording = rr.RecordingStream(APPLICATION, recording_id=self._id)
        sink = rr.FileSink(self._file.entrance)
        self._recording.set_sinks(sink, default_blueprint=view.blueprint(task, training))
        self._recording.set_log_time_enabled(False)
        self._recording.send_recording_name(run_name)
        view.log_styles(self._recording, task)
        if training and not state:
            Place(0, 0).set(self._recording)
            self._show("now", GREETING)
            self._show("words", NO_VOCABULARY)
        self._next = Place(0, INTRO_STEPS if training else 0)
        self._drawn_to = 0  # step of the film that the curves have reached
        self._curves: dict[str, Rows] = defaultdict(list)
        self._sent_at = time.monotonic()
        self._vocabulary: Refresh | None = None
        self._standings: dict[int | None, str] = {}  # what the panel of words says of it, by the cluster spoken
        self._shown: list[int] = []  # clusters in the picture; not every refresh need be recorded
        self._film, self._drawing = Film(self._recording, task), Drawing(view.charts(task))
        self._open = True
        if taken:
            self._repeat(earlier(path))
            self._next, self._drawn_to, self._shown, waiting, drawn = taken
            self._curves.update(waiting)
            self._drawing.rows.update(drawn)

    def _repeat(self, before: Path) -> None:
        """Send what another recorder had written: rerun's table of contents counts from the head of the file."""
        if before.exists():
            with warnings.catch_warnings(action="ignore"):  # it has no table of contents
                self._recording.send_chunks(RrdReader(before).stream())
            self.size()
            before.unlink()

    def state_dict(self) -> dict[str, Any]:
        """All that a recorder needs to go on with the file; all that was sent is in it then.

        Raises:
            OSError: if the file takes nothing any more.
        """
        self.size()
        return {
            "id": self._id,
            "bytes": self._file.size,
            "next": [self._next.frame, self._next.step],
            "drawn_to": self._drawn_to,
            "shown": list(self._shown),
            "curves": {key: list(rows) for key, rows in self._curves.items()},
            "charts": {key: list(rows) for key, rows in self._drawing.rows.items()},
        }

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
            if self._drawing.due():
                self._draw(Place(frames, self._next.step))

    def refresh(self, refresh: Refresh) -> None:
        """Show a vocabulary: its clusters, expressions, what it was learnt from, and in the log what moved."""
        self._send_curves()
        self._vocabulary, self._standings = refresh, {}
        place = self._at(refresh.frame)
        place.set(self._recording)
        if refresh.taken:
            chart.log_vocabulary(self._recording, self._task, refresh, self._shown)
            self._add_expressions(refresh)
            self._shown = refresh.mapping.ids.tolist()
        self._draw(place)
        self._show("words", self._standing(None))
        done = "vocabulary learnt anew" if refresh.taken else "vocabulary kept"
        self._log_line(f"{refresh.frame:,} frames: {done}", colours.GREEN)
        for line in (*sentences.moved(refresh), *sentences.transitions(refresh, self._task.phrases)):
            self._log_line(line, colours.PALE)

    def skipped(self, frames: int, reason: str) -> None:
        """Say in the log that a refresh was due at ``frames`` and why there was none."""
        self.say(frames, f"{frames:,} frames: no new vocabulary, {reason}")

    def say(self, frames: int, line: str) -> None:
        """Add a line to the log at ``frames``."""
        self._send_curves()
        self._at(frames).set(self._recording)
        self._log_line(line, colours.PINK)
        self._show("now", literal(line))

    def watched(self, frames: int, watched: RecordedRollout, said: Sequence[Explanation], real: Sequence[str]) -> None:
        """Show one watched episode.

        Args:
            frames: training frames when it was flown.
            watched: the episode, ``T`` steps.
            said: ``T`` explanations, one a step.
            real: ``T`` phrases of what then ``happened``.

        Raises:
            ValueError: if there is not one explanation and one phrase for each step.
        """
        steps = len(watched.moments)
        if not len(said) == len(real) == steps or not steps:
            raise ValueError(f"{len(said)} explanations and {len(real)} phrases for an episode of {steps} steps")
        self._send_curves()
        place = self._at(frames)
        head = f"**{frames:,}** frames, {f'{self._task.context_option} **{literal(watched.episode.context)}**'.strip()}"
        self._film.send(place, watched, said, real, head, self._standing)
        self._next = Place(place.frame + steps + 1, place.step + steps + 1)

    def waits(self) -> bool:
        """True while there are rows of curves that are not sent yet."""
        return bool(self._curves)

    def size(self) -> int:
        """Bytes in the file, and at most what the rows that wait will take; all that was sent is in the file then.

        Raises:
            OSError: if the file takes nothing any more.
        """
        self._recording.flush()
        self._file.drain()
        waiting = sum(CURVE_BYTES + VALUE_BYTES * len(rows) for rows in self._curves.values())
        return self._file.size + waiting + CHARTS_BYTES * bool(waiting)

    def flush(self) -> None:
        """Write all that was added so far. Called after every batch, it makes the viewer leave the episode.

        Raises:
            OSError: if the file takes nothing any more.
        """
        self._send_curves()
        self.size()

    def close(self) -> None:
        """Write the rest and the end of the file; a second call does nothing.

        Raises:
            OSError: if the file did not take it all.
        """
        if not self._open:
            return
        self._open = False
        try:
            self._send_curves()
            self._draw(self._next)
        finally:
            self._recording.disconnect()
            self._file.close()
        if self._file.error is not None:
            raise self._file.error

    def _at(self, frames: int) -> Place:
        """The place for something new; episodes longer than the time between refreshes push it back."""
        return Place(max(frames, self._next.frame), self._next.step)

    def _send(self, path: str, times: list[rr.TimeColumn], columns: rr.ComponentColumnList) -> None:
        rr.send_columns(path, times, columns, recording=self._recording)

    def _send_curves(self) -> None:
        """Send the rows of curves that wait; in the film they are spread up to where the next episode begins."""
        curves, self._curves = self._curves, defaultdict(list)  # gone even if one of them cannot be sent
        self._sent_at = time.monotonic()
        arrived = {frames for rows in curves.values() for frames, _ in rows}
        steps = np.linspace(self._drawn_to, self._next.step, len(arrived) + 1)[1:].astype(np.int64)
        step_of = dict(zip(sorted(arrived), steps.tolist(), strict=True))
        self._drawn_to = self._next.step if arrived else self._drawn_to
        for key, rows in curves.items():
            frames, values = zip(*rows, strict=True)
            times = [
                rr.TimeColumn(view.FRAMES, sequence=np.array(frames)),
                rr.TimeColumn(view.FILM, sequence=np.array([step_of[frame] for frame in frames])),
            ]
            self._send(f"curves/{key}", times, rr.Scalars.columns(scalars=np.array(values, float)))
            self._drawing.add(key, rows)

    def _add_expressions(self, refresh: Refresh) -> None:
        """Let the curves of clusters go on, and those of clusters that are no more end."""
        for number in range(self._task.instruction_size):
            values = dict.fromkeys(self._shown, math.nan) | chart.expressions(refresh, number)
            for name, value in values.items():
                key = f"{picture.entity(self._task, 'development', number)}/{name}"
                self._drawing.add(key, [(refresh.frame, value)])

    def _draw(self, place: Place) -> None:
        place.set(self._recording)
        self._drawing.draw(self._recording)

    def _show(self, panel: str, text: str) -> None:
        self._recording.log(panel, rr.TextDocument(text, media_type="text/markdown"))

    def _log_line(self, text: str, colour: tuple[int, int, int]) -> None:
        self._recording.log("log", rr.TextLog(text, level="INFO", color=colour))

    def _standing(self, spoken: int | None) -> str:
        """The vocabulary in markdown, the cluster just spoken marked; nothing before the first one."""
        if self._vocabulary is None:
            return ""
        if spoken not in self._standings:
            self._standings[spoken] = sentences.standing(self._vocabulary, self._task, spoken)
        return self._standings[spoken]
