"""One refresh in the recording, read back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from view_data import Rows, column, developed, frames, read, refreshed

from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.ibe import ClusterMapping
from ibe_rl.ibe.space import scaled
from ibe_rl.metrics.histogram import bin_edges, densities
from ibe_rl.view import chart, picture
from ibe_rl.view import palette as colours
from ibe_rl.view.recorder import Recorder
from ibe_rl.vocabulary.refresh import Refresh


def hand_made() -> Refresh:
    """Three clusters side by side in x and apart in angle."""
    centres = np.zeros((3, 9))
    centres[:, 0], centres[:, 4] = (-1, 0, 1), (2, -2, 0)
    expressions = np.array([[-1.0], [0.25], [1.0]])
    sizes, purities = np.array([5, 6, 7]), np.array([0.9, 0.5, 0.8])
    mapping = ClusterMapping(
        scaled(np.zeros(9), np.full(9, 2.0)),
        centres,
        expressions / 2,
        expressions,
        sizes,
        purities,
        sizes,
        np.array([4, 2, 9]),
    )
    return replace(refreshed(), mapping=mapping)


def test_the_curve_of_a_cluster_has_its_expressions_until_it_vanishes(rows: Rows) -> None:
    known = {int(name) for refresh in developed() for name in refresh.mapping.ids}
    assert len(known) > 8  # some emerged
    for name in known:
        curve = rows[f"/development/{name}"]
        values = dict(zip(frames(curve), column(curve, "Scalars:scalars"), strict=True))
        for refresh in developed():
            if name in refresh.mapping.ids:
                rank = refresh.mapping.ids.tolist().index(name)
                assert values[refresh.frame] == pytest.approx([refresh.mapping.expressions[rank, 0]])
            elif refresh.change is not None and name in refresh.change.transition.vanished:
                assert np.isnan(values[refresh.frame][0])


def test_windows_have_the_colour_of_what_they_express(recorder: Recorder, tmp_path: Path) -> None:
    refresh = hand_made()
    recorder.refresh(refresh)
    recorder.close()
    [windows] = read(tmp_path / "recording.rrd")["/vocabulary/windows"]
    shades = colours.of_expressions(refresh.mapping.express(picture.sample(refresh.top))[:, 0])
    drawn = np.array([[colour >> shift & 255 for shift in (24, 16, 8)] for colour in windows["Points2D:colors"]])
    assert np.array_equal(drawn, shades)


def test_the_densities_are_those_of_the_explained_dimension(rows: Rows) -> None:
    refresh = developed()[0]
    groups = [refresh.top.delta[:, 0], refresh.others.delta[:, 0]]
    edges = bin_edges(np.concatenate(groups))
    best, others = densities(groups, edges)
    for name, density, drawn in zip(("best", "others"), (best, others), picture.cut([best, others]), strict=True):
        [line] = rows[f"/change/{name}"][0]["LineStrips2D:strips"]
        assert np.allclose(line, chart.outline_of_bars(drawn / np.max(picture.cut([best, others]))))
        assert 0.95 < density.sum() * (edges[1] - edges[0]) <= 1


def test_a_histogram_is_the_outline_of_its_bars_with_round_numbers_below(rows: Rows) -> None:
    assert chart.outline_of_bars(np.array([0.5, 1.0])).tolist() == [
        [-1, 0], [-1, -0.5 * chart.BARS], [0, -0.5 * chart.BARS], [0, -chart.BARS], [1, -chart.BARS], [1, 0],
    ]  # fmt: skip
    [marks] = [row for row in rows["/change/marks"] if row["frames"] == developed()[0].frame]
    places, labels = np.array(marks["Points2D:positions"])[:, 0], marks["Points2D:labels"]
    assert 3 <= len(labels) <= 5
    assert "0" in labels
    assert np.all(np.abs(places) <= 1)
    limit = bin_edges(np.concatenate([developed()[0].top.delta[:, 0], developed()[0].others.delta[:, 0]]))[-1]
    assert np.allclose(places * limit, [float(label) for label in labels], atol=1e-5)


def test_clusters_are_drawn_in_the_two_dimensions_that_tell_them_apart(recorder: Recorder, tmp_path: Path) -> None:
    recorder.refresh(hand_made())
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    [names] = rows["/vocabulary/names"]
    [marks] = rows["/vocabulary/marks"]
    assert names["Points2D:labels"] == ["#4 -1.00", "#2 +0.25", "#9 +1.00"]
    assert [label for label in marks["Points2D:labels"] if "change" in label] == [
        "→ x change (half widths)",
        "↑ angle change (rad)",
    ]
    points = np.array(rows["/vocabulary/centres"][0]["Points2D:positions"])
    assert np.all(np.diff(points[:, 0]) > 0)
    assert points[0, 1] < points[2, 1] < points[1, 1]  # y down: the largest angle is on top
    assert len(rows["/vocabulary/windows"][0]["Points2D:positions"][0:]) <= picture.SCATTER_POINTS


def test_without_other_episodes_and_spread_the_vocabulary_is_drawn_all_the_same(
    recorder: Recorder, tmp_path: Path
) -> None:
    refresh = refreshed()
    still = replace(refresh.top, delta=np.zeros_like(refresh.top.delta))
    recorder.refresh(replace(refresh, top=still, others=refresh.top[:0]))
    recorder.close()
    [others] = read(tmp_path / "recording.rrd")["/change/others"][0]["LineStrips2D:strips"]
    assert not np.any(np.array(others)[:, 1])


def test_two_numbers_have_panels_of_their_own_and_the_scatter_shows_both(tmp_path: Path) -> None:
    refresh = hand_made()
    both = np.hstack([refresh.mapping.expressions, [[0.5], [-1], [0]]])
    mapping = replace(refresh.mapping, expressions=both, mean_instructions=both)
    recorder = Recorder(tmp_path / "recording.rrd", LANDER_SPEED_TASK, "run")
    recorder.refresh(replace(refresh, mapping=mapping))
    recorder.refresh(replace(refresh, mapping=replace(mapping, ids=np.array([4, 2, 5])), frame=refresh.frame + 1))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    for number, name in enumerate(("x", "vy")):
        drawn = [column(rows[f"/development/{name}/{each}"], "Scalars:scalars")[0] for each in (4, 2, 9)]
        assert np.ravel(drawn) == pytest.approx(both[:, number])
        assert np.isnan(column(rows[f"/development/{name}/9"], "Scalars:scalars")[-1])  # cluster 9 is no more
        assert rows[f"/change/{name}/best"]
    [first, _] = rows["/vocabulary/marks"]
    assert [label for label in first["Points2D:labels"] if "change" in label] == [
        "→ x change (half widths)",
        "↑ vy change (7.5 m/s)",
    ]
    assert rows["/vocabulary/names"][0]["Points2D:labels"] == ["#4", "#2", "#9"]
