"""What every file of configs/mapping/ has to keep to, on the same small log: the protocol ``ibe_rl.types.Mapping``."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import TASK
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from ibe_rl.config.kind_files import register
from ibe_rl.ibe import ClusterMapping, IBEConfig
from ibe_rl.types import Array, Episode, ExpressionMapping
from ibe_rl.vocabulary.fitting import fit_mapping

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
PRESETS = sorted(path.stem for path in (CONFIGS / "mapping").glob("*.yaml"))
EVERY_PRESET = pytest.mark.parametrize("preset", PRESETS)
HORIZON_STEPS = 5


@cache
def episodes() -> tuple[Episode, ...]:
    """Forty episodes of a lift that is instructed to go to height 0, and mostly does, at its own speed."""
    random, made = np.random.default_rng(0), []
    for number in range(40):
        heights, instruction = [random.uniform(-12, 12)], []
        speed = random.uniform(0.3, 1.5)
        for _ in range(30):
            instruction.append(-np.sign(heights[-1]) * (abs(heights[-1]) > 1))
            heights.append(heights[-1] + instruction[-1] * speed + random.normal(0, 0.05))
        states = np.column_stack([heights, random.normal(0, 5, 31), np.full(31, number % 2)])
        given = random.random(30) < 0.9
        instructions = (np.array(instruction) * given)[:, None]
        context = TASK.contexts[number % 2]
        made.append(Episode(states, np.zeros(30), np.zeros(30), instructions, given, True, True, context))
    return tuple(made)


def settings(preset: str) -> IBEConfig:
    register()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        chosen: Any = OmegaConf.to_object(compose("train", [f"mapping={preset}"]))
    return replace(chosen.mapping, horizon_steps=HORIZON_STEPS, spans_steps=[])


@cache
def learn(preset: str, seed: int = 0) -> ClusterMapping:
    return fit_mapping(episodes(), episodes(), settings(preset), TASK, seed)


def changes() -> Array:
    """Changes seen and unseen, none, and far ones."""
    random = np.random.default_rng(1)
    return np.concatenate([random.normal(0, 4, (200, 3)), np.zeros((1, 3)), 1e4 * np.eye(3), -1e4 * np.eye(3)])


def test_there_are_presets():
    assert len(PRESETS) >= 12


@EVERY_PRESET
def test_it_keeps_to_the_protocol(preset: str):
    mapping: ExpressionMapping = learn(preset)
    delta, k = changes(), settings(preset).n_clusters
    assert mapping.ids.tolist() == list(range(k))
    clusters, said, sure = mapping.cluster(delta), mapping.express(delta), mapping.confidence(delta)
    assert clusters.shape == sure.shape == (len(delta),)
    assert said.shape == (len(delta), 1)
    assert set(clusters) <= set(range(k))
    assert np.isfinite(said).all()
    assert np.abs(said).max() <= 1 + 1e-12
    assert sure.min() >= 0
    assert sure.max() <= 1
    assert mapping.express(delta[:1]).shape == (1, 1)
    np.testing.assert_allclose(mapping.express(delta[5:6]), said[5:6], atol=1e-9)  # each by itself


@EVERY_PRESET
def test_its_clusters_are_in_rising_order_and_stand_on_the_windows(preset: str):
    mapping = learn(preset)
    assert (np.diff(mapping.expressions[:, 0]) >= 0).all()
    assert np.abs(mapping.expressions).max() <= 1
    assert mapping.sizes.sum() == sum(int(episode.given.sum()) for episode in episodes())
    assert np.abs(mapping.mean_instructions).max() <= 1
    assert mapping.membership == settings(preset).membership


@EVERY_PRESET
def test_it_says_up_for_up_and_down_for_down(preset: str):
    """At the speed at which the lift mostly goes; nothing for nothing is asked of those without a literal spread."""
    mapping = learn(preset)
    up, down = mapping.express(np.array([[4.5, 0, 0], [-4.5, 0, 0]]))[:, 0]
    assert up > 0.2
    assert down < -0.2


@EVERY_PRESET
def test_it_comes_back_from_json_saying_the_same(preset: str):
    mapping = learn(preset)
    again = ClusterMapping.from_dict(json.loads(json.dumps(mapping.to_dict())))
    assert again.to_dict() == mapping.to_dict()
    np.testing.assert_array_equal(again.express(changes()), mapping.express(changes()))
    np.testing.assert_array_equal(again.cluster(changes()), mapping.cluster(changes()))


@EVERY_PRESET
def test_the_same_seed_learns_the_same(preset: str):
    again = fit_mapping(episodes(), episodes(), settings(preset), TASK, 0)
    assert again.to_dict() == learn(preset).to_dict()


@EVERY_PRESET
def test_it_goes_on_from_itself(preset: str):
    """As at the next refresh; those that start from scratch learn the same again."""
    config, first = settings(preset), learn(preset)
    second = fit_mapping(episodes(), episodes(), config, TASK, 0, first)
    assert second.sizes.sum() == first.sizes.sum()
    if config.memory is None:
        assert second.to_dict() == first.to_dict()
    else:
        assert second.evidence.sum() == pytest.approx((1 + config.memory) * first.evidence.sum())
        assert np.abs(second.express(changes()) - first.express(changes())).mean() < 0.1
