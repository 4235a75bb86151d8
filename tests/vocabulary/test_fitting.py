"""A vocabulary learnt from a log made by hand: which settings reach the estimator, and which are refused."""

from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, WORDS, add, better_half, config, two_floors

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe import IBEMapping
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary import fitting
from ibe_rl.vocabulary.fitting import check_mapping, clusters_of, fewer_clusters, fit_mapping
from ibe_rl.vocabulary.training_episodes import (
    read_training_episodes,
)


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return two_floors(tmp_path / "log")


def fit(log: TrajectoryLog, last: Any = None, horizon_steps: int | None = None, **changes: Any) -> Any:
    settings = better_half(**changes)
    lessons = read_training_episodes(log, settings, seed=0)
    return fit_mapping(lessons.best, lessons.heard, settings, TASK, 0, last, horizon_steps)


def test_the_dimensions_of_the_config_are_clustered_on(log: TrajectoryLog):
    weights = fit(log, dimensions=["height"]).space.weights[0]
    assert (np.diag(weights) > 0).tolist() == [True, False, False]


@pytest.mark.parametrize(("how", "expressions"), [("minmax", [-1, 1]), ("sign", [0, 1])])
def test_the_normalisation_is_the_configs(tmp_path: Path, how: str, expressions: list[float]):
    upwards = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    add(upwards, 1, 1.0)
    add(upwards, 1, 0.0)
    mapping = fit(upwards, normalisation=how, n_clusters=2, top_fraction=1.0)
    assert mapping.expressions[:, 0].tolist() == expressions


def test_the_horizon_is_the_configs_unless_another_is_given(log: TrajectoryLog):
    assert fit(log).sizes.sum() == 4 * (STEPS + 1 - 5)
    assert fit(log, horizon_steps=2).sizes.sum() == 4 * (STEPS + 1 - 2)


def recording(given: list[Any]) -> Any:
    """As ``IBEMapping``, but what it is made with is written down."""

    @wraps(IBEMapping)
    def make(**settings: Any) -> IBEMapping:
        given.append(settings)
        return IBEMapping(**settings)

    return make


