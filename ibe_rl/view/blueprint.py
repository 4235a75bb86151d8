"""The layout of the live view: which panel shows which part of a recording, and in which colours."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TimelineColumn

from ibe_rl.task import Shape, Task
from ibe_rl.view import picture
from ibe_rl.view.palette import BACKGROUND, BLUE, EXPLANATION, GREEN, INSTRUCTED, PALE, PINK, TRAIL

FRAMES, WATCHED_STEP = "frames", "watched_step"
FILM_FPS = 50
"""Steps a second when the film plays."""
WINDOW_STEPS = 320
"""How much of a watched episode the panels over time show; what is longer scrolls."""

CURVES = {
    "train/return_mean": ("training", (110, 110, 120)),
    "eval/return_mean": ("greedy", GREEN),
    "train/success_rate": ("success, training", (110, 110, 120)),
    "eval/success_rate": ("success, greedy", GREEN),
    "ibe/came_true": ("went as predicted", EXPLANATION),
    "ibe/came_true_stale": ("in the words before", PALE),
    "ibe/motion_auc": ("tells the way", BLUE),
    "ibe/echo_auc": ("an echo tells it", INSTRUCTED),
    "ibe/staleness": ("staleness", INSTRUCTED),
    "ibe/vocabulary_drift": ("words changed", PINK),
    "ibe/policy_drift": ("acts otherwise", BLUE),
}
"""Metrics with a curve in the view: name in the legend and colour."""


def blueprint(task: Task, training: bool = True) -> rrb.Blueprint:
    """Lay out all panels, or without ``training`` those of an episode; the watched episodes play as a film."""
    scene = [_scene(task)] if task.scene_path is not None else []
    words = rrb.Vertical(*_episode(task), row_shares=[*_shared(task, 22), 27, 51])
    if training:
        shown = rrb.Horizontal(*scene, words, column_shares=[54, 46][-1 - len(scene) :])
        left = rrb.Vertical(shown, rrb.Horizontal(*_development(task)), row_shares=[67, 33])
        panels = rrb.Horizontal(left, _right(task), column_shares=[69, 31])
    else:
        panels = rrb.Horizontal(
            *scene, rrb.Vertical(*_episode(task), _spoken(), row_shares=[*_shared(task, 30), 24, 16, 30])
        )
    return rrb.Blueprint(
        panels,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="expanded"),
        rrb.TimePanel(state="collapsed", timeline=WATCHED_STEP, play_state="playing", fps=FILM_FPS),
        auto_views=False,
    )


def _development(task: Task) -> list[rrb.View]:
    """Curves over the training."""
    success = ["train/success_rate", "eval/success_rate"]
    truth = ["ibe/came_true", "ibe/came_true_stale", "ibe/motion_auc", "ibe/echo_auc"]
    moved = ["ibe/vocabulary_drift", "ibe/policy_drift", "ibe/staleness"]
    expressions = [(f"/{picture.entity(task, 'development', number)}", title) for number, title in _numbers(task)]
    hidden = rrb.PlotLegend(visible=False)
    return [
        _over_training("Return", _curves("train/return_mean", "eval/return_mean")),
        _over_training("Success, truth", _curves(*success, *truth), y_range=(-0.02, 1.06)),
        _over_training("Moved since last", _curves(*moved), rrb.PlotLegend("RightTop")),
        *(_over_training(f"Expressions{title}", [f"{path}/**"], hidden) for path, title in expressions),
    ]


def _numbers(task: Task) -> list[tuple[int, str]]:
    """The numbers of an instruction, and what titles end on to tell them apart; nothing if there is but one."""
    several = task.instruction_size > 1
    return [(number, f": {name}" if several else "") for number, name in enumerate(task.number_names)]


def _shared(task: Task, share: float) -> list[float]:
    """The room of the panels of all numbers: of one as given, of each further one a third more together."""
    numbers = task.instruction_size
    return [share * (2 + numbers) / 3 / numbers] * numbers


def _episode(task: Task) -> list[rrb.View]:
    """What is told and said over the steps of an episode, and now."""
    recent = rrb.TimeRange(
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-WINDOW_STEPS),
        end=rrb.TimeRangeBoundary.cursor_relative(seq=5),
    )
    signals = [
        rrb.TimeSeriesView(
            origin=f"/{picture.entity(task, 'signal', number)}",
            name=f"Instruction (yellow), explanation (teal){title}",
            axis_x=rrb.TimeAxis(view_range=recent),
            axis_y=rrb.ScalarAxis(range=(-1.1, 1.1)),
            plot_legend=rrb.PlotLegend(visible=False),
        )
        for number, title in _numbers(task)
    ]
    lanes = rrb.StateTimelineView(origin="/says", name="In words", time_view=rrb.TimeAxis(view_range=recent))
    now = rrb.TextDocumentView(origin="/now", name="Now")
    return [*signals, lanes, now]


def _right(task: Task) -> rrb.Container:
    return rrb.Vertical(
        rrb.Spatial2DView(
            origin="/vocabulary",
            name="What the best episodes did, by cluster",
            background=list(BACKGROUND),
            visual_bounds=rrb.VisualBounds2D(x_range=(-1.2, 1.2), y_range=(-0.84, 0.82)),
        ),
        _beside([_expressions(task, number, title) for number, title in _numbers(task)]),
        _beside([_changes(task, number) for number in range(task.instruction_size)]),
        _spoken(),
        row_shares=[37, 18, 18, 27],
    )


def _beside(views: Sequence[rrb.View]) -> rrb.View | rrb.Container:
    return views[0] if len(views) == 1 else rrb.Horizontal(*views)


def _expressions(task: Task, number: int, title: str) -> rrb.View:
    origin = f"/{picture.entity(task, 'expression', number)}"
    return rrb.BarChartView(origin=origin, name=f"Expressions now{title}", plot_legend=rrb.PlotLegend(visible=False))


def _changes(task: Task, number: int) -> rrb.View:
    unit = f" ({task.state_units[task.explained[number]]})" if task.instruction_size == 1 else ""
    return rrb.BarChartView(
        origin=f"/{picture.entity(task, 'change', number)}",
        name=f"Δ{task.number_names[number]}{unit}: best green, peak cut",
        plot_legend=rrb.PlotLegend(visible=False),
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
        name=f"{task.name}: flown, predicted (dots), predicted before (line)",
        background=list(BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height)),
    )


def _curves(*metrics: str) -> list[str]:
    return [f"/curves/{metric}" for metric in metrics]


def _over_training(
    name: str,
    contents: Sequence[str],
    legend: rrb.PlotLegend | None = None,
    y_range: tuple[float, float] | None = None,
) -> rrb.View:
    boundary = rrb.TimeRangeBoundary.infinite()
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=list(contents),
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=boundary, end=boundary)),
        axis_y=None if y_range is None else rrb.ScalarAxis(range=y_range),
        plot_legend=legend or rrb.PlotLegend("RightBottom"),
    )


def log_styles(recording: rr.RecordingStream, task: Task) -> None:
    """Log the colours, widths and names that never change."""

    def static(path: str, *what: rr.AsComponents) -> None:
        recording.log(path, *what, static=True)

    for key, (name, colour) in CURVES.items():
        static(f"curves/{key}", rr.SeriesLines(colors=[colour], names=[name], widths=[2]))
        if not key.startswith("train/"):  # too few rows for a line that is seen
            static(f"curves/{key}", rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[3]))
    for name, colour, width, mode in (
        ("instruction", INSTRUCTED, 2.5, rr.components.InterpolationMode.StepAfter),
        ("explanation", EXPLANATION, 1.5, rr.components.InterpolationMode.Linear),
    ):
        for number in range(task.instruction_size):
            line = rr.SeriesLines(colors=[colour], names=[name], widths=[width], interpolation_mode=mode)
            static(f"{picture.entity(task, 'signal', number)}/{name}", line)
    static("scene/trail", rr.LineStrips2D.from_fields(colors=[TRAIL], radii=rr.Radius.ui_points(1.5)))
    static("scene/then", rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.0)))
    static("scene/verdict", rr.Points2D.from_fields(radii=rr.Radius.ui_points(1), show_labels=True))
    static("scene/says", rr.Points2D.from_fields(radii=rr.Radius.ui_points(4), show_labels=True, draw_order=55.0))
    static("scene/told", rr.Points2D.from_fields(colors=[INSTRUCTED], radii=rr.Radius.ui_points(1), show_labels=True))
    static(
        "scene/predicted",
        rr.Points2D.from_fields(colors=[EXPLANATION], radii=rr.Radius.ui_points(2.5), draw_order=50.0),
    )


def line_styles(shapes: Sequence[Shape]) -> rr.LineStrips2D:
    """Colours and widths of shapes, without where they are."""
    return rr.LineStrips2D.from_fields(colors=[s.colour for s in shapes], radii=[s.radius for s in shapes])


def log_background(recording: rr.RecordingStream, shapes: Sequence[Shape], height: float) -> None:
    """Draw what stands still, in a scene of this height in scene units."""
    lines = [picture.strip(shape, height) for shape in shapes]
    colours, radii = [shape.colour for shape in shapes], [shape.radius for shape in shapes]
    recording.log("scene/background", rr.LineStrips2D(lines, colors=colours, radii=radii))
