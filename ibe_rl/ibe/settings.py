"""Validity of the settings of an ``IBEMapping``, one by one and together."""

from __future__ import annotations

from typing import Any

SPACES = ("all", "information", "lasso", "network", "rule")
OF_INSTRUCTIONS = ("lasso", "network", "rule")
"""Spaces with an axis for each number of the instruction, in units of what the instruction 1 typically brings about."""


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
        (not has_axes and e.membership == "direct", f"membership=direct: allowed are hard, soft with space={e.space}"),
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
