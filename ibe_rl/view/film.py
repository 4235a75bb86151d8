"""One explained episode as a film: the scene, what was told and said, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, Explanation
from ibe_rl.view import blueprint as view
from ibe_rl.view import palette as colours
from ibe_rl.view import picture, wording
from ibe_rl.view.lanes import ENTITY, Lane, log_lanes, step_marks
from ibe_rl.view.spoken import markdown, spoken_rows, spoken_words, without_flicker
from ibe_rl.view.what_if import AnswersOfEpisode, last_asked, sentence_at


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
            rr.TimeColumn(view.FILM, sequence=self.step + offsets),
        ]

    def set(self, recording: rr.RecordingStream) -> None:
        """Let what is logged next lie here."""
        recording.set_time(view.FRAMES, sequence=self.frame)
        recording.set_time(view.FILM, sequence=self.step)


@dataclass(frozen=True)
class _Take:
    """One episode of ``T`` steps on its way into the recording; see ``Film.send``."""

    place: Place
    watched: RecordedRollout
    said: Sequence[Explanation]
    real: Sequence[str]
    instructed: Sequence[str]

    @property
    def horizon_steps(self) -> int:
        return self.said[0].horizon_steps


class Film:
    """Writes watched episodes into a recording.

    Args:
        recording: where to.
        task: what the environment declares of itself.
    """

    def __init__(self, recording: rr.RecordingStream, task: Task) -> None:
        self._recording, self._task, self._short = recording, task, wording.shortener(task.phrases)
        self._shades: dict[str, Array] = {}  # of each phrase, as it was first said

    def send(
        self,
        place: Place,
        watched: RecordedRollout,
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
            head: first line of the panel of what is said now, in markdown.
            standing: from the cluster just spoken to the panel of the vocabulary.
        """
        instructed = [self._instructed(moment.instruction, moment.given) for moment in watched.moments]
        take = _Take(place, watched, said, real, instructed)
        if self._task.scene_path is not None:
            self._send_scene(take)
            self._send_predicted(take)
            self._send_verdicts(take)
            self._send_told(take)
        self._send_signals(take)
        self._send_said(take)
        self._send_lanes(take)
        self._send_answers(take)
        self._send_now(take, head, standing)
        self._send_spoken(take)

    def _send(self, path: str, times: list[rr.TimeColumn], columns: rr.ComponentColumnList) -> None:
        rr.send_columns(path, times, columns, recording=self._recording)

    def _instructed(self, instruction: Array, given: bool) -> str:
        if not given:
            return wording.SILENCE
        words = phrase(instruction, self._task.phrases)
        self._shades.setdefault(words, colours.of_expressions(instruction[None])[0])
        return words

    def _drawn(self, states: Array) -> Array:
        """States to points of the scene, y down."""
        assert self._task.scene_path is not None
        return picture.flipped(self._task.scene_path(states), self._task.scene_size[1])

    def _send_scene(self, take: _Take) -> None:
        height, watched = self._task.scene_size[1], take.watched
        take.place.set(self._recording)
        view.log_background(self._recording, watched.background, height)
        every = take.place.columns(np.arange(len(watched.figures)))
        if watched.figures[0]:
            strips = picture.moving_strips(watched.figures, height)
            steps, shapes = strips.shape[:2]
            self._recording.log("scene/figures", view.line_styles(watched.figures[0]))
            columns = rr.LineStrips2D.columns(strips=strips.reshape(-1, *strips.shape[2:]))
            self._send("scene/figures", every, columns.partition([shapes] * steps))
        trails = picture.trails(self._drawn(watched.episode.states))
        self._send("scene/trail", every, rr.LineStrips2D.columns(strips=trails))

    def _send_predicted(self, take: _Take) -> None:
        said = take.said
        predicted = picture.thinned(self._drawn(np.stack([one.trusted_path for one in said])))
        before, (steps, points) = take.place.columns(np.arange(len(said))), predicted.shape[:2]
        dots = rr.Points2D.columns(positions=predicted.reshape(-1, 2)).partition([points] * steps)
        self._send("scene/predicted", before, dots)
        words = [wording.in_lines(f"says: {one.in_time(self._short)}{'' if one.trusted else ' ?'}") for one in said]
        ends = rr.Points2D.columns(positions=predicted[:, -1], colors=colours.legible(_shades(said)), labels=words)
        self._send("scene/says", before, ends)

    def _send_verdicts(self, take: _Take) -> None:
        """At the end of each window: the way that was predicted at its beginning, and whether it went so."""
        said, real, steps_ago = take.said, take.real, take.horizon_steps
        take.place.set(self._recording)
        for entity in ("scene/then", "scene/verdict"):
            self._recording.log(entity, rr.Clear(recursive=False))
        begun = [i for i in np.unique(picture.made_at(said)) if i + steps_ago <= len(said) and said[i].known]
        if not begun:
            return
        times = take.place.columns(np.add(begun, steps_ago))
        true = [said[i].phrase == real[i] for i in begun]
        paths = picture.thinned(self._drawn(np.stack([said[i].trusted_path for i in begun])))
        shades = np.where(np.array(true)[:, None], colours.GREEN, colours.PINK).astype(np.uint8)
        self._send("scene/then", times, rr.LineStrips2D.columns(strips=paths, colors=shades))
        words = [wording.verdict_line(steps_ago, said[i].phrase, real[i]) for i in begun]
        width, height = self._task.scene_size
        bottom = np.tile(np.array([width / 2, height], np.float32), (len(begun), 1))
        self._send("scene/verdict", times, rr.Points2D.columns(positions=bottom, colors=shades, labels=words))

    def _send_told(self, take: _Take) -> None:
        rows = picture.changes(take.instructed)
        top = np.tile([self._task.scene_size[0] / 2, 0.0], (len(rows), 1))
        labels = [f"instruction: {take.instructed[i]}" for i in rows]
        self._send("scene/told", take.place.columns(rows), rr.Points2D.columns(positions=top, labels=labels))

    def _send_signals(self, take: _Take) -> None:
        episode, said = take.watched.episode, take.said
        instructions = np.array(episode.instructions, float)
        instructions[~np.asarray(episode.given, bool)] = np.nan
        movements = movements_said(said)
        movements[~np.array([one.meant for one in said], bool)] = np.nan  # a word that says nothing has no number
        times = take.place.columns(np.arange(len(said) + 1))
        for name, values in (("instruction", instructions), ("explanation", movements)):
            values = np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan)  # no line on to the next episode
            for number, column in enumerate(values.T):
                path = f"{picture.entity(self._task, 'signal', number)}/{name}"
                self._send(path, times, rr.Scalars.columns(scalars=column))

    def _send_said(self, take: _Take) -> None:
        """Where in the film each cluster is said."""
        said = take.said
        rows = [i for i in picture.changes([one.cluster for one in said]) if said[i].known]
        for cluster in sorted({said[i].cluster for i in rows}):
            at = [i for i in rows if said[i].cluster == cluster]
            path = f"{view.SAID}/{cluster}"
            colour = colours.of_clusters(np.array([cluster]))
            points = rr.SeriesPoints(colors=colour, names=[f"#{cluster}"], marker_sizes=[4])
            self._recording.log(path, points, static=True)
            values = [float(said[i].expression[0]) for i in at]
            self._send(path, take.place.columns(at), rr.Scalars.columns(scalars=values))

    def _send_lanes(self, take: _Take) -> None:
        for one in take.said:
            self._shade(one.said, one.expression, one.known)
        lanes = [self._lane("instruction", take.instructed)]
        for number, span in enumerate(take.said[0].all_spans):
            spoken = [one.all_spans[number] for one in take.said]
            for each in spoken:
                self._shade(each.said, each.expression, each.known)
            lanes.append(self._lane(wording.span_name(span.horizon_steps), [each.said for each in spoken]))
        take.place.set(self._recording)
        log_lanes(self._recording, lanes)
        steps = len(take.said)
        self._send(f"{ENTITY}/now", take.place.columns(np.arange(steps)), step_marks(steps, len(lanes)))

    def _send_answers(self, take: _Take) -> None:
        take.place.set(self._recording)
        drawn = self._drawn if self._task.scene_path is not None else None
        shade = self._shade_of
        AnswersOfEpisode(self._recording, self._task, take.said, take.place.columns, drawn, self._short, shade).send()

    def _shade_of(self, one: Explanation) -> Array:
        self._shade(one.said, one.expression, one.known)
        return self._shades[one.said]

    def _shade(self, words: str, expression: Array, known: bool) -> None:
        if known:
            self._shades.setdefault(words, colours.of_expressions(np.asarray(expression)[None])[0])

    def _lane(self, name: str, words: Sequence[str]) -> Lane:
        grey = np.array(colours.SILENT_GREY, np.uint8)
        words = [word for _, word in without_flicker([(name, word) for word in words])]
        return Lane(name, [*map(self._short, words)], np.stack([self._shades.get(each, grey) for each in words]))

    def _send_now(self, take: _Take, head: str, standing: Callable[[int], str]) -> None:
        said, instructed, steps_ago = take.said, take.instructed, take.horizon_steps
        made = picture.made_at(said)[: max(0, len(said) - steps_ago)]
        verdicts = [""] * min(steps_ago, len(said))
        verdicts += [wording.verdict_line(steps_ago, said[i].said, take.real[i]) for i in made]
        spoken = [(one.in_time(), one.cluster) for one in said]
        answers = [sentence_at(one, self._short) for one in last_asked(said)]
        rows = picture.changes(list(zip(instructed, spoken, verdicts, answers, strict=True)))
        lines = (
            (
                head,
                wording.said_lines(instructed[i], said[i]),
                wording.literal(verdicts[i]),
                wording.literal(answers[i]),
            )
            for i in rows
        )
        texts = ["  \n".join(each).rstrip() for each in lines]
        self._send_texts("now", take, rows, texts)
        rows = picture.changes([one.cluster for one in said])
        self._send_texts("words", take, rows, [standing(said[i].cluster) for i in rows])

    def _send_texts(self, path: str, take: _Take, rows: Sequence[int], texts: Sequence[str]) -> None:
        columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
        self._send(path, take.place.columns(rows), columns)

    def _send_spoken(self, take: _Take) -> None:
        said, success = take.said, take.watched.episode.success
        self._send_alone(take)
        rows = picture.changes([one.in_time() for one in said])
        texts = [f"+{i}  {said[i].in_time(self._short)}" for i in rows]
        texts.append(f"+{len(said)}  end of the episode: {'success' if success else 'no success'}")
        end = np.array([colours.GREEN if success else colours.PINK], np.uint8)
        shades = np.concatenate([_shades([said[i] for i in rows]), end])
        columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts), color=shades)
        self._send("log", take.place.columns([*rows, len(said)]), columns)
        words = spoken_words(take.watched.moments, said, self._task.phrases)
        hits = [float(one.phrase == real) if one.meant else np.nan for one, real in zip(said, take.real, strict=True)]
        every = spoken_rows(words, said, np.array(hits), steady=False)
        self._send_texts("spoken", take, [0], [markdown(said, every)])

    def _send_alone(self, take: _Take) -> None:
        """What a moment alone says where an earlier phrase still holds: at a level that the viewer can hide."""
        alone = [one.of_the_moment if one.meant else None for one in take.said]
        if rows := [i for i in picture.changes(alone) if alone[i] is not None]:
            texts = [f"+{i}  this moment alone: {self._short(str(alone[i]))}" for i in rows]
            columns = rr.TextLog.columns(text=texts, level=["TRACE"] * len(rows))
            self._send("log/alone", take.place.columns(rows), columns)


def _shades(said: Sequence[Explanation]) -> Array:
    """Colours ``(N, 3)`` of expressions, grey where the agent does not know."""
    known = np.array([one.known for one in said])[:, None]
    shades = colours.of_expressions(np.array([one.expression for one in said]))
    return np.where(known, shades, colours.SILENT_GREY).astype(np.uint8)
