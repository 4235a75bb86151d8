"""What the agent would do if it were told something else, in the live view: faint paths, lanes, how much it listens.

A moment that was not asked shows the answers of the last one that was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ibe_rl.explain.what_if import in_a_sentence, values_of
from ibe_rl.task import Task
from ibe_rl.types import Array, Explanation
from ibe_rl.view import palette as colours
from ibe_rl.view import picture
from ibe_rl.view.lanes import BAND_HEIGHT, IF_TOLD, IF_TOLD_PATHS, LANE_HEIGHT, Lane, log_lanes, step_marks, x_of

PATH_SHADE = 0.55
"""How much of its colour a path keeps that will not be flown."""
LONGEST_NAME = 14
"""Characters beside a lane."""
NOT_ASKED = ""


def last_asked(said: Sequence[Explanation]) -> list[Explanation | None]:
    """For each step the last explanation that was asked; None before the first one."""
    found: list[Explanation | None] = []
    for one in said:
        found.append(one if one.what_if else (found[-1] if found else None))
    return found


def sentence_at(asked: Explanation | None, short: Callable[[str], str]) -> str:
    """The answers at a step in one line; empty if there are none."""
    if asked is None or asked.listens is None:
        return NOT_ASKED
    return f"{in_a_sentence(asked, short)} (listens {np.nan_to_num(asked.listens):.0%})"


@dataclass(frozen=True)
class AnswersOfEpisode:
    """Draws the answers of one episode, ``T`` explanations.

    Attributes:
        recording: where to.
        task: what the environment declares of itself.
        said: one explanation a step.
        columns: steps of the episode to their times.
        drawn: states to points of the scene; None without a scene.
        short: shortens phrases.
        shade: the colour of an explanation.
    """

    recording: rr.RecordingStream
    task: Task
    said: Sequence[Explanation]
    columns: Callable[[Sequence[int]], list[rr.TimeColumn]]
    drawn: Callable[[Array], Array] | None
    short: Callable[[str], str]
    shade: Callable[[Explanation], Array]

    def send(self) -> None:
        """Draw them from the time that is set on; what was there of an earlier episode goes."""
        for entity in [IF_TOLD] if self.drawn is None else [IF_TOLD_PATHS, IF_TOLD]:
            self.recording.log(entity, rr.Clear(recursive=True))
        asked = last_asked(self.said)
        names = next((list(one.what_if) for one in asked if one is not None), [])
        if not names:
            return
        self._send_lanes(asked, names)
        if self.drawn is not None:
            self._send_paths(asked, names)

    def _send_paths(self, asked: Sequence[Explanation | None], names: Sequence[str]) -> None:
        assert self.drawn is not None
        rows = [step for step in picture.changes([id(one) for one in asked]) if asked[step] is not None]
        answers = [asked[step].what_if[name] for step in rows for name in names]  # type: ignore[union-attr]
        paths = picture.thinned(self.drawn(np.stack([one.trusted_path for one in answers])))
        shades = np.tile((PATH_SHADE * told_shades(self.task, names)).astype(np.uint8), (len(rows), 1))
        strips = rr.LineStrips2D.columns(strips=paths, colors=shades).partition([len(names)] * len(rows))
        rr.send_columns(IF_TOLD_PATHS, self.columns(rows), strips, recording=self.recording)

    def _send_lanes(self, asked: Sequence[Explanation | None], names: Sequence[str]) -> None:
        lanes = [self._lane(asked, name) for name in names]
        listens = [np.nan if one is None or one.listens is None else one.listens for one in asked]
        heard = [f"{value:.0%}" if np.isfinite(value) else NOT_ASKED for value in listens]
        ground = np.tile(np.array(colours.GRID, np.uint8), (len(asked), 1))
        log_lanes(self.recording, [*lanes, Lane("listens", heard, ground)], IF_TOLD)
        steps, middle = len(asked), LANE_HEIGHT * (len(lanes) + 0.5)
        curve = [
            (x_of(at, steps), middle + BAND_HEIGHT * (0.5 - float(np.nan_to_num(value))))
            for step, value in enumerate(listens)
            for at in (step, step + 1)
        ]
        line = rr.LineStrips2D([curve], colors=[colours.WHITE], radii=rr.Radius.ui_points(0.8), draw_order=50.0)
        self.recording.log(f"{IF_TOLD}/listens", line)
        marks = step_marks(steps, len(lanes) + 1)
        rr.send_columns(f"{IF_TOLD}/now", self.columns(range(steps)), marks, recording=self.recording)

    def _lane(self, asked: Sequence[Explanation | None], name: str) -> Lane:
        answers = [None if one is None else one.what_if[name] for one in asked]
        grey, called = np.array(colours.SILENT_GREY, np.uint8), self.short(name)
        return Lane(
            f"if {called}" if len(called) <= LONGEST_NAME else f"if {called[: LONGEST_NAME - 1]}…",
            [NOT_ASKED if one is None else self.short(one.said) for one in answers],
            np.stack([grey if one is None or not one.known else self.shade(one) for one in answers]),
        )


def told_shades(task: Task, names: Sequence[str]) -> Array:
    """Colours ``(W, 3)`` of values that could be said: as of expressions if they are single numbers."""
    values = values_of(task)
    if task.instruction_size == 1 and all(name in values for name in names):
        return colours.of_expressions(np.array([values[name] for name in names]))
    return colours.of_clusters(np.arange(len(names)))
