"""Mirror images: what changes places and signs, and what is refused."""

import numpy as np
import pytest

from ibe_rl.task.mirror import Mirror, SignedPermutation

NAMES = ("x", "height", "left", "right")
MIRROR = Mirror(flipped=("x",), swapped=(("left", "right"),), instruction=(-1.0, 1.0), actions=(0, 2, 1))


def test_states_observations_and_actions_change_places_and_signs():
    assert MIRROR.of_states(NAMES)(np.array([[1.0, 2, 3, 4]])).tolist() == [[-1, 2, 4, 3]]
    assert MIRROR.of_observations(NAMES)(np.array([1.0, 2, 3, 4, 5, 6, 1])).tolist() == [-1, 2, 4, 3, -5, 6, 1]
    assert MIRROR.of_actions() == SignedPermutation((0, 2, 1), (1.0, 1.0, 1.0))
    assert Mirror(("x",), action_signs=(1.0, -1.0)).of_actions() == SignedPermutation((0, 1), (1.0, -1.0))


@pytest.mark.parametrize(
    ("order", "signs"), [((1, 2, 0), (1, 1, 1)), ((0, 0), (1, 1)), ((0, 1), (1,)), ((0,), (2,)), ((1, 0), (1, -1))]
)
def test_what_is_not_back_after_two_times_is_no_mirror_image(order: tuple[int, ...], signs: tuple[float, ...]):
    with pytest.raises(ValueError, match="allowed is what twice changes nothing"):
        SignedPermutation(order, signs)


@pytest.mark.parametrize(
    ("mirror", "message"),
    [
        (Mirror(("y",), instruction=(1.0,)), "Task.mirror: y: allowed are x, height, left, right"),
        (Mirror(("x",), actions=(1, 2, 0)), "Task.mirror: order"),
        (Mirror(("x",), instruction=(1.0, 1.0)), r"Task.mirror.instruction=\(1.0, 1.0\): allowed are 1 signs"),
    ],
)
def test_a_mirror_image_that_does_not_fit_is_refused(mirror: Mirror, message: str):
    with pytest.raises(ValueError, match=message):
        mirror.check(NAMES, 1)
