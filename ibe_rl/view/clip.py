"""An explained episode as frames of a moving picture.

Left: the scene, or where the environment draws none, the way of the state dimensions that the words are about: two in
their plane, one over time. Right: what the
instructor says, what the agent says about its next steps and whether it went so, and both as numbers on a gauge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.task import RecordedRollout, Shape, Task
from ibe_rl.types import Array, Explanation
from ibe_rl.view import palette as colours
from ibe_rl.view import wording

FRAME_WIDTH, FRAME_HEIGHT, SCENE = 960, 480, 520
"""Of a frame, and of the scene at its left, in pixels; MP4 wants multiples of 16 or less common players fail."""
FINER = 2
"""Drawn this much larger and scaled down, so that lines are smooth."""
FRAMES_PER_S = 25
MOST_GAUGES = 3
"""Numbers of an instruction that have a gauge of their own."""
Point = tuple[float, float]


@dataclass(frozen=True)
class Clip:
    """An episode of ``T`` steps to draw.

    Attributes:
        task: of the environment.
        watched: the episode.
        said: ``T`` explanations.
        real: ``T`` phrases of what then happened.
        steps_per_s: of the environment.
    """

    task: Task
    watched: RecordedRollout
    said: Sequence[Explanation]
    real: Sequence[str]
    steps_per_s: float

    @property
    def stride_steps(self) -> int:
        """Steps from one frame to the next."""
        return max(1, round(self.steps_per_s / FRAMES_PER_S))

    @property
    def frames_per_s(self) -> float:
        """Frames per second, so that it runs as fast as the environment."""
        return self.steps_per_s / self.stride_steps


def frames_of(clip: Clip) -> Iterator[Image.Image]:
    """All frames of a clip, ``FRAME_WIDTH`` by ``FRAME_HEIGHT``; the last one is its end."""
    steps = len(clip.said)
    scene = _scene(clip)
    ground = Image.new("RGB", (FRAME_WIDTH * FINER, FRAME_HEIGHT * FINER), colours.BACKGROUND)
    scene.draw_background(ImageDraw.Draw(ground))
    for step in [*range(0, steps, clip.stride_steps), steps]:
        large = ground.copy()
        draw = ImageDraw.Draw(large)
        scene.draw(draw, step)
        _draw_words(draw, clip, min(step, steps - 1), ended=step == steps)
        yield large.reduce(FINER)


@dataclass(frozen=True)
class _Scene:
    """The left half: shapes and the way in a plane, with the predicted way.

    Attributes:
        clip: the episode.
        way: consecutive states ``(N, S)`` and the step of the first one, to points ``(N, 2)``, y up.
        low: ``(2,)`` lower left corner of what is shown.
        size: ``(2,)`` width and height of it.
        same_scale: whether both directions have the same scale.
        names: of the two directions, where no scene is drawn.
    """

    clip: Clip
    way: Callable[[Array, int], Array]
    low: Array
    size: Array
    same_scale: bool
    names: tuple[str, ...] = ()

    def _place(self, points: Array) -> list[Point]:
        """Points ``(P, 2)`` to pixels, in the middle of the left half."""
        room, margin = np.array([SCENE, FRAME_HEIGHT]) * FINER, 24.0 * FINER
        scale = (room - 2 * margin) / self.size
        scale = np.full(2, scale.min()) if self.same_scale else scale
        moved = (np.asarray(points, float) - self.low - self.size / 2) * scale * [1, -1] + room / 2
        return [(float(x), float(y)) for x, y in moved]

    def draw_background(self, draw: ImageDraw.ImageDraw) -> None:
        """Draw what does not move, and the names of the directions."""
        for shape in self.clip.watched.background:
            self._shape(draw, shape)
        for name, at, anchor in zip(self.names, ((SCENE - 24, FRAME_HEIGHT - 24), (24, 8)), ("rs", "la"), strict=False):
            draw.text((at[0] * FINER, at[1] * FINER), name, colours.AXIS, _font(14), anchor=anchor)

    def draw(self, draw: ImageDraw.ImageDraw, step: int) -> None:
        """Draw the state before the action of ``step``; at ``T`` the last one."""
        watched, said = self.clip.watched, self.clip.said
        states = watched.episode.states
        self._line(draw, self.way(states[: step + 1], 0), colours.TRAIL, 2)
        if step < len(said):
            shade = shade_of(said[step])
            ahead = self._place(self.way(said[step].trusted_path, step))
            for x, y in ahead[:: max(1, len(ahead) // 20)]:
                draw.ellipse(_around(x, y, 2 * FINER), fill=shade)
            draw.ellipse(_around(*ahead[-1], 6 * FINER), fill=shade)
        for shape in watched.figures[step]:
            self._shape(draw, shape)
        if not watched.figures[step]:
            draw.ellipse(
                _around(*self._place(self.way(states[step : step + 1], step))[0], 7 * FINER), fill=colours.WHITE
            )

    def _shape(self, draw: ImageDraw.ImageDraw, shape: Shape) -> None:
        corners = np.concatenate([shape.points, shape.points[:1]]) if shape.closed else shape.points
        self._line(draw, np.asarray(corners), shape.colour, 2)

    def _line(self, draw: ImageDraw.ImageDraw, points: Array, colour: tuple[int, int, int], width: int) -> None:
        if len(points) > 1:
            draw.line(self._place(points), fill=colour, width=width * FINER, joint="curve")


def _scene(clip: Clip) -> _Scene:
    task, draw = clip.task, clip.task.scene_path
    if draw is not None:
        return _Scene(clip, lambda states, _: draw(states), np.zeros(2), np.array(task.scene_size, float), True)
    shown = [*task.explained[:2]]
    names = [f"{task.state_names[i]} {task.state_units[i]}".strip() for i in shown]

    def way(states: Array, first_step: int) -> Array:
        if len(shown) > 1:
            return states[:, shown]
        return np.stack([states[:, shown[0]], first_step + np.arange(len(states))], axis=-1)

    ahead = [way(one.trusted_path, step) for step, one in enumerate(clip.said)]
    points = np.concatenate([way(clip.watched.episode.states, 0), *ahead])
    low, size = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-6)
    return _Scene(clip, way, low - 0.05 * size, 1.1 * size, False, (*names, "steps")[:2])


def _draw_words(draw: ImageDraw.ImageDraw, clip: Clip, step: int, ended: bool) -> None:
    """The right half: title, instruction, explanation, whether it came true, and the gauge."""
    said, moment, task = clip.said[step], clip.watched.moments[step], clip.task
    left, right = SCENE + 16, FRAME_WIDTH - 24
    success = "success" if clip.watched.episode.success else "no success"
    head = f"step {len(clip.said)}, {success}" if ended else f"step {step}"
    _text(draw, (left, 28), f"{task.name}: {clip.watched.episode.context}", colours.WHITE, 18, right - left)
    _text(draw, (left, 56), head, colours.GREEN if ended and success == "success" else colours.AXIS, 15, right - left)
    told = phrase(moment.instruction, task.phrases) if moment.given else "(silent)"
    _text(draw, (left, 100), "the instructor says", colours.AXIS, 14, right - left)
    _text(draw, (left, 122), told, colours.INSTRUCTED, 22, right - left)
    _text(draw, (left, 172), "the agent says", colours.AXIS, 14, right - left)
    sure = f"   {said.confidence:.0%} sure" if said.meant and said.calibrated else ""
    for row, one in enumerate(said.all_spans[:3]):
        _text(draw, (left, 194 + 46 * row), one.said, shade_of(one), 22, right - left)
        about = f"in its {wording.span_name(one.horizon_steps)}{sure if one is said else ''}"
        _text(draw, (left, 220 + 46 * row), about, colours.AXIS, 13, right - left)
    before = step - said.horizon_steps
    if before >= 0:
        earlier, happened = clip.said[before], clip.real[before]
        line = wording.verdict_line(said.horizon_steps, earlier.said, happened)
        shade = colours.GREEN if earlier.said == happened else colours.PINK
        _text(draw, (left, 340), line, shade if earlier.known else colours.AXIS, 14, right - left)
    gauges = min(len(task.phrases) if task.words is None else len(task.words.names), MOST_GAUGES)
    first, apart = (392, 44) if gauges < MOST_GAUGES else (372, 38)
    for number in range(gauges):
        _gauge(draw, (left, right), first + apart * number, said, moment, number, task)


def _gauge(
    draw: ImageDraw.ImageDraw, between: tuple[int, int], y: int, said: Explanation, moment: Any, number: int, task: Task
) -> None:
    """One number of instruction (triangle) and explanation (dot) on a line from -1 to 1."""
    left, right = (x * FINER for x in between)
    middle, half, y = (left + right) / 2, (right - left) / 2, y * FINER
    draw.line([(left, y), (right, y)], fill=colours.GRID, width=4 * FINER)
    for value in (-1, 0, 1):
        x = middle + value * half
        draw.line([(x, y - 7 * FINER), (x, y + 7 * FINER)], fill=colours.AXIS, width=FINER)
        anchor = {-1: "la", 0: "ma", 1: "ra"}[value]
        name = f"{value:+d}" if value else task.expression_names[number]
        draw.text((x, y + 10 * FINER), name, colours.AXIS, _font(12), anchor=anchor)
    if moment.given:
        x, top = middle + float(moment.instruction[number]) * half, y - 6 * FINER
        corners = [(x, top), (x - 7 * FINER, top - 12 * FINER), (x + 7 * FINER, top - 12 * FINER)]
        draw.polygon(corners, fill=colours.INSTRUCTED)
    if said.known:
        draw.ellipse(
            _around(middle + float(movements_said([said])[0, number]) * half, y, 8 * FINER), fill=shade_of(said)
        )


def shade_of(said: Explanation) -> tuple[int, int, int]:
    """The colour of what is said; grey where the agent does not know."""
    if not said.known:
        return colours.MUTED
    red, green, blue = colours.of_expressions(np.asarray(said.expression)[None])[0].tolist()
    return red, green, blue


def _around(x: float, y: float, radius: float) -> tuple[float, float, float, float]:
    return x - radius, y - radius, x + radius, y + radius


def _text(
    draw: ImageDraw.ImageDraw, at: tuple[int, int], text: str, colour: tuple[int, int, int], size: int, width: int
) -> None:
    """One line, in a smaller font if it is too long."""
    while size > 9 and draw.textlength(text, _font(size)) > width * FINER:
        size -= 1
    draw.text((at[0] * FINER, at[1] * FINER), text, colour, _font(size))


def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size * FINER)
