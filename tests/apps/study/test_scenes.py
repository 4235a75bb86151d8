"""What people see: the environment's own drawing, or lines where it has none or would give the answer away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lifts import DRAWN, LIFT, ride, with_figures

from ibe_rl.apps.study.scenes import LINES_SIZE, scene_of

UP = ride(range(11))
FLOWN = [UP.episode]


def test_its_own_drawing_is_shown_as_it_is() -> None:
    scene, watched = scene_of(DRAWN, FLOWN, 24), with_figures(UP)
    assert scene.size == (20.0, 10.0)
    assert scene.background(watched) == [{"points": [[0.0, 0.0], [0.0, 0.0]], "colour": [9, 9, 9], "closed": False}]
    assert scene.frame(watched, 3, 0) == [{"points": [[3.0, 1.0]], "colour": [1, 2, 3], "closed": True}]
    np.testing.assert_allclose(scene.share(np.array([[5.0], [20.0], [40.0]])), [0.25, 1.0, 1.0])


def test_a_place_without_a_figure_is_a_mark_at_the_end_of_its_way() -> None:
    way, mark = scene_of(DRAWN, FLOWN, 24).frame(UP, 3, 1)
    assert way["points"] == [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]
    assert mark["closed"]
    np.testing.assert_allclose(np.mean(mark["points"], axis=0), [3.0, 3.0])


def test_a_goal_that_cannot_be_hidden_would_tell_the_answer() -> None:
    telling = replace(DRAWN, goal_offset=lambda states: 5 - states)
    assert scene_of(telling, FLOWN, 24).size == LINES_SIZE
    assert scene_of(telling, FLOWN, 24, goal_may_show=True).size == (20.0, 10.0)
    assert scene_of(replace(telling, hidden_goal={"flags": False}), FLOWN, 24).size == (20.0, 10.0)


def test_one_number_is_drawn_over_time() -> None:
    scene = scene_of(LIFT, FLOWN, 10)
    points = scene.points(np.array([[0.0], [5.0], [10.0]]), since=0)
    assert points[1, 0] == LINES_SIZE[0] / 2
    assert np.ptp(np.diff(points[:, 1])) < 1e-9
    assert 0 < points[0, 1] < points[1, 1]
    assert scene.points(np.array([[5.0]]), since=10)[0, 1] < LINES_SIZE[1]
    [edge] = scene.background(UP)
    assert {tuple(point) for point in edge["points"]} == {(x, y) for x in (0.0, 16.0) for y in (0.0, 10.0)}


def test_two_numbers_are_a_plane_and_what_lies_outside_is_at_its_edge() -> None:
    plane = replace(
        LIFT,
        state_names=("x", "y"),
        state_units=("", ""),
        explained=(0, 1),
        explained_band=(0.5, 0.5),
        explained_range=(1.0, 1.0),
        phrases=LIFT.phrases * 2,
    )
    flown = replace(UP.episode, states=np.repeat(UP.episode.states, 2, axis=1))
    scene = scene_of(plane, [flown], 10)
    middle, corner = scene.points(np.array([[5.0, 5.0], [99.0, -99.0]]))
    np.testing.assert_allclose(middle, [8.0, 5.0])
    np.testing.assert_allclose(corner, [16.0, 0.0])


def test_what_never_moves_is_in_the_middle() -> None:
    still = replace(UP.episode, states=np.full((11, 1), 3.0))
    assert scene_of(LIFT, [still], 10).share(np.array([[3.0]])) == 0.5
