"""What an instruction brought about."""

import numpy as np
import pytest

from ibe_rl.ibe import Meaning, TooLittleDataError
from ibe_rl.ibe.movement import movement_of_one, typical_movement


def test_a_typical_movement_is_what_one_unit_of_instruction_brought_about():
    """Told 1 and -1 it went 2 and -4 (3 on average), told 0 anywhere; along the second axis against it."""
    places, told = np.array([[2.0, -1], [-4, 1], [9, 9]]), np.array([[1.0, 1], [-1, -1], [0, 0]])
    np.testing.assert_allclose(typical_movement(places, told, np.ones(3)), [3, -1])
    np.testing.assert_allclose(typical_movement(places, told, np.array([3, 1, 1])), [2.5, -1])
    half = np.array([[0.5], [-0.5]])
    np.testing.assert_allclose(typical_movement(half, half, np.ones(2)), [1])


@pytest.mark.parametrize(("moved", "told"), [(1.0, 0.0), (0.0, 1.0)])
def test_if_no_instruction_moved_anything_nothing_is_typical(moved: float, told: float):
    with pytest.raises(TooLittleDataError, match="no instruction but 0 has moved anything yet"):
        typical_movement(np.full((3, 1), moved), np.full((3, 1), told), np.ones(3))


def test_where_the_meaning_is_known_one_is_a_movement_that_way_however_little_was_followed():
    """Told 1 it mostly went down by 2: 1 is half of the mean movement, upwards; unknown it stays what the best did."""
    places, told = np.array([[-2.0], [-2], [-2], [2]]), np.ones((4, 1))
    known, unknown = Meaning(), Meaning.unknown("nobody knows", 4)
    assert movement_of_one(places, told, np.ones(4), ()).tolist() == [-1]
    assert movement_of_one(places, told, np.ones(4), (unknown,)).tolist() == [-1]
    assert movement_of_one(places, told, np.ones(4), (known,)).tolist() == [1]
    assert movement_of_one(-places, told, np.array([1.0, 1, 1, 0]), (known,)).tolist() == [2]
