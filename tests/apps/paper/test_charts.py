"""The figures show what they were given, in words that can be read; how they look was looked at by eye."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from lettering import cut_off, drawn, on_each_other
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from outcome import SAID, UNKNOWN, found

from ibe_rl.apps.paper import charts
from ibe_rl.apps.paper.names import DEFAULT, OBSERVER_COLOURS, OBSERVER_LABELS, PAPERS, VARIANT_LABELS
from ibe_rl.apps.plot_style import hexed
from ibe_rl.view import palette as colours

pytestmark = pytest.mark.slow

FOUND = found()
CHARTS: dict[Callable[[dict[str, Any]], Figure], set[str]] = {
    charts.policies_chart: {"training frames", "success (%)", "A, evaluated again: 74.5 %", "83.3 %", "95 % intervals"},
    charts.movements_chart: {
        "change of x (half widths)",
        "density",
        "agent A",
        "agent C",
        "falling to the left",
        "25 %",
    },
    charts.claim_chart: {"chance", "agent B", "as in the paper", "same pad", "95 % intervals"},
    charts.expressions_chart: {
        "Agent B",
        "the paper's vocabulary",
        "our default vocabulary",
        "windows (%)",
        "skew +0.08",
    },
    charts.straight_chart: {"change of x (half widths)", "called straight (%)", "to the left", "to the right", "(%)"},
    charts.errors_chart: {"no people", "% of the width", "Agent C", *OBSERVER_LABELS.values()},
    charts.episodes_chart: {
        "episode",
        "% of the width",
        "Agent B",
        OBSERVER_LABELS[PAPERS],
        OBSERVER_LABELS[DEFAULT],
    },
}
OF_ONE = [chart for chart in CHARTS if chart is not charts.policies_chart]

each_chart = pytest.mark.parametrize("chart", CHARTS, ids=lambda chart: chart.__name__)


def words(figure: Figure) -> str:
    return "\n".join(text for text, _ in drawn(figure))


@each_chart
def test_a_figure_tells_what_it_shows(chart: Callable[[dict[str, Any]], Figure]) -> None:
    figure = chart(FOUND)
    said = words(figure)
    assert figure.get_suptitle() in said
    for part in CHARTS[chart]:
        assert part in said


@each_chart
def test_all_words_can_be_read(chart: Callable[[dict[str, Any]], Figure]) -> None:
    figure = chart(FOUND)
    assert cut_off(figure) == []
    assert on_each_other(figure) == []


@pytest.mark.parametrize("chart", OF_ONE, ids=lambda chart: chart.__name__)
def test_one_agent_is_enough(chart: Callable[[dict[str, Any]], Figure]) -> None:
    figure = chart(found(["C"]))
    assert "gent C" in words(figure)
    assert "gent B" not in words(figure)
    assert (cut_off(figure), on_each_other(figure)) == ([], [])


def nothing_known() -> dict[str, Any]:
    """Nobody was ever told so, nothing ever moved, and no group to compare with was there."""
    bare = deepcopy(FOUND)
    for agent in bare["preliminary"]:
        for group in agent["told"].values():
            empty = {"windows": 0, "mean": None, "density": [0.0] * 41}
            group |= {"shown_to": 0.0, "best": empty, "others": empty, "claim": dict.fromkeys(group["claim"])}
    for agent in bare["straight"]:
        agent["by_movement"] = {
            PAPERS: [],
            DEFAULT: [row | UNKNOWN for row in agent["by_movement"][DEFAULT]],
        }
        agent["rates"] = {name: dict.fromkeys(rates, UNKNOWN) for name, rates in agent["rates"].items()}
    for agent in bare["prediction"]:
        for cut in agent["cuts"].values():
            cut["error"] = {name: {**UNKNOWN, "value": each["value"]} for name, each in cut["error"].items()}
    return bare


@each_chart
def test_what_is_not_known_leaves_a_gap(chart: Callable[[dict[str, Any]], Figure]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = chart(nothing_known())
        assert on_each_other(figure) == []


def test_a_peak_in_one_bin_is_shown_whole() -> None:
    alone = deepcopy(FOUND)
    density = [0.0] * 20 + [50.0] + [0.0] * 20
    for agent in alone["preliminary"]:
        group = agent["told"]["0.0"]
        group["shown_to"] = 0.0
        group["best"]["density"] = group["others"]["density"] = density
    axis = charts.movements_chart(alone).axes[1]
    assert axis.get_ylim()[1] >= 50
    assert "peak cut" not in [text.get_text() for text in axis.texts]


def test_a_peak_that_is_cut_is_said_to_be() -> None:
    for axis in charts.movements_chart(FOUND).axes:
        assert axis.get_ylim() == (0, 6.25)
        assert [text.get_text() for text in axis.texts] == ["peak cut"]


@pytest.mark.parametrize("success", [0.0, 0.5, 1.0])
def test_agents_with_one_policy_can_be_distinguished(success: float) -> None:
    same = deepcopy(FOUND)
    for agent in same["agents"]:
        agent |= {"frame": 2_000_896, "success": {"value": success, "low": success, "high": success}}
    figure = charts.policies_chart(same)
    assert (cut_off(figure), on_each_other(figure)) == ([], [])
    [axis], [legend] = figure.axes, figure.legends
    [last] = [line for line in axis.lines if str(line.get_label()).startswith("C, ")]
    assert not legend.get_window_extent().contains(*axis.transData.transform(last.get_xydata()[0]))


def test_the_paper_is_drawn_beside_the_agents() -> None:
    [axis] = charts.policies_chart(FOUND).axes
    levels = [line.get_ydata()[0] for line in axis.lines if line.get_linestyle() == ":"]
    assert levels == pytest.approx([100 * 19 / 30, 100 * 25 / 30])
    assert axis.collections[0].get_offsets()[0].tolist() == [30, 2]  # thousand frames, percent


def test_histograms_have_the_colours_of_the_live_view() -> None:
    shades = {patch.get_label(): patch.get_edgecolor() for patch in charts.movements_chart(FOUND).axes[0].patches}
    assert shades["the best episodes"] == pytest.approx(to_rgba_array(hexed(colours.GREEN))[0])
    assert shades["the other episodes"] == pytest.approx(to_rgba_array(hexed(colours.MUTED))[0])


def test_the_claim_is_drawn_over_all_episodes_and_within_contexts() -> None:
    for axis in charts.claim_chart(FOUND).axes:
        points = [line.get_xydata()[0].tolist() for line in axis.lines if line.get_xydata().shape == (1, 2)]
        assert points == [[0.67, pytest.approx(place + shift)] for place in range(3) for shift in (-0.13, 0.13)]


def test_clusters_have_the_colour_of_what_they_are_called() -> None:
    figure = charts.expressions_chart(FOUND)
    for axis, name in zip(figure.axes[:2], (PAPERS, DEFAULT), strict=True):
        shades = to_rgba_array([hexed(each) for each in colours.of_expressions(np.array(SAID[name]))])
        dots = axis.collections[-1]
        assert dots.get_offsets()[:, 1].tolist() == pytest.approx(SAID[name])
        assert np.allclose(dots.get_facecolor(), shades)
    assert sum(bar.get_height() for bar in figure.axes[2].patches) == pytest.approx(100)


def test_small_movements_are_distinguished_by_their_side() -> None:
    left, right, *_ = charts.straight_chart(FOUND).axes
    assert [line.get_color() for line in left.lines] == [OBSERVER_COLOURS[PAPERS], OBSERVER_COLOURS[DEFAULT]]
    assert [label.get_text() for label in right.get_yticklabels()] == [*VARIANT_LABELS.values()]
    shares = [bar.get_width() for bar in right.patches]
    assert shares[:4] == pytest.approx([36, 7, 18, 12])  # straight and wrong to the left, then to the right
    assert shares[-4:] == pytest.approx([0, 7, 0, 12])


def test_observers_are_drawn_at_their_errors() -> None:
    axis = charts.errors_chart(FOUND).axes[0]
    at = {line.get_color(): line.get_xdata()[0] for line in axis.lines if len(line.get_xdata()) == 1}
    for name, off in ((DEFAULT, 2.5), (PAPERS, 15), ("no_explanation", 5), ("true_future", 0)):
        assert at[OBSERVER_COLOURS[name]] == pytest.approx(off, abs=1e-4), name


def test_every_episode_has_its_place() -> None:
    for axis in charts.episodes_chart(FOUND).axes:
        assert axis.get_xticks().tolist() == [*range(1, 21)]
        assert [len(line.get_xdata()) for line in axis.lines] == [20, 20, 20]
