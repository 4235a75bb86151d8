"""Metrics of one's own in an evaluation: they score what each explainer said, beside the metrics that come along."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np

from ibe_rl.config.kinds import make_several
from ibe_rl.config.settings import MetricConfig
from ibe_rl.evaluation import tables
from ibe_rl.evaluation.rows import Samples, Statements, Truth, own_columns
from ibe_rl.runtime.printed import raised
from ibe_rl.types import Array
from ibe_rl.vocabulary.listener import Metric


class OwnMetrics:
    """Asks metrics of one's own; one that raises is named and no longer asked.

    Args:
        metrics: in the order of their columns.
    """

    def __init__(self, metrics: Sequence[Metric] = ()):
        self._metrics = list(metrics)

    @classmethod
    def of(cls, configs: Mapping[str, MetricConfig]) -> Self:
        """Make them.

        Raises:
            ConfigError: if one cannot be made.
        """
        return cls(make_several("metric", configs))

    def score(self, statements: Statements) -> Samples:
        """All their scores ``(R,)`` of one explainer."""
        scores: Samples = {}
        for metric in [*self._metrics]:
            try:
                found = metric.score(statements)
                scores |= {name: _fitting(name, values, statements.truth) for name, values in found.items()}
            except Exception as error:  # user code may raise anything
                self._metrics.remove(metric)
                tables.console().print(
                    f"warning: the metric {type(metric).__name__} failed at {statements.explainer} ({raised(error)}): "
                    "it is not asked any more",
                    markup=False,
                    soft_wrap=True,
                )
        return scores


def _fitting(name: str, values: Any, truth: Truth) -> Array:
    if not own_columns([name]):
        raise ValueError(f"its score {name} has the name of another column")
    found = np.asarray(values, float)
    if found.shape != (len(truth.weights),):
        raise ValueError(f"its score {name} has the shape {found.shape}, not ({len(truth.weights)},)")
    return found
