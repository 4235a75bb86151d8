"""The layout of the live view: which panel shows which part of a recording, and in which colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TimelineColumn

from ibe_rl import picture
from ibe_rl.data import Array, Shape, Task

if TYPE_CHECKING:
    from ibe_rl.refresh import Refresh

FRAMES, WATCHED_STEP = "frames", "watched_step"
INSTRUCTION, EXPLANATION = (250, 204, 21), (45, 212, 191)
TRAIL, REALLY = (150, 140, 200), (235, 235, 240)
GREEN, PINK, SILENT, OTHERS = (132, 224, 96), (244, 114, 182), (70, 70, 78), (130, 130, 140)
BACKGROUND, AXIS = (13, 14, 20), (150, 150, 160)
SCATTER_HEIGHT = 0.45
"""Of the scatter in units of its half width, for a panel that is broader than high."""
WINDOW_STEPS = 320
"""How much of a watched episode the panels over time show; what is longer scrolls."""

CURVES = {
    "train/return_mean": ("training", (110, 110, 120)),
    "eval/return_mean": ("greedy", GREEN),
    "train/success_rate": ("success, training", (110, 110, 120)),
    "eval/success_rate": ("success, greedy", GREEN),
    "ibe/came_true": ("said came true", EXPLANATION),
}
"""Metrics with a curve in the view: name in the legend and colour."""


def blueprint(task: Task, training: bool = True) -> rrb.Blueprint:
    """Lay out all panels, or without ``training`` those of an episode; the view follows the newest data."""
    if training:
        panels = rrb.Horizontal(_left(task), _middle(), _right(task), column_shares=[38, 32, 30])
    else:
        scene = [_scene(task)] if task.scene_path is not None else []
        panels = rrb.Horizontal(*scene, rrb.Vertical(*_episode(), _spoken(), row_shares=[30, 24, 16, 30]))
    return rrb.Blueprint(
        panels,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=FRAMES, play_state="following", fps=50),
        auto_views=False,
    )


def _left(task: Task) -> rrb.Container:
    curves = rrb.Horizontal(
        _curves("Return per episode", ["train/return_mean", "eval/return_mean"]),
        _curves("Share of episodes", ["train/success_rate", "eval/success_rate", "ibe/came_true"], (-0.02, 1.06)),
    )
    if task.scene_path is None:
        return rrb.Vertical(curves)
    return rrb.Vertical(_scene(task), curves, row_shares=[60, 40])


def _middle() -> rrb.Container:
    return rrb.Vertical(*_episode(), row_shares=[22, 19, 59])


def _episode() -> list[rrb.View]:
    """What is told and said over the steps of an episode, and now."""
    recent = rrb.TimeRange(
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-WINDOW_STEPS),
        end=rrb.TimeRangeBoundary.cursor_relative(seq=5),
    )
    signals = rrb.TimeSeriesView(
        origin="/signal",
        name="Instruction (yellow), explanation (teal)",
        axis_x=rrb.TimeAxis(view_range=recent),
        axis_y=rrb.ScalarAxis(range=(-1.1, 1.1)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
    lanes = rrb.StateTimelineView(origin="/says", name="In words", time_view=rrb.TimeAxis(view_range=recent))
    now = rrb.TextDocumentView(origin="/now", name="Now")
    return [signals, lanes, now]


def _right(task: Task) -> rrb.Container:
    explained, unit = task.state_names[task.explained], task.state_units[task.explained]
    return rrb.Vertical(
        rrb.Spatial2DView(
            origin="/vocabulary",
            name="What the best episodes did, by cluster",
            background=list(BACKGROUND),
            visual_bounds=rrb.VisualBounds2D(x_range=(-1.2, 1.2), y_range=(-0.72, 0.76)),
        ),
        rrb.BarChartView(
            origin="/expression",
            name="Expression of each cluster",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        rrb.BarChartView(
            origin="/change",
            name=f"Δ{explained} ({unit}): best green, peak cut",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        _spoken(),
        row_shares=[37, 18, 18, 27],
    )


def _spoken() -> rrb.View:
    return rrb.TextLogView(
        origin="/log",
        name="Spoken",
        columns=rrb.TextLogColumns(
            timeline_columns=[TimelineColumn(timeline=FRAMES, visible=False)],
            text_log_columns=[TextLogColumn("body")],
        ),
        format_options=rrb.TextLogFormat(monospace_body=False),
    )


def _scene(task: Task) -> rrb.View:
    width, height = task.scene_size
    return rrb.Spatial2DView(
        origin="/scene",
        name=f"{task.name}: flown, predicted (dots), real (white)",
        background=list(BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height)),
    )


def _curves(name: str, keys: Sequence[str], y_range: tuple[float, float] | None = None) -> rrb.View:
    boundary = rrb.TimeRangeBoundary.infinite()
    whole = rrb.TimeRange(start=boundary, end=boundary)
    return rrb.TimeSeriesView(
        name=name,
        origin="/curves",
        contents=[f"/curves/{key}" for key in keys],
        axis_x=rrb.TimeAxis(view_range=whole),
        axis_y=None if y_range is None else rrb.ScalarAxis(range=y_range),
        plot_legend=rrb.PlotLegend("RightBottom"),
    )


def style(recording: rr.RecordingStream, task: Task) -> None:
    """Log the colours, widths and names that never change."""

    def static(path: str, *what: rr.AsComponents) -> None:
        recording.log(path, *what, static=True)

    for key, (name, colour) in CURVES.items():
        static(f"curves/{key}", rr.SeriesLines(colors=[colour], names=[name], widths=[2]))
        if not key.startswith("train/"):  # too few rows for a line that is seen
            static(f"curves/{key}", rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[3]))
    numbers = range(task.instruction_size)
    shades = np.linspace(1, 0.5, task.instruction_size)[:, None]
    for name, colour, mode in (
        ("instruction", INSTRUCTION, rr.components.InterpolationMode.StepAfter),
        ("explanation", EXPLANATION, rr.components.InterpolationMode.Linear),
    ):
        lines = rr.SeriesLines(
            colors=(shades * colour).astype(np.uint8),
            names=[name if task.instruction_size == 1 else f"{name} {i + 1}" for i in numbers],
            widths=[2.5 if name == "instruction" else 1.5] * task.instruction_size,
            interpolation_mode=mode,
        )
        static(f"signal/{name}", lines)
    static("scene/trail", rr.LineStrips2D.from_fields(colors=[TRAIL], radii=rr.Radius.ui_points(1.5)))
    static("scene/really", rr.LineStrips2D.from_fields(colors=[REALLY], radii=rr.Radius.ui_points(0.8)))
    static("scene/says", rr.Points2D.from_fields(radii=rr.Radius.ui_points(4), show_labels=True, draw_order=55.0))
    static("scene/told", rr.Points2D.from_fields(colors=[INSTRUCTION], radii=rr.Radius.ui_points(1), show_labels=True))
    static("scene/said", rr.LineStrips2D.from_fields(colors=[[*EXPLANATION, 110]], radii=rr.Radius.ui_points(0.8)))
    static(
        "scene/predicted",
        rr.Points2D.from_fields(colors=[EXPLANATION], radii=rr.Radius.ui_points(2.5), draw_order=50.0),
    )


def look(shapes: Sequence[Shape]) -> rr.LineStrips2D:
    """Colours and widths of shapes, without where they are."""
    return rr.LineStrips2D.from_fields(colors=[s.colour for s in shapes], radii=[s.radius for s in shapes])


def log_background(recording: rr.RecordingStream, shapes: Sequence[Shape], height: float) -> None:
    """Draw what stands still, in a scene of this height in scene units."""
    lines = [picture.strip(shape, height) for shape in shapes]
    colours, radii = [shape.colour for shape in shapes], [shape.radius for shape in shapes]
    recording.log("scene/background", rr.LineStrips2D(lines, colors=colours, radii=radii))


def scatter(across: picture.Axis, up: picture.Axis, delta: Array) -> Array:
    """Changes ``(W, S)`` to points ``(W, 2)`` of the scatter, y down."""
    x, y = (axis.place(delta[:, axis.dimension]) for axis in (across, up))
    return np.stack([x, -SCATTER_HEIGHT * y], axis=-1).astype(np.float32)


def log_axes(recording: rr.RecordingStream, across: picture.Axis, up: picture.Axis) -> None:
    """Draw the axes of the scatter, and its marks and titles along the bottom and the left edge."""
    h = SCATTER_HEIGHT
    zero = -h * float(up.place([0.0])[0])
    lines = [[(-1, zero), (1, zero)], [(0, -h), (0, h)], [(-1, -h), (-1, h), (1, h)]]
    axes = rr.LineStrips2D(lines, colors=[AXIS], radii=rr.Radius.ui_points(0.5))
    recording.log("vocabulary/axes", axes)
    marks = [((x, h), f"{tick:+.2g}") for tick, x in zip(across.ticks(), across.place(across.ticks()), strict=True)]
    marks += [((-1.0, -h * y), f"{tick:+.2g}") for tick, y in zip(up.ticks(), up.place(up.ticks()), strict=True)]
    marks += [((0.6, h + 0.15), f"→ {across.title}"), ((-0.6, h + 0.15), f"↑ {up.title}")]
    places, labels = zip(*marks, strict=True)
    dots = rr.Points2D(places, labels=labels, colors=[AXIS], radii=rr.Radius.ui_points(1.5), show_labels=True)
    recording.log("vocabulary/marks", dots)


def log_centres(recording: rr.RecordingStream, points: Array, shades: Array, labels: Sequence[str]) -> None:
    """Draw the centres ``(k, 2)`` of the clusters, their expressions in a row above, with lines between."""
    size = rr.Radius.ui_points(6)
    recording.log("vocabulary/centres", rr.Points2D(points, colors=shades, radii=size, draw_order=60.0))
    places = picture.label_row(points, -SCATTER_HEIGHT - 0.24)
    leaders = rr.LineStrips2D(np.stack([places, points], axis=1), colors=shades, radii=rr.Radius.ui_points(0.4))
    recording.log("vocabulary/leaders", leaders)
    names = rr.Points2D(places, colors=shades, labels=labels, radii=rr.Radius.ui_points(2), show_labels=True)
    recording.log("vocabulary/names", names)


def log_clusters(recording: rr.RecordingStream, task: Task, refresh: Refresh) -> None:
    """Draw windows of the best episodes and the clusters, by the first number of their expressions."""
    mapping, delta = refresh.mapping, picture.sample(refresh.top)
    across = picture.axis(task, task.explained, delta, symmetric=True)
    second = picture.second_dimension(mapping, task.explained, delta)
    up = picture.axis(task, second, delta, symmetric=False)
    log_axes(recording, across, up)
    expressions = mapping.expressions[:, 0]
    shades = picture.colours(expressions)
    points, size = scatter(across, up, delta), rr.Radius.ui_points(1.3)
    recording.log("vocabulary/windows", rr.Points2D(points, colors=shades[mapping.cluster(delta)], radii=size))
    labels = [f"{expression:+.2f}" for expression in expressions]
    log_centres(recording, scatter(across, up, picture.centres(mapping)), shades, labels)


def log_bars(recording: rr.RecordingStream, task: Task, refresh: Refresh) -> None:
    """Draw the expressions, and how the explained dimension changed in the best and in other episodes."""
    expressions = refresh.mapping.expressions[:, 0]
    recording.log("expression/negative", rr.BarChart(np.minimum(expressions, 0), color=picture.BLUE))
    recording.log("expression/positive", rr.BarChart(np.maximum(expressions, 0), color=picture.ORANGE))
    best, others = (windows.delta[:, task.explained] for windows in (refresh.top, refresh.others))
    middles, width, *densities = picture.histogram(best, others)
    widths = np.full(len(middles), width, np.float32)
    for name, density, colour in zip(("best", "others"), picture.cut(densities), (GREEN, OTHERS), strict=True):
        chart = rr.BarChart(density, abscissa=middles, widths=widths, color=(*colour, 150))
        recording.log(f"change/{name}", chart)
