"""The layout of the live view: which panel shows which part of a recording, and in which colours."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from ibe_rl.explain.what_if import values_of
from ibe_rl.task import Shape, Task
from ibe_rl.view import curves, lanes, picture
from ibe_rl.view import palette as colours
from ibe_rl.view.curves import Chart
from ibe_rl.view.palette import BACKGROUND, EXPLANATION, INSTRUCTED, TRAIL, WHITE

FRAMES, FILM = "frames", "film"
FILM_FPS = 50
"""Steps a second when the film plays."""
SAID = "said"
"""Where in the film each cluster is said."""

RETURN_CURVES = {"train/return_mean": ("training", colours.MUTED), "eval/return_mean": ("greedy policy", colours.GREEN)}
SUCCESS_CURVES = {
    "train/success_rate": ("training", colours.MUTED),
    "eval/success_rate": ("greedy policy", colours.GREEN),
}
TRUTH_CURVES = {
    "ibe/came_true": ("as predicted", colours.EXPLANATION),
    "ibe/came_true_stale": ("previous words", colours.PALE),
    "ibe/motion_auc": ("motion AUC", colours.BLUE),
    "ibe/echo_auc": ("echo AUC", colours.INSTRUCTED),
}
CHANGE_CURVES = {
    "ibe/policy_drift": ("policy drift", colours.BLUE),
    "ibe/vocabulary_drift": ("word drift", colours.PINK),
    "ibe/staleness": ("staleness", colours.INSTRUCTED),
}
SHARE = (0.0, 1.0)
MOST_PANELS = 5


def charts(task: Task) -> list[Chart]:
    """The pictures of curves over training, from left to right."""
    numbers = [
        Chart(
            f"charts/{picture.entity(task, 'expression', number)}",
            f"{title}Expression of each cluster",
            limits=(-1, 1),
            prefix=f"{picture.entity(task, 'development', number)}/",
        )
        for number, title in numbers_of(task)
    ]
    return [
        Chart("charts/return", "Return per episode", RETURN_CURVES),
        Chart("charts/success", "Success (share of episodes)", SUCCESS_CURVES, SHARE),
        Chart("charts/truth", "Are its words true? (0 to 1)", TRUTH_CURVES, SHARE),
        Chart("charts/change", "What each refresh changed", CHANGE_CURVES),
        *numbers,
    ]


def blueprint(task: Task, training: bool = True) -> rrb.Blueprint:
    """Lay out all panels, or without ``training`` those of one episode; the episodes play as a film."""
    scene = [] if task.scene_path is None else [rrb.Vertical(_scene(task), _what_if(task), row_shares=[66, 34])]
    return rrb.Blueprint(
        _of_training(task, scene) if training else _of_episode(task, scene),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="expanded"),
        rrb.TimePanel(state="collapsed", timeline=FILM, play_state="playing", fps=FILM_FPS),
        auto_views=False,
    )


def _of_training(task: Task, scene: Sequence[rrb.Container]) -> rrb.Container:
    words = rrb.Vertical(_lanes(), _now(), _words(), row_shares=[27, 24, 49])
    if not scene:
        words = rrb.Vertical(_lanes(), _what_if(task), _now(), _words(), row_shares=[24, 26, 18, 32])
    learnt = rrb.Vertical(
        _clusters(),
        _beside([_changes(task, n) for n in range(len(task.explained))]),
        _beside([_so_far(task, n, title) for n, title in numbers_of(task)]),
        row_shares=[46, 24, 30],
    )
    above = rrb.Horizontal(*scene, words, learnt, column_shares=[31, 36, 33][-2 - len(scene) :])
    below = rrb.Horizontal(*(_chart(chart) for chart in charts(task)))
    return rrb.Vertical(above, below, row_shares=[67, 33])


def _of_episode(task: Task, scene: Sequence[rrb.Container]) -> rrb.Container:
    signals = [_so_far(task, number, title) for number, title in numbers_of(task)]
    spoken = rrb.TextDocumentView(origin="/spoken", name="What it said in this episode")
    above = [_lanes()] if scene else [_lanes(), _what_if(task)]
    shares = [*[22] * len(above), *_shared(task, 20), 22, 36]
    return rrb.Horizontal(*scene, rrb.Vertical(*above, *signals, _now(), spoken, row_shares=shares))


def numbers_of(task: Task) -> list[tuple[int, str]]:
    """The numbers or words of an instruction, and what titles begin with to tell them apart; nothing of only one.

    There is room for the first ``MOST_PANELS`` words.
    """
    if task.words is not None:
        return [(slot, f"{word}: ") for slot, word in enumerate(task.words.names[:MOST_PANELS])]
    several = task.instruction_size > 1
    return [(number, f"{name.replace('_', ' ')}: " if several else "") for number, name in enumerate(task.number_names)]


def _shared(task: Task, share: float) -> list[float]:
    """The room of the panels of all numbers: of one as given, of each further one a third more together."""
    numbers = len(numbers_of(task))
    return [share * (2 + numbers) / 3 / numbers] * numbers


def _lanes() -> rrb.View:
    bounds = rrb.VisualBounds2D(x_range=(0, lanes.PICTURE_WIDTH), y_range=(-0.05, lanes.height(3)))
    return rrb.Spatial2DView(
        origin=f"/{lanes.ENTITY}",
        name="Instruction and explanation, step by step",
        background=list(BACKGROUND),
        visual_bounds=bounds,
    )


def _what_if(task: Task) -> rrb.View:
    values = len(values_of(task))
    bounds = rrb.VisualBounds2D(x_range=(0, lanes.PICTURE_WIDTH), y_range=(-0.05, lanes.height(values + 1)))
    return rrb.Spatial2DView(
        origin=f"/{lanes.IF_TOLD}", name="If it were told otherwise", background=list(BACKGROUND), visual_bounds=bounds
    )


def _now() -> rrb.View:
    return rrb.TextDocumentView(origin="/now", name="Now")


def _words() -> rrb.View:
    return rrb.TextDocumentView(origin="/words", name="Its vocabulary")


def _clusters() -> rrb.View:
    return rrb.Spatial2DView(
        origin="/vocabulary",
        name="Movements in its best episodes, and their clusters",
        background=list(BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(-1.2, 1.2), y_range=(-0.84, 0.82)),
    )


def _so_far(task: Task, number: int, title: str) -> rrb.View:
    """The numbers of all episodes, where a click of the right button moves the film to."""
    boundary = rrb.TimeRangeBoundary.infinite()
    signal = f"/{picture.entity(task, 'signal', number)}/**"
    return rrb.TimeSeriesView(
        origin="/",
        contents=[signal] if number else [signal, f"/{SAID}/**"],
        name=f"{title}Instruction (yellow), explanation (teal); right-click goes there",
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=boundary, end=boundary)),
        axis_y=rrb.ScalarAxis(range=(-1.1, 1.1)),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _beside(views: Sequence[rrb.View]) -> rrb.View | rrb.Container:
    return views[0] if len(views) == 1 else rrb.Horizontal(*views)


def _changes(task: Task, number: int) -> rrb.View:
    name, unit = task.number_names[number].replace("_", " "), task.state_units[task.explained[number]]
    return rrb.Spatial2DView(
        origin=f"/{picture.entity(task, 'change', number)}",
        name=f"{name} change ({unit}): best green, highest bar cut",
        background=list(BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(-1.12, 1.12), y_range=(-0.4, 0.15)),
    )


def _chart(chart: Chart) -> rrb.View:
    width, height = curves.SIZE
    bounds = rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height))
    return rrb.Spatial2DView(
        origin=f"/{chart.entity}", name=chart.title, background=list(BACKGROUND), visual_bounds=bounds
    )


def _scene(task: Task) -> rrb.View:
    width, height = task.scene_size
    return rrb.Spatial2DView(
        origin="/scene",
        name=f"{task.name}: path and prediction",
        background=list(BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height)),
    )


def log_styles(recording: rr.RecordingStream, task: Task) -> None:
    """Log the colours, widths and names that never change."""

    def static(path: str, *what: rr.AsComponents) -> None:
        recording.log(path, *what, static=True)

    for key, (name, colour) in (RETURN_CURVES | SUCCESS_CURVES | TRUTH_CURVES | CHANGE_CURVES).items():
        static(f"curves/{key}", rr.SeriesLines(colors=[colour], names=[name], widths=[2]))
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
    static(lanes.IF_TOLD_PATHS, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.0)))
    for entity in (lanes.ENTITY, lanes.IF_TOLD):
        static(
            f"{entity}/now",
            rr.LineStrips2D.from_fields(colors=[WHITE], radii=rr.Radius.ui_points(1.0), draw_order=60.0),
        )
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
