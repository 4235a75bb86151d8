"""The recording of a training, which never ends the training and never grows past its limit.

What goes wrong in a ``Recorder`` ends here, and becomes one line for the terminal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ibe_rl.task import Task
from ibe_rl.view.recorder import CURVE_BYTES, Recorder, strict
from ibe_rl.view.thinning import Thinning
from ibe_rl.vocabulary.listener import Listener, Refreshed
from ibe_rl.vocabulary.refresh import Refresh

Call = Callable[[Recorder], None]
LINE_BYTES = 3000
"""At most of a line in the log."""


class RunRecorder(Listener):
    """Takes what a ``Recorder`` takes; raises nothing, except for bugs while rerun is strict (``RERUN_STRICT``).

    Args:
        path: the file, written anew; its folder must exist.
        task: what the environment declares of itself.
        run_name: title of the recording in the viewer.
        max_mb: the file never gets larger; as it fills, less and less is kept, and at the end the newest.
        state: from ``state_dict``; the recording goes on from there.
    """

    def __init__(
        self, path: Path, task: Task, run_name: str, max_mb: int, state: Mapping[str, Any] | None = None
    ) -> None:
        self.essential = strict()
        self._max_mb, self._thinning = max_mb, Thinning(max_mb * 1_000_000)
        self._recorder: Recorder | None = None
        self._frames = self._whole_until = 0
        self._refreshes, self._rows = 0, Counter[str]()
        self._newest: list[tuple[Call, float]] = []
        self._newest_row: list[tuple[Call, float]] = []
        self._every, self._full, self._complained = 1, False, False
        self._news: list[str] = []
        if state:
            self._refreshes, self._rows = state["refreshes"], Counter(state["rows"])
            self._every, self._full = state["every"], state["full"]
            self._thinning.load_state_dict(state["thinning"])
        try:
            of_the_file = state["recorder"] if state else None
            self._recorder = Recorder(path, task, run_name, max_bytes=max_mb * 1_000_000, state=of_the_file)
            self._thinning.took(self._recorder.size())
        except OSError as error:
            self._end(error)

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """Add one row of training curves, or leave it out; those with rare columns stay longer."""
        self._frames = frames
        rare = " ".join(sorted({key.split("/")[0] for key in row} & {"eval", "ibe"}))
        kept = self._rows[rare] % self._thinning.every(small=bool(rare)) == 0
        self._rows[rare] += 1
        call, size = partial(Recorder.batch, frames=frames, values=row), float(CURVE_BYTES * len(row))
        kept = kept and self._fits(size)
        self._newest_row = [] if kept else [(call, size)]
        if kept:
            self._do(call)
        self._say_if_thinner()

    def refreshed(self, event: Refreshed) -> None:
        """Show a new vocabulary and the episode explained with it, or leave out what does not fit.

        What is newest is shown at the latest when the recording ends.
        """
        self._show_vocabulary(event.refresh)
        self._show_rollout(event)

    def _show_vocabulary(self, refresh: Refresh) -> None:
        self._frames = refresh.frame
        call, size = partial(Recorder.refresh, refresh=refresh), self._thinning.refresh_bytes()
        kept = self._refreshes % self._thinning.every(small=True) == 0 and self._fits(size)
        self._newest = [] if kept else [(call, size)]
        if kept:
            self._do(call, refreshes=1)

    def _show_rollout(self, event: Refreshed) -> None:
        size = self._thinning.episode_bytes(len(event.said))
        call = partial(Recorder.watched, frames=event.frames, watched=event.rollout, said=event.said, real=event.real)
        kept = not self._newest and self._refreshes % self._thinning.every() == 0 and self._fits(size)
        if kept:
            self._do(call, steps=len(event.said))
        else:
            self._newest.append((call, size))
        self._refreshes += 1
        self._say_if_thinner()

    def skipped(self, frames: int, reason: str) -> None:
        """Say in the log that a refresh was due at ``frames`` and why there was none."""
        self._frames = frames
        if self._refreshes % self._thinning.every(small=True) == 0 and self._fits(LINE_BYTES):
            self._do(partial(Recorder.skipped, frames=frames, reason=reason))
        self._refreshes += 1

    def end(self, summary: Mapping[str, Any]) -> None:
        """See ``Listener``."""
        self.close()

    def close(self) -> None:
        """Write what is newest where it was left out, and the end of the file; a second call does nothing."""
        for call, size in (*self._newest, *self._newest_row):
            if self._thinning.fits_at_the_end(size):
                self._do(call)
        self._newest, self._newest_row = [], []
        if self._recorder is not None:
            self._do(Recorder.close, closes=True)
            self._recorder = None

    def state_dict(self) -> dict[str, Any]:
        """All that the recording needs to go on; nothing if it cannot be written any more."""
        if self._recorder is None:
            return {}
        try:
            recorder = self._recorder.state_dict()
        except OSError as error:
            self._end(error)
            return {}
        return {
            "recorder": recorder,
            "refreshes": self._refreshes,
            "rows": dict(self._rows),
            "every": self._every,
            "full": self._full,
            "thinning": self._thinning.state_dict(),
        }

    def news(self) -> list[str]:
        """What the person in front of the terminal should know, each line once."""
        news, self._news = self._news, []
        return news

    def _fits(self, size: float) -> bool:
        fits = self._thinning.fits(size)
        if not fits and not self._full and self._recorder is not None:
            self._full = True
            self._say(
                f"the recording is all but full (viewer.max_recording_mb={self._max_mb}): what does not fit is left "
                "out, the newest vocabulary and episode follow when the training ends; metrics.csv has every row"
            )
        return fits

    def _say_if_thinner(self) -> None:
        if not self._fits(0):
            return  # which was said
        if self._thinning.every() > self._every and not self._full:
            self._every = self._thinning.every()
            self._say(
                f"the recording has {self._thinning.used / 1e6:.1f} MB (viewer.max_recording_mb={self._max_mb}): from "
                f"now on it holds every {self._every}th watched episode and row of curves; metrics.csv has every row"
            )

    def _say(self, line: str) -> None:
        if self._recorder is not None:
            self._news.append(f"{self._frames:,} frames: {line}")
            self._do(partial(Recorder.say, frames=self._frames, line=self._news[-1]))

    def _do(self, call: Call, refreshes: int = 0, steps: int = 0, closes: bool = False) -> None:
        if self._recorder is None:
            return
        try:
            call(self._recorder)
            if not closes:
                self._thinning.took(self._recorder.size(), refreshes, steps)
                self._whole_until = self._whole_until if self._recorder.waits() else self._frames
        except OSError as error:
            self._end(error)
        except Exception as error:
            if strict():
                raise
            self._complain(error)

    def _end(self, error: OSError) -> None:
        """Give up: what is still to come is dropped."""
        recorder, self._recorder = self._recorder, None
        self._newest, self._newest_row = [], []
        until = f"what was written until frame {self._whole_until:,} can be opened, " if self._whole_until else ""
        self._news.append(
            f"warning: the recording cannot be written any more ({error.strerror or error}), and the live view stands "
            f"still: {until}training goes on, metrics.csv has every row"
        )
        if recorder is not None:
            self._drop(recorder)

    def _drop(self, recorder: Recorder) -> None:
        try:
            recorder.close()
        except Exception as error:
            if not isinstance(error, OSError) and strict():
                raise

    def _complain(self, error: Exception) -> None:
        if not self._complained:
            self._complained = True
            self._news.append(
                f"warning: something could not be recorded ({type(error).__name__}: {error}): the recording lacks it "
                "and whatever else fails like this, training goes on; RERUN_STRICT=1 ends in the error itself"
            )
