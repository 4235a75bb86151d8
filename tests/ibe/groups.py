"""Changes of the state that fall into three obvious groups."""

from typing import Any

import numpy as np

from ibe_rl.ibe import ClusterMapping, IBEMapping
from ibe_rl.types import Array

LEFT, DOWN, RIGHT = [-3.0, 0.0], [0.0, -3.0], [3.0, 0.0]


def groups() -> tuple[Array, Array]:
    """Four windows to the left, six straight down, two to the right, with what had been said before each."""
    near = np.random.default_rng(0).normal(0, 0.05, (12, 2))
    delta = np.array([LEFT] * 4 + [DOWN] * 6 + [RIGHT] * 2) + near
    instruction = np.array([-1, -1, -1, 0, 0, 0, 0, 0, 1, -1, 1, 1], float)
    order = np.random.default_rng(1).permutation(12)
    return delta[order], instruction[order]


def fit(**settings: Any) -> IBEMapping:
    return IBEMapping(**({"n_clusters": 3, "random_state": 0} | settings)).fit(*groups())


def weight(mapping: ClusterMapping) -> Array:
    """What each dimension is multiplied with; 0 for one left out."""
    found: Array = np.diag(mapping.space.weights[0])
    return found
