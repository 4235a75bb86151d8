"""One watched episode as a film: the scene, what was told and said, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ibe_rl.ibe import phrase
from ibe_rl.task import Task, Watched
from ibe_rl.types import Array, Explanation
from ibe_rl.view import blueprint as view
from ibe_rl.view import palette as colours
from ibe_rl.view import picture, sentences

SILENCE = "(silent)"


@dataclass(frozen=True)
class Place:
    """Where something begins on both timelines."""

    frame: int
    step: int

    def columns(self, steps: Array | Sequence[int]) -> list[rr.TimeColumn]:
        """Both timelines for rows that lie so many ``steps`` later."""
        offsets = np.asarray(steps, dtype=np.int64)
        return [
            rr.TimeColumn(view.FRAMES, sequence=self.frame + offsets),
            rr.TimeColumn(view.WATCHED_STEP, sequence=self.step + offsets),
        ]

    def set(self, recording: rr.RecordingStream) -> None:
        """Let what is logged next lie here."""
        recording.set_time(view.FRAMES, sequence=self.frame)
        recording.set_time(view.WATCHED_STEP, sequence=self.step)


class Film:
    """Writes watched episodes into a recording.

    Args:
        recording: where to.
        task: what the environment declares of itself.
    """

    def __init__(self, recording: rr.RecordingStream, task: Task) -> None:
        self._recording, self._task, self._short = recording, task, sentences.shortener(task.phrases)
        self._shades: dict[str, Array] = {}  # of each phrase, as it was first said

    def send(
        self,
        place: Place,
        watched: Watched,
        said: Sequence[Explanation],
        real: Sequence[str],
        head: str,
        standing: Callable[[int], str],
    ) -> None:
        """Write one episode.

        Args:
            place: of its first step.
            watched: the episode, ``T`` steps.
            said: ``T`` explanations, one a step.
            real: ``T`` phrases of what then happened.
            head: first line of the panel of words, in markdown.
            standing: from the cluster just spoken to what that panel says of the vocabulary.
        """
        instructed = [self._instructed(moment.instruction, moment.given) for moment in watched.moments]
        if self._task.scene_path is not None:
            self._send_scene(place, watched, said)
            self._send_judged(place, said, real)
            self._send_told(place, instructed)
        self._send_signals(place, watched, said)
        self._send_lanes(place, instructed, said)
        self._send_now(place, head, instructed, said, real, standing)
        self._send_spoken(place, watched, said)

    def _send(self, path: str, times: list[rr.TimeColumn], columns: rr.ComponentColumnList) -> None:
        rr.send_columns(path, times, columns, recording=self._recording)

    def _instructed(self, instruction: Array, given: bool) -> str:
        if not given:
            return SILENCE
        words = phrase(instruction, self._task.phrases)
        self._shades.setdefault(words, colours.of_expressions(instruction[None])[0])
        return words

    def _send_scene(self, place: Place, watched: Watched, said: Sequence[Explanation]) -> None:
        assert self._task.scene_path is not None
        height = self._task.scene_size[1]
        place.set(self._recording)
        view.log_background(self._recording, watched.background, height)
        every = place.columns(np.arange(len(watched.figures)))
        self._send_figures(every, watched, height)
        path = picture.flipped(self._task.scene_path(watched.episode.states), height)
        trails = picture.trails(path)
        self._send("scene/trail", every, rr.LineStrips2D.columns(strips=trails))
        predicted = picture.flipped(self._task.scene_path(np.stack([one.trusted_path for one in said])), height)
        self._send_predicted(place, picture.thinned(predicted), said)

    def _send_predicted(self, place: Place, predicted: Array, said: Sequence[Explanation]) -> None:
        before, (steps, points) = place.columns(np.arange(len(said))), predicted.shape[:2]
        dots = rr.Points2D.columns(positions=predicted.reshape(-1, 2)).partition([points] * steps)
        self._send("scene/predicted", before, dots)
        shades = _shades(said)
        words = [f"says: {one.in_time(self._short)}{'' if one.trusted else ' ?'}" for one in said]
        self._send("scene/says", before, rr.Points2D.columns(positions=predicted[:, -1], colors=shades, labels=words))

    def _send_judged(self, place: Place, said: Sequence[Explanation], real: Sequence[str]) -> None:
        """At the end of each window: the way that was predicted at its beginning, and whether it went so."""
        assert self._task.scene_path is not None
        entities, steps_ago = ("scene/then", "scene/verdict"), said[0].horizon_steps
        place.set(self._recording)
        for entity in entities:
            self._recording.log(entity, rr.Clear(recursive=False))
        begun = [i for i in np.unique(picture.made_at(said)) if i + steps_ago <= len(said) and said[i].known]
        if not begun:
            return
        times = place.columns(np.add(begun, steps_ago))
        height, true = self._task.scene_size[1], [said[i].phrase == real[i] for i in begun]
        paths = picture.flipped(self._task.scene_path(np.stack([said[i].trusted_path for i in begun])), height)
        shades = np.where(np.array(true)[:, None], colours.GREEN, colours.PINK).astype(np.uint8)
        self._send(entities[0], times, rr.LineStrips2D.columns(strips=picture.thinned(paths), colors=shades))
        words = [sentences.judged(steps_ago, said[i].phrase, real[i]) for i in begun]
        bottom = np.tile(np.array([self._task.scene_size[0] / 2, height], np.float32), (len(begun), 1))
        self._send(entities[1], times, rr.Points2D.columns(positions=bottom, colors=shades, labels=words))

    def _send_figures(self, times: list[rr.TimeColumn], watched: Watched, height: float) -> None:
        if not watched.figures[0]:
            return
        strips = picture.moving_strips(watched.figures, height)
        steps, shapes = strips.shape[:2]
        columns = rr.LineStrips2D.columns(strips=strips.reshape(-1, *strips.shape[2:])).partition([shapes] * steps)
        look = view.look(watched.figures[0])
        self._recording.log("scene/figures", look)
        self._send("scene/figures", times, columns)

    def _send_told(self, place: Place, instructed: Sequence[str]) -> None:
        rows = picture.changes(instructed)
        top = np.tile([self._task.scene_size[0] / 2, 0.0], (len(rows), 1))
        labels = [f"told: {instructed[i]}" for i in rows]
        self._send("scene/told", place.columns(rows), rr.Points2D.columns(positions=top, labels=labels))

    def _send_signals(self, place: Place, watched: Watched, said: Sequence[Explanation]) -> None:
        silent = ~np.asarray(watched.episode.given, bool)
        instructions = np.array(watched.episode.instructions, float)
        instructions[silent] = np.nan
        expressions = np.array([one.expression for one in said], float)
        expressions[~np.array([one.meant for one in said], bool)] = np.nan  # a word that says nothing has no number
        times = place.columns(np.arange(len(said) + 1))
        for name, values in (("instruction", instructions), ("explanation", expressions)):
            values = np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan)  # no line on to the next episode
            for number, column in enumerate(values.T):
                path = f"{picture.entity(self._task, 'signal', number)}/{name}"
                self._send(path, times, rr.Scalars.columns(scalars=column))

    def _send_lanes(self, place: Place, instructed: Sequence[str], said: Sequence[Explanation]) -> None:
        for one in said:
            self._shades.setdefault(
                one.said,
                colours.of_expressions(one.expression[None])[0] if one.known else np.array(colours.SILENT_GREY),
            )
        words = list(self._shades)
        states = rr.StateConfiguration(
            values=[SILENCE, *words],
            labels=[SILENCE, *sentences.short(words, self._task.phrases)],
            colors=np.array([colours.SILENT_GREY, *self._shades.values()], np.uint8),
        )
        for lane, spoken in (("instructor", instructed), ("agent", [one.said for one in said])):
            self._recording.log(f"says/{lane}", states, static=True)
            rows = picture.changes(spoken)
            times = place.columns([*rows, len(spoken)])
            self._send(f"says/{lane}", times, rr.StateChange.columns(state=[*(spoken[i] for i in rows), ""]))

    def _send_now(
        self,
        place: Place,
        head: str,
        instructed: Sequence[str],
        said: Sequence[Explanation],
        real: Sequence[str],
        standing: Callable[[int], str],
    ) -> None:
        steps_ago, made = said[0].horizon_steps, picture.made_at(said)
        verdicts = [""] * min(steps_ago, len(said)) + [
            sentences.judged(steps_ago, said[i].said, real[i]) for i in made[: max(0, len(said) - steps_ago)]
        ]
        spoken = [(one.in_time(), one.cluster) for one in said]
        rows = picture.changes(list(zip(instructed, spoken, verdicts, strict=True)))
        texts = [
            f"{head}  \n{sentences.said_lines(instructed[i], said[i])}  \n{verdicts[i]}\n\n{standing(said[i].cluster)}"
            for i in rows
        ]
        columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
        self._send("now", place.columns(rows), columns)

    def _send_spoken(self, place: Place, watched: Watched, said: Sequence[Explanation]) -> None:
        rows = picture.changes([one.in_time() for one in said])
        end = "success" if watched.episode.success else "no success"
        texts = [f"+{i}  {said[i].in_time(self._short)}" for i in rows] + [f"+{len(said)}  end of the episode: {end}"]
        shades = _shades([said[i] for i in rows])
        shades = np.concatenate([shades, [colours.GREEN if watched.episode.success else colours.PINK]]).astype(np.uint8)
        columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts), color=shades)
        self._send("log", place.columns([*rows, len(said)]), columns)


def _shades(said: Sequence[Explanation]) -> Array:
    """Colours ``(N, 3)`` of expressions, grey where the agent does not know."""
    known = np.array([one.known for one in said])[:, None]
    return np.where(
        known, colours.of_expressions(np.array([one.expression for one in said])), colours.SILENT_GREY
    ).astype(np.uint8)
