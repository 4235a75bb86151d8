"""The settings of the reports that explain.py writes: what is compared, repeated and summed up."""

from __future__ import annotations

from dataclasses import dataclass, field

from ibe_rl.config.setting import setting


@dataclass
class CompareConfig:
    """Which mappings ``task=compare`` compares."""

    mappings: list[str] = field(default_factory=list)  # names of choices of mapping; empty: all


@dataclass
class FiguresConfig:
    """The paper's experiments, repeated with the agents of a run (``task=figures``)."""

    seed: int = setting(0, low=0, high=999)  # of the episodes and of the sampled futures
    episodes: int = setting(200, low=10, high=10_000)  # rolled out with each of the agents A, B and C
    checked_episodes: int = setting(100, low=2, high=10_000)  # held out from vocabulary learning
    prediction_episodes: int = setting(20, low=2, high=1_000)  # whose outcome simulated observers predict
    clusterings: int = setting(8, low=1, high=1_000)  # per vocabulary; word rates are averaged over them
    shuffles: int = setting(20, low=1, high=1_000)  # negative controls: vocabularies from shuffled instructions
    resamples: int = setting(1_000, low=20, high=100_000)  # bootstrap over episodes, for confidence intervals


@dataclass
class SummaryConfig:
    """The episodes from which ``task=summary`` tells what an agent does."""

    seed: int = setting(0, low=0, high=999)  # of the episodes and of the sampled futures
    episodes: int = setting(30, low=2, high=500)  # held out, greedy, each explained at every step
    films: int = setting(5, low=1, high=20)  # of the episodes that differ most, shown as films
    resamples: int = setting(1_000, low=20, high=100_000)  # bootstrap over episodes, for confidence intervals
