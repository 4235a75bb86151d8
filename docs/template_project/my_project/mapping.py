"""A kind of vocabulary: what is nearly 0 is called 0."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from ibe_rl import IBEMapping
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import MappingConfig


@dataclass
class QuietConfig(MappingConfig):
    """The settings of all mappings, and one more."""

    quiet: float = setting(0.1, low=0.0, high=1.0)  # expressions closer to 0 than this are 0


class QuietMapping(IBEMapping):
    """IBE with a quiet middle."""

    settings = QuietConfig

    def __init__(self, quiet: float, n_clusters: int, last: Any, random_state: int) -> None:
        super().__init__(n_clusters, last=last, random_state=random_state)
        self.quiet = quiet

    def fit(self, *data: Any, **more: Any) -> Self:
        """Fit as IBE does, then silence what is nearly 0."""
        super().fit(*data, **more)
        expressions = self.mapping_.expressions
        self.mapping_ = replace(self.mapping_, expressions=np.where(abs(expressions) < self.quiet, 0.0, expressions))
        return self
