"""Places of changes worked out by hand, and axes that were hidden in made-up data."""

import json
from typing import Any

import numpy as np
import pytest

from ibe_rl.ibe import TooLittleDataError
from ibe_rl.ibe.space import (
    Space,
    along,
    information,
    lasso_axes,
    movement_of_one,
    network,
    rule_axes,
    scaled,
    signed_power,
)
from ibe_rl.types import Array

X, GOAL = 2, 4
"""Of five dimensions of the state, where one is and where one is instructed to go."""
HIDDEN = np.zeros((5, 1))
HIDDEN[[X, GOAL], 0] = 1, -1


def states(count: int = 3_000, seed: int = 0) -> Array:
    """Five numbers of quite different sizes."""
    return np.random.default_rng(seed).normal(size=(count, 5)) * [10, 0.1, 1, 3, 1]


def rule(seen: Array, band: float = 0.3) -> Array:
    """Towards the goal, nothing where it is near."""
    ahead = seen[:, [GOAL]] - seen[:, [X]]
    return np.sign(ahead) * (np.abs(ahead) > band)


def angle(axes: Array, expected: Array, seen: Array) -> float:
    """Degrees between the lines of two axes ``(S, 1)``, in units in which every dimension is spread alike."""
    one, other = (vector[:, 0] * seen.std(axis=0) for vector in (axes, expected))
    return float(np.degrees(np.arccos(abs(one @ other) / np.linalg.norm(one) / np.linalg.norm(other))))


