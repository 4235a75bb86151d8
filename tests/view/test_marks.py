"""Round numbers along axes."""

import numpy as np

from ibe_rl.view import marks


def test_marks_are_round_numbers_and_always_two() -> None:
    assert marks.round_steps(0, 401, 2) == [0, 250]
    assert marks.round_steps(-1, 1, 4) == [-1, -0.5, 0, 0.5, 1]
    assert marks.round_steps(-170.0, 20.0, 4) == [-150, -100, -50, 0]
    assert all(2 <= len(marks.round_steps(0, high, 2)) <= 3 for high in np.geomspace(0.01, 1e7, 300))