def test_a_vocabulary_starts_where_the_last_one_ended(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    last, starts = fit(log), []
    monkeypatch.setattr(fitting, "implementation", lambda *_: recording(starts))
    again = fit(log, last, memory=0.0)
    fit(log, last, memory=0.5)
    fit(log, last, memory=None)
    fit(log)
    assert [settings["last"] for settings in starts] == [last, last, None, None]
    assert [settings["memory"] for settings in starts] == [0, 0.5, 0, config().memory]
    for name in ("centres", "mean_instructions", "expressions", "sizes", "evidence"):
        np.testing.assert_allclose(getattr(again, name), getattr(last, name), atol=1e-12)


def test_every_setting_of_the_estimator_is_the_configs(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    given: list[Any] = []
    monkeypatch.setattr(fitting, "implementation", lambda *_: recording(given))
    changes = {
        "n_clusters": 2, "space": "lasso", "split": "bisecting", "power": 0.5, "symmetric": True,
        "normalisation": "movement", "membership": "soft", "weigh_followed": True, "hidden": [7], "n_init": 3,
        "max_fit_windows": 123, "memory": None,
    }  # fmt: skip
    fit(log, **changes)
    assert {name: given[0][name] for name in changes} == changes | {"memory": 0.0}
    assert set(given[0]) == set(IBEMapping().get_params())


def test_there_are_no_more_clusters_than_windows_and_a_note_says_so(log: TrajectoryLog):
    mapping = fit(log, n_clusters=40)
    assert len(mapping.ids) == 32
    assert fewer_clusters(mapping, better_half(n_clusters=32), TASK) == []
    assert fewer_clusters(mapping, better_half(n_clusters=40), TASK) == [
        "the vocabulary has 32 clusters, not 40 (mapping.n_clusters=40): the best episodes have no more distinct "
        "changes of the state"
    ]
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(1, 1), explained_range=())
    assert (
        "64 (mapping.n_clusters=32 for each of 2 numbers)"
        in fewer_clusters(mapping, better_half(n_clusters=32), both)[0]
    )


def test_a_horizon_longer_than_any_episode_is_refused():
    check_mapping(config(horizon_steps=100), TASK)
    with pytest.raises(
        ConfigError, match=r"mapping\.horizon_steps=101: allowed is at least 1 and at most 100, the len"
    ):
        check_mapping(config(horizon_steps=101), TASK)


@pytest.mark.parametrize("spans", [[101], [20, 0], [-1, 5]])
def test_a_span_that_is_none_is_refused(spans: list[int]):
    check_mapping(config(spans_steps=[1, 100]), TASK)
    check_mapping(config(spans_steps=[]), TASK)
    with pytest.raises(ConfigError) as refused:
        check_mapping(config(spans_steps=spans), TASK)
    assert str(refused.value).startswith(f"mapping.spans_steps={spans}: allowed is at least 1 and at most 100")


def test_an_unknown_dimension_is_refused():
    check_mapping(config(dimensions=["height", "floor"]), TASK)
    with pytest.raises(
        ConfigError, match=r"mapping\.dimensions=\['height', 'colour'\]: allowed are height, speed, floor"
    ):
        check_mapping(config(dimensions=["height", "colour"]), TASK)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"n_clusters": 1}, "mapping.n_clusters=1: at least 2"),
    ({"space": "outer"}, "mapping.space='outer': choose one of all, information, lasso, network, rule"),
    ({"power": 0.5}, "mapping.power=0.5: allowed is 1 with space=all"),
    ({"space": "network", "power": 0.5}, "mapping.power=0.5: allowed is 1 with space=network"),
    ({"space": "rule", "power": 0.0}, "mapping.power=0: above 0"),
    ({"hidden": [0]}, "mapping.hidden=[0]: each at least 1"),
    ({"normalisation": "movement"}, "mapping.normalisation=movement: allowed are minmax, sign with space=all"),
    ({"membership": "direct"}, "mapping.membership=direct: allowed are hard, soft with space=all"),
    ({"split": "quantile"}, "mapping.split=quantile: allowed are kmeans, bisecting with space=all"),
    ({"space": "network", "memory": 0.85}, "mapping.memory=0.85: allowed is null with space=network"),
    ({"split": "bisecting", "memory": 0.0}, "mapping.memory=0.0: allowed is null with split=bisecting"),
]


@pytest.mark.parametrize(("changes", "message"), REFUSED)
def test_settings_that_do_not_go_together_are_refused(changes: dict[str, Any], message: str):
    with pytest.raises(ConfigError) as refused:
        check_mapping(config(**changes), TASK)
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize(
    "changes", [{"space": "network", "memory": None}, {"split": "bisecting", "memory": None}, {"space": "rule"}]
)
def test_what_starts_from_scratch_may_do_so(changes: dict[str, Any]):
    check_mapping(config(**changes), TASK)


def test_each_number_of_an_instruction_gets_its_clusters():
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(1, 1), explained_range=())
    assert clusters_of(config(n_clusters=8), TASK) == 8
    assert clusters_of(config(n_clusters=8), both) == 16


def test_a_horizon_that_is_to_be_found_lets_longer_spans_pass():
    """They are left out once it has been found; a span that is none is refused all the same."""
    check_mapping(config(horizon_steps=None, spans_steps=[20, 400]), TASK)
    with pytest.raises(ConfigError, match=r"mapping\.spans_steps=\[0\]: allowed is at least 1 and at most 100"):
        check_mapping(config(horizon_steps=None, spans_steps=[0]), TASK)


@dataclass
class WideConfig(MappingConfig):
    depth: int = 1
    width: int = 1


class Narrow:
    settings = WideConfig

    def __init__(self, depth: int):
        self.depth = depth


def test_a_setting_that_the_class_does_not_take_is_refused():
    with pytest.raises(ConfigError, match=r"^mapping\.kind=.*:Narrow: its constructor takes no width; allowed is a"):
        check_mapping(WideConfig(kind=f"{__name__}:Narrow", spans_steps=[]), TASK)
