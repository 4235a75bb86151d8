"""The dark ground, the colours and the ways of drawing that all figures share."""

from __future__ import annotations

import numpy as np
import pytest
from lettering import cut_off, drawn, on_each_other
from matplotlib import rc_context
from matplotlib.figure import Figure
from outcome import UNKNOWN, estimate, flights

from ibe_rl.apps.paper.names import (
    DEFAULT,
    OBSERVER_COLOURS,
    OBSERVER_LABELS,
    OBSERVER_MARKERS,
    PAPERS,
    SIGNS_KEPT,
    SPLIT_MINMAX,
    VARIANT_LABELS,
)
from ibe_rl.apps.plot_style import DARK, grid, hexed, interval
from ibe_rl.view import palette as colours


def test_colours_are_written_as_matplotlib_takes_them() -> None:
    assert hexed((255, 0, 16)) == "#ff0010"
    assert hexed(np.array([13, 14, 20], np.uint8)) == "#0d0e14"


def test_a_tick_says_its_value_where_all_are_nearly_the_same() -> None:
    with rc_context(DARK):
        figure = Figure()
        axis = figure.subplots()
        axis.plot([-145.3012, -145.3008], [0, 1])
        figure.canvas.draw()
    assert axis.xaxis.get_major_formatter().get_offset() == ""
    assert [float(tick.get_text().replace("\u2212", "-")) for tick in axis.get_xticklabels()] == pytest.approx(
        axis.get_xticks()
    )


def test_every_observer_has_its_words_its_colour_and_its_marker() -> None:
    observers = flights().expected.keys()
    assert OBSERVER_LABELS.keys() == OBSERVER_COLOURS.keys() == OBSERVER_MARKERS.keys() == observers
    assert len(set(OBSERVER_LABELS.values())) == len(observers)
    assert VARIANT_LABELS.keys() == {PAPERS, SIGNS_KEPT, SPLIT_MINMAX, DEFAULT}
    looks = {(OBSERVER_COLOURS[name], OBSERVER_MARKERS[name]) for name in observers}
    assert len(looks) == len(observers)  # those of one colour differ in their marker


def test_what_is_in_the_live_view_too_has_its_colours() -> None:
    assert OBSERVER_COLOURS[DEFAULT] == hexed(colours.EXPLANATION)
    assert OBSERVER_COLOURS["true_future"] == hexed(colours.GREEN)
    with rc_context(DARK):
        figure, [[axis]] = grid(1, 1, 4, 3)
    assert figure.get_facecolor()[:3] == pytest.approx(np.array(colours.BACKGROUND) / 255)
    assert axis.get_facecolor()[:3] == pytest.approx(np.array(colours.BACKGROUND) / 255)


def test_a_grid_has_its_size_and_its_rows() -> None:
    figure, rows = grid(3, 2, 11, 4.5, sharex=True)
    assert figure.get_size_inches().tolist() == [11, 4.5]
    assert [len(axes) for axes in rows] == [2, 2, 2]
    assert rows[0][1].get_shared_x_axes().joined(rows[0][1], rows[2][0])


def test_an_interval_is_a_line_with_its_value_on_it() -> None:
    _, [[axis]] = grid(1, 1, 4, 3)
    interval(axis, estimate(0.5, 0.25), 3, "red", "D")
    line, point = axis.lines
    assert line.get_xydata().tolist() == [[0.25, 3], [0.75, 3]]
    assert (point.get_xydata().tolist(), point.get_marker()) == ([[0.5, 3]], "D")


def test_of_what_is_not_known_nothing_is_drawn() -> None:
    _, [[axis]] = grid(1, 1, 4, 3)
    interval(axis, UNKNOWN, 0, "red")
    assert not axis.lines
    interval(axis, UNKNOWN | {"value": 0.5}, 0, "red")
    assert [line.get_xydata().tolist() for line in axis.lines] == [[[0.5, 0]]]


def test_words_that_hide_each_other_or_are_cut_off_are_found() -> None:
    figure = Figure(figsize=(4, 3))
    axis = figure.subplots()
    axis.set(xticks=[0, 0.5, 9], yticks=[], xlim=(0, 1))  # 9 is beyond the limits: nobody sees it
    assert [text for text, _ in drawn(figure)] == ["0.0", "0.5"]
    assert (cut_off(figure), on_each_other(figure)) == ([], [])
    axis.text(0.4, 0.5, "over")
    axis.text(0.41, 0.5, "each other")
    axis.text(0.9, 0.9, "beyond the edge")
    axis.text(0.1, 0.1, "hidden", visible=False)
    assert cut_off(figure) == ["beyond the edge"]
    assert on_each_other(figure) == [("over", "each other")]
