"""The settings of an ``IBEMapping``, and their validity, one by one and together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import MappingConfig

SPACES = ("all", "information", "lasso", "network", "rule")
OF_INSTRUCTIONS = ("lasso", "network", "rule")
"""Spaces with an axis for each number of the instruction, in units of what the instruction 1 typically brings about."""


@dataclass
class IBEConfig(MappingConfig):
    """Settings of ``IBEMapping``; the defaults are the paper's."""

    # what is clustered: all dimensions, weighted by information, along a lasso, by a network, or the instructor's axis
    space: str = setting("all", choices=SPACES)
    split: str = setting("kmeans", choices=("kmeans", "bisecting", "quantile"))  # how displacements are clustered
    power: float = setting(1.0, low=0.05, high=1.0)  # exponent of magnitudes; below 1: more clusters for small ones
    symmetric: bool = False  # mirror the clusters, as many on each side of 0
    # of mean instructions: range to [-1, 1], largest magnitude to 1, or expressions as large as the movement
    normalisation: str = setting("minmax", choices=("minmax", "sign", "movement"))
    # the expression is of the nearest cluster, a mean over clusters by proximity, the movement without clusters, or
    # the words are of the nearest cluster and the number beside them is the movement
    membership: str = setting("hard", choices=("hard", "soft", "direct", "graded"))
    weigh_followed: bool = False  # weight windows by how well the instruction was followed
    hidden: list[int] = field(default_factory=lambda: [32, 32])  # layer widths of space=network
    n_init: int = setting(4, low=1)  # k-means initialisations when no earlier vocabulary is used
    memory: float | None = setting(0.85, low=0.0, high=0.99)  # factor on earlier windows' weight; None: from scratch
    max_fit_windows: int = setting(20_000, low=100)  # at most this many windows, sampled at random, are clustered

    def unread(self) -> dict[str, str]:
        """Settings that nothing reads, each with the other setting that makes it so; see ``check_config``."""
        unread = {} if self.space == "network" else {"hidden": f"space={self.space}"}
        return unread | ({"n_init": "split=quantile"} if self.split == "quantile" else {})


def check_settings(estimator: Any) -> None:
    """Refuse settings of an ``IBEMapping`` that are out of range or would be ignored.

    Raises:
        ValueError: naming the setting, its value and what is allowed.
    """
    e, has_axes = estimator, estimator.space in OF_INSTRUCTIONS
    refused = [
        (e.n_clusters < 2, f"n_clusters={e.n_clusters}: at least 2"),
        (not 0 <= e.memory < 1, f"memory={e.memory}: at least 0 and below 1"),
        (e.space not in SPACES, f"space={e.space!r}: choose one of {', '.join(SPACES)}"),
        (not has_axes and e.power != 1, f"power={e.power:g}: allowed is 1 with space={e.space}"),
        (e.space == "network" and e.power != 1, f"power={e.power:g}: allowed is 1 with space={e.space}"),
        (min([1, *e.hidden]) < 1, f"hidden={[*e.hidden]}: each at least 1"),
        (not e.power > 0, f"power={e.power:g}: above 0"),
        (
            not has_axes and e.normalisation == "movement",
            f"normalisation=movement: allowed are minmax, sign with space={e.space}",
        ),
        (
            not has_axes and e.membership in ("direct", "graded"),
            f"membership={e.membership}: allowed are hard, soft with space={e.space}",
        ),
        (
            e.membership == "graded" and e.normalisation != "movement",
            f"membership=graded: allowed are hard, soft, direct with normalisation={e.normalisation}",
        ),
        (not has_axes and e.split == "quantile", f"split=quantile: allowed are kmeans, bisecting with space={e.space}"),
        (e.space == "network" and e.last is not None, "last: allowed is None with space=network, which has no centres"),
        (
            e.split != "kmeans" and e.last is not None,
            f"last: allowed is None with split={e.split}, which starts from scratch",
        ),
    ]
    for wrong, reason in refused:
        if wrong:
            raise ValueError(reason)
