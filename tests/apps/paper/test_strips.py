"""Episodes are drawn with what was said of them, where they were, and where they were expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lettering import cut_off, drawn, on_each_other
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from outcome import SAID, flights

from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    DEFAULT,
    NO_WORDS,
    OBSERVER_COLOURS,
    OBSERVER_LABELS,
    OBSERVER_MARKERS,
    PAPERS,
    TRUE_END,
)
from ibe_rl.apps.paper.prediction_task import ObservedEpisodes
from ibe_rl.apps.paper.strips import episode_strip, gallery
from ibe_rl.apps.plot_style import hexed
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.view import palette as colours

pytestmark = pytest.mark.slow

TITLE = "Agent B, cut at first contact, episode 12: here our default vocabulary misleads most"


def words(figure: Figure) -> str:
    return "\n".join(text for text, _ in drawn(figure))


def test_the_observers_foretell_a_horizon_before_the_cut() -> None:
    assert flights(AT_END).last_seen(0) == 40
    assert flights(AT_CONTACT).last_seen(0) == 30


def test_a_way_is_in_the_scene_and_holds_both_of_its_ends() -> None:
    assert flights().path(4, 0, 100)[[0, 50, 100]].tolist() == [[3, 9], [7, 6.5], [11, 4]]
    assert len(flights().path(0, 21, 40)) == SEEN_STEPS


def test_a_place_is_where_it_would_be_at_the_end() -> None:
    assert flights(AT_END).place(0, 13.5).tolist() == [13.5, 4]
    assert flights(AT_CONTACT).place(0, 13.5).tolist() == [13.5, 4.5]


def test_errors_are_in_percent_of_the_width() -> None:
    errors = {name: each[3] for name, each in flights().errors().items()}
    assert errors.keys() == OBSERVER_LABELS.keys()
    assert [errors[name] for name in (TRUE_END, DEFAULT, NO_WORDS, PAPERS)] == pytest.approx([0, 2.5, 5, 15], abs=1e-5)


@pytest.mark.parametrize("cut", [AT_END, AT_CONTACT])
def test_a_strip_tells_what_it_shows(cut: str) -> None:
    figure = episode_strip(flights(cut), 11, TITLE)
    said = words(figure)
    parts = (TITLE, "20 frames", "60 frames", "-1 left", "0 straight", "+1 right", "the paper's\nvocabulary")
    for part in (
        *parts,
        "5.0 % off",
        "15.0 % off",
        "2.5 % off",
        OBSERVER_LABELS[NO_WORDS],
        OBSERVER_LABELS[PAPERS],
        OBSERVER_LABELS[DEFAULT],
    ):
        assert part in said
    assert (cut_off(figure), on_each_other(figure)) == ([], [])


def test_what_was_said_has_the_colours_of_the_live_view() -> None:
    scale = episode_strip(flights(), 0, TITLE).axes[0]
    dots = [each for each in scale.collections if len(each.get_offsets()) == SEEN_STEPS]
    for each, name in zip(dots, (PAPERS, DEFAULT), strict=True):
        expected = np.resize(SAID[name], SEEN_STEPS)
        assert each.get_offsets()[:, 0].tolist() == pytest.approx(expected)
        shades = to_rgba_array([hexed(shade) for shade in colours.of_expressions(expected)])
        assert np.allclose(each.get_facecolor(), shades)
    scattered = [each for each in scale.collections if isinstance(each, PathCollection)]
    rings = [each for each in scattered if len(each.get_offsets()) == 1]
    assert [ring.get_offsets()[0, 0] for ring in rings] == [
        SAID[PAPERS][3],
        SAID[DEFAULT][3],
    ]  # what was said last


def guesses(result: ObservedEpisodes, row: int) -> dict[str, tuple[float, float]]:
    """Where each marker of the right panel is, which must be in sight."""
    axis = episode_strip(result, row, TITLE).axes[2]
    found = {}
    for line in axis.lines:
        if len(line.get_xdata()) == 1:
            [[x, y]] = line.get_xydata().tolist()
            assert axis.get_xlim()[0] < x < axis.get_xlim()[1]
            assert axis.get_ylim()[0] < y < axis.get_ylim()[1]
            found[f"{line.get_marker()} {line.get_color()}"] = x, y
    return found


def test_every_observer_points_to_where_it_expects_it() -> None:
    at = guesses(flights(), 4)
    expected = {NO_WORDS: 12, PAPERS: 14, DEFAULT: 11.5, TRUE_END: 11}
    assert at.keys() == {f"{OBSERVER_MARKERS[name]} {OBSERVER_COLOURS[name]}" for name in expected}
    for name, x in expected.items():
        assert at[f"{OBSERVER_MARKERS[name]} {OBSERVER_COLOURS[name]}"][0] == pytest.approx(x)
    heights = [y for _, y in at.values()]
    assert len(set(heights)) == 4  # nobody's marker hides another's
    assert max(heights) < 4  # below the ground


def test_the_first_frames_hide_the_others() -> None:
    found = flights()
    _, before, after = episode_strip(found, 0, TITLE).axes
    assert before.lines[0].get_xydata().tolist() == found.path(0, 21, 40).tolist()
    assert after.lines[0].get_xydata().tolist() == found.path(0, 40, 100).tolist()
    for axis in (before, after):
        way = axis.lines[0].get_xydata()
        assert axis.get_xlim() == (0, 20)
        assert axis.get_ylim()[0] == 0
        assert (way[:, 1] < axis.get_ylim()[1]).all()
    outlines = [len(axis.collections) for axis in (before, after)]
    assert outlines == [1 + 6, 1 + 6]  # the ground; every fourth and every twelfth step, and the last one


@pytest.mark.parametrize("count", [2, 4, 20])
def test_a_gallery_shows_every_episode(count: int) -> None:
    figure = gallery(flights(AT_CONTACT, count), f"Agent C, cut at first contact: all {count} episodes")
    shown = [axis for axis in figure.axes if axis.get_visible()]
    assert [axis.get_title().partition(":")[0] for axis in shown] == [str(row + 1) for row in range(count)]
    said = words(figure)
    for part in (
        "blue",
        "orange",
        f"all {count} episodes",
        *(OBSERVER_LABELS[name] for name in (NO_WORDS, PAPERS, DEFAULT)),
    ):
        assert part in said
    assert all("none 5.0, paper's 15.0, ours 2.5 % off" in axis.get_title() for axis in shown)
    assert (cut_off(figure), on_each_other(figure)) == ([], [])


def test_titles_of_a_gallery_have_room_for_large_errors() -> None:
    found = flights()
    expected = {name: each + 20 for name, each in found.expected.items()}
    figure = gallery(replace(found, expected=expected), "all 20 episodes")
    assert "paper's 115.0" in words(figure)
    assert (cut_off(figure), on_each_other(figure)) == ([], [])


def test_a_gallery_has_the_colours_of_what_was_said() -> None:
    axis = gallery(flights(), "all").axes[0]
    [dots] = [each for each in axis.collections if len(each.get_offsets()) == SEEN_STEPS]
    said = np.resize(SAID[DEFAULT], SEEN_STEPS)
    assert np.allclose(dots.get_facecolor(), to_rgba_array([hexed(one) for one in colours.of_expressions(said)]))
    assert dots.get_offsets().tolist() == flights().path(0, 21, 40).tolist()