def test_the_axis_that_the_instructor_looks_at_is_found():
    seen = states()
    axes = rule_axes(seen, rule(seen), 0)
    assert axes.shape == (5, 1)
    assert angle(axes, HIDDEN, seen) < 3
    assert axes[X, 0] / axes[GOAL, 0] == pytest.approx(-1, abs=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_found_whatever_the_axes_of_the_state_are(seed: int):
    """Changes are then projected onto the same numbers, up to one factor."""
    seen, random = states(), np.random.default_rng(seed)
    mixing = random.normal(size=(5, 5))
    instruction, delta = rule(seen), states(200, seed=9)
    plain = (delta @ rule_axes(seen, instruction, 0))[:, 0]
    mixed = (delta @ mixing @ rule_axes(seen @ mixing, instruction, 0))[:, 0]
    assert np.degrees(np.arccos(np.corrcoef(plain, mixed)[0, 1])) < 4


def test_wrong_instructions_hardly_turn_it():
    seen, random = states(), np.random.default_rng(1)
    instruction = rule(seen)
    wrong = random.random(len(instruction)) < 0.2
    instruction[wrong] = random.choice([-1.0, 0.0, 1.0], (wrong.sum(), 1))
    assert angle(rule_axes(seen, instruction, 0), HIDDEN, seen) < 1


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_wrong_instructions_draw_nothing_in_that_is_not_read(share: float):
    """An agent that does as it is told has the speed that goes with the instruction, which does not depend on it."""
    seen, random = states(), np.random.default_rng(1)
    instruction = rule(seen)
    seen[:, 3] = instruction[:, 0] + 0.5 * random.normal(size=len(seen))
    wrong = random.random(len(instruction)) < share
    instruction[wrong] = random.choice([-1.0, 0.0, 1.0], (wrong.sum(), 1))
    axes = rule_axes(seen, instruction, 0)
    assert np.flatnonzero(axes).tolist() == [X, GOAL]
    assert axes[X, 0] / axes[GOAL, 0] == pytest.approx(-1, abs=0.05)


def test_the_axis_stays_where_nothing_is_asked_far_out():
    """0 is said near the goal and far from it on either side."""
    seen = states()
    instruction = rule(seen) * (np.abs(seen[:, [GOAL]] - seen[:, [X]]) < 1.5)
    assert angle(rule_axes(seen, instruction, 0), HIDDEN, seen) < 10


def test_two_things_to_say_are_enough():
    seen = states()
    for low, high in ((-1.0, 1.0), (0.0, 1.0)):
        axes = rule_axes(seen, np.where(seen[:, [GOAL]] > seen[:, [X]], high, low), 0)
        assert angle(axes, HIDDEN, seen) < 3
        assert axes[GOAL, 0] > 0  # what rises is told more


def test_instructions_may_be_numbers_on_a_scale():
    seen = states()
    assert angle(rule_axes(seen, np.clip(seen[:, [GOAL]] - seen[:, [X]], -1, 1), 0), HIDDEN, seen) < 3


def test_each_number_of_an_instruction_has_its_axis():
    seen = states()
    other = np.zeros((5, 1))
    other[0] = 1
    axes = rule_axes(seen, np.hstack([rule(seen), np.sign(seen[:, :1])]), 0)
    assert axes.shape == (5, 2)
    assert angle(axes[:, :1], HIDDEN, seen) < 3
    assert angle(axes[:, 1:], other, seen) < 3


def test_a_dimension_that_never_changes_has_no_share():
    seen = states()
    seen[:, 1] = 7
    assert abs(rule_axes(seen, rule(seen), 0)[1, 0]) < 1e-9


def test_an_instructor_who_always_says_the_same_teaches_nothing():
    with pytest.raises(TooLittleDataError, match="the instructor has only ever said 1"):
        rule_axes(states(50), np.ones((50, 1)), 0)


def test_a_sparse_regression_finds_what_moved():
    random = np.random.default_rng(0)
    delta = random.normal(size=(400, 3)) * [1, 10, 0.1]
    axes = lasso_axes(delta, np.column_stack([delta[:, 1] / 10, -2 * delta[:, 2]]), 0)
    np.testing.assert_allclose(axes, [[0, 0], [0.1, 0], [0, -2]], atol=0.02)


def test_information_is_where_the_instruction_shows():
    random = np.random.default_rng(0)
    delta = random.normal(size=(1_000, 3))
    found = information(delta, np.sign(delta[:, 1:2]), 0)
    assert found[1] == pytest.approx(np.log(2), abs=0.05)  # it tells the sign: one of two
    assert found[[0, 2]].max() < 0.05
    both = information(delta, np.sign(delta[:, 1:]), 0)
    assert both[1] == pytest.approx(np.log(2), abs=0.07)
    assert both[2] == pytest.approx(np.log(2), abs=0.07)


def test_information_about_a_scale_is_that_about_its_tenths():
    delta = np.random.default_rng(0).normal(size=(2_000, 2))
    found = information(delta, delta[:, :1], 0)
    assert found[0] == pytest.approx(np.log(10), abs=0.2)
    assert found[1] < 0.1


@pytest.mark.parametrize("learn", [lasso_axes, lambda *given: network(given[0], given[1], np.ones(2, bool), [4], 0)])
def test_a_regression_on_a_handful_of_windows_is_too_little(learn: Any):
    with pytest.raises(TooLittleDataError, match="19 windows are too few for a regression, which needs 20"):
        learn(np.zeros((19, 2)), np.zeros((19, 1)), 0)


def test_a_network_learns_which_way_to_go():
    random = np.random.default_rng(0)
    delta = random.normal(size=(2_000, 3)) * [1, 100, 1] + [0, 50, 0]
    space = network(delta, np.tanh(2 * delta[:, :1]), np.ones(3, bool), [32, 32], 0)
    assert not space.linear
    places = space.place(delta)
    assert np.abs(places - np.tanh(2 * delta[:, :1])).mean() < 0.1
    assert network(delta, np.tanh(delta[:, :2]), np.ones(3, bool), [16], 0).size == 2


def test_a_network_does_not_see_what_is_left_out():
    delta = np.random.default_rng(0).normal(size=(500, 3))
    space = network(delta, np.sign(delta[:, :1]), np.array([True, False, True]), [8], 0)
    np.testing.assert_array_equal(space.place(delta), space.place(delta * [1, -1_000, 1]))
    assert (space.place(delta) != space.place(delta * [1, 1, -1])).any()


def test_a_place_is_a_change_shifted_and_scaled():
    space = scaled(np.array([1.0, 2.0]), np.array([2.0, 0.0]))
    assert (space.size, space.linear) == (2, True)
    assert space.place(np.array([[1.5, 9.0]])).tolist() == [[1, 0]]
    np.testing.assert_allclose(space.change_at(np.array([[1.0, 5.0]])), [[1.5, 2]])


def test_along_an_axis_no_change_stays_no_change_and_roots_are_undone():
    space = along(np.array([[2.0], [0.0]]), power=1 / 3)
    delta = np.array([[0.0, 5], [4, 0], [-4, 9], [-0.5, 0]])
    places = space.place(delta)
    np.testing.assert_allclose(places, [[0], [2], [-2], [-1]])
    np.testing.assert_allclose(space.spread_out(places), delta @ [[2], [0]])
    np.testing.assert_allclose(space.change_at(places), delta * [1, 0])


def test_the_smallest_change_at_a_place_is_found():
    """Along (3, 4) of length 5 the place 1 is at (3, 4) / 25."""
    np.testing.assert_allclose(along(np.array([[3.0], [4.0]])).change_at(np.ones((1, 1))), [[3 / 25, 4 / 25]])


def test_a_layer_follows_the_other_with_a_bend_between():
    """X -> max(x - 1, 0) and max(-x, 0) -> their difference plus one half."""
    space = Space(
        np.zeros(1), (np.array([[1.0, -1.0]]), np.array([[1.0], [-1.0]])), (np.array([-1.0, 0]), np.array([0.5]))
    )
    assert space.place(np.array([[3.0], [0.5], [-2.0]])).tolist() == [[2.5], [0.5], [-1.5]]
    assert (space.size, space.linear) == (1, False)


def test_a_power_keeps_signs():
    np.testing.assert_allclose(signed_power(np.array([-8.0, 0, 8]), 1 / 3), [-2, 0, 2])
    np.testing.assert_array_equal(signed_power(np.array([-8.0, 0, 8]), 1), [-8, 0, 8])


MATRIX, BIAS = np.ones((2, 1)), np.zeros(1)
WRONG: dict[str, tuple[tuple[Any, ...], str]] = {
    "no layer": ((np.zeros(2), (), ()), "0 weights, 0 biases, power 1.0: not a space"),
    "a bias too many": ((np.zeros(2), (MATRIX,), (BIAS, BIAS)), "1 weights, 2 biases"),
    "no power": ((np.zeros(2), (MATRIX,), (BIAS,), 0.0), "power 0.0: not a space"),
    "power is no number": ((np.zeros(2), (MATRIX,), (BIAS,), float("nan")), "power nan: not a space"),
    "a mean too long": ((np.zeros(3), (MATRIX,), (BIAS,)), r"weights has shape \(2, 1\), expected \(3, None\)"),
    "a bias too long": ((np.zeros(2), (MATRIX,), (np.zeros(2),)), r"biases has shape \(2,\), expected \(1,\)"),
    "layers that do not meet": ((np.zeros(2), (MATRIX, MATRIX), (BIAS, BIAS)), r"weights has shape \(2, 1\)"),
    "a flat matrix": ((np.zeros(2), (np.ones(2),), (BIAS,)), r"weights has shape \(2,\)"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_space_is_refused(case: str):
    given, message = WRONG[case]
    with pytest.raises(ValueError, match=message):
        Space(*given)


def test_a_space_survives_json_and_cannot_be_changed():
    space = Space(np.array([1.0, 2]), (np.ones((2, 3)), np.ones((3, 1))), (np.zeros(3), np.ones(1)), 0.5)
    again = Space.from_dict(json.loads(json.dumps(space.to_dict())))
    assert again.to_dict() == space.to_dict()
    delta = np.random.default_rng(0).normal(size=(5, 2))
    np.testing.assert_array_equal(again.place(delta), space.place(delta))
    for array in (space.mean, space.weights[1], space.biases[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    "wrong",
    [{"layers": None}, {"layers": [{}]}, {"layers": [1]}, {"power": None}, {"mean": None}, {"layers": []}],
)
def test_a_damaged_space_is_refused(wrong: dict[str, Any]):
    values = along(np.ones((2, 1))).to_dict()
    with pytest.raises(ValueError, match=r"the space is damaged|not a space|mean has shape"):
        Space.from_dict(values | wrong)
    for name in values:
        with pytest.raises(ValueError, match=f"the space is damaged: '{name}'"):
            Space.from_dict({key: value for key, value in values.items() if key != name})


def test_an_axis_on_which_nothing_moves_is_not_taken():
    """What is said goes with a speed that never changes; the place, which does, is heard of only beside it."""
    random = np.random.default_rng(0)
    speed = random.choice([-1.0, 0.0, 1.0], 400)
    seen = np.column_stack([speed + random.normal(size=400), random.normal(size=400), speed])
    instruction = speed[:, None]
    assert not rule_axes(seen, instruction, 0)[:2].any()
    axes = rule_axes(seen, instruction, 0, np.array([True, True, False]))
    assert np.abs(axes[0, 0]) > 0


NOT_KNOWN = np.array([False])


def test_a_typical_movement_is_what_one_unit_of_instruction_brought_about():
    """Told 1 and -1 it went 2 and -4 (3 on average), told 0 anywhere; along the second axis against it."""
    places, instruction = np.array([[2.0, -1], [-4, 1], [9, 9]]), np.array([[1.0, 1], [-1, -1], [0, 0]])
    np.testing.assert_allclose(movement_of_one(places, instruction, np.ones(3), NOT_KNOWN), [3, -1])
    np.testing.assert_allclose(movement_of_one(places, instruction, np.array([3, 1, 1]), NOT_KNOWN), [2.5, -1])
    half = np.array([[0.5], [-0.5]])
    np.testing.assert_allclose(movement_of_one(half, half, np.ones(2), NOT_KNOWN), [1])


@pytest.mark.parametrize(("moved", "instruction"), [(1.0, 0.0), (0.0, 1.0)])
def test_if_no_instruction_moved_anything_nothing_is_typical(moved: float, instruction: float):
    with pytest.raises(TooLittleDataError, match="nothing has moved under an instruction other than 0"):
        movement_of_one(np.full((3, 1), moved), np.full((3, 1), instruction), np.ones(3), NOT_KNOWN)


def test_where_the_meaning_is_known_one_is_a_movement_that_way_however_little_was_followed():
    """Told 1 it mostly went down by 2: 1 is half of the mean movement, upwards; unknown it stays what the best did."""
    places, instruction = np.array([[-2.0], [-2], [-2], [2]]), np.ones((4, 1))
    known = np.array([True])
    assert movement_of_one(places, instruction, np.ones(4), NOT_KNOWN).tolist() == [-1]
    assert movement_of_one(places, instruction, np.ones(4), known).tolist() == [1]
    assert movement_of_one(-places, instruction, np.array([1.0, 1, 1, 0]), known).tolist() == [2]
