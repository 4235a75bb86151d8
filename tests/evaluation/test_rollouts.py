"""Which seeds the episodes of each purpose have, and how far ahead is looked."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from by_hand import TASK

from ibe_rl.collect.collector import SEEDS_PER_RUN
from ibe_rl.collect.rollout import EVALUATION_SEED
from ibe_rl.config.settings import MAX_SEED, EvaluateConfig, TrainConfig
from ibe_rl.evaluation.rollouts import PURPOSES, horizons_of, seeds_for
from ibe_rl.types import ConfigError

RUN: Any = SimpleNamespace(task=TASK, horizon_steps=60)


def limit(schema: type, name: str) -> int:
    return int(schema.__dataclass_fields__[name].metadata["high"])


def test_no_two_purposes_share_an_episode_nor_with_training():
    most, seeds = limit(EvaluateConfig, "episodes"), (0, 1, 998, limit(EvaluateConfig, "seed"))
    ranges = [seeds_for(purpose, seed, most) for purpose in PURPOSES for seed in seeds]
    ordered = sorted(ranges, key=lambda each: each.start)
    assert all(one[-1] < other[0] for one, other in pairwise(ordered))
    assert ordered[0][0] > EVALUATION_SEED + limit(TrainConfig, "eval_episodes")
    assert ordered[0][0] > (MAX_SEED + 1) * SEEDS_PER_RUN
    assert ordered[-1][-1] < 2**31


def test_the_runs_own_horizon_is_always_among_them():
    assert horizons_of(EvaluateConfig(horizons_steps=[40, 20]), RUN) == (20, 40, 60)
    assert horizons_of(EvaluateConfig(horizons_steps=[]), RUN) == (60,)
    assert horizons_of(EvaluateConfig(horizons_steps=[60, 100, 60]), RUN) == (60, 100)


@pytest.mark.parametrize(("longest", "expected"), [(1_000, (4, 20, 40, 60, 100)), (80, (4, 20, 40)), (20, (4,))])
def test_where_none_are_set_they_are_at_most_half_of_an_episode(longest: int, expected: tuple[int, ...]):
    run: Any = SimpleNamespace(task=replace(TASK, max_episode_steps=longest), horizon_steps=4)
    assert horizons_of(EvaluateConfig(), run) == expected


@pytest.mark.parametrize("steps", [0, 101])
def test_a_horizon_no_episode_has_is_refused(steps: int):
    with pytest.raises(ConfigError, match=rf"evaluate.horizons_steps=\[20, {steps}\]: allowed is at least 1 and at mo"):
        horizons_of(EvaluateConfig(horizons_steps=[20, steps]), RUN)
