"""Which episodes and windows of a log made by hand a vocabulary is learnt from, and what cannot be learnt."""

from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, WORDS, add, better_half, config, two_floors

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe import IBEMapping, TooLittleDataError
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError, Episode
from ibe_rl.vocabulary import fitting
from ibe_rl.vocabulary import training_episodes as module
from ibe_rl.vocabulary.fitting import check_mapping, clusters_of, fit_mapping
from ibe_rl.vocabulary.training_episodes import (
    best_windows,
    find_steps,
    horizon_of,
    read_training_episodes,
    settled,
    told_windows,
)


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return two_floors(tmp_path / "log")


def rewards(episodes: Any) -> list[int]:
    return sorted(round(episode.total_reward) for episode in episodes)


def test_the_best_are_apart_from_the_others(log: TrajectoryLog):
    lessons = read_training_episodes(log, better_half(), seed=0)
    assert (lessons.logged, lessons.counted) == (8, 8)
    assert [round(episode.total_reward) for episode in lessons.best] == [100, 99, 98, 97]  # oldest first
    assert rewards(lessons.others) == [47, 48, 49, 50]


def test_the_best_can_be_those_of_each_context(log: TrajectoryLog):
    lessons = read_training_episodes(log, better_half(top_within="context"), seed=0)
    assert rewards(lessons.best) == [49, 50, 99, 100]
    assert rewards(lessons.others) == [47, 48, 97, 98]


def test_the_instructor_is_heard_in_good_and_bad_episodes_as_they_are(log: TrajectoryLog, monkeypatch: Any):
    assert rewards(read_training_episodes(log, better_half(), seed=0).heard) == [47, 48, 49, 50, 97, 98, 99, 100]
    monkeypatch.setattr(module, "OTHER_EPISODES", 2)  # of four: so two of the four best too
    heard = rewards(read_training_episodes(log, better_half(), seed=0).heard)
    assert len(heard) == 4
    assert sum(reward > 60 for reward in heard) == 2
    monkeypatch.setattr(module, "OTHER_EPISODES", 3)  # of six: so one of the two best
    heard = rewards(read_training_episodes(log, better_half(top_fraction=0.25), seed=0).heard)
    assert len(heard) == 4
    assert sum(reward > 98 for reward in heard) == 1
    assert rewards(read_training_episodes(log, config(), seed=0).heard) == [
        47,
        48,
        49,
        50,
        97,
        98,
        99,
        100,
    ]  # all are best
    monkeypatch.setattr(module, "OTHER_EPISODES", 7)
    one = rewards(read_training_episodes(log, better_half(top_fraction=0.1), seed=0).heard)
    assert one == [47, 48, 49, 50, 97, 98, 99, 100]  # at least one of the best


@pytest.mark.parametrize(
    ("newest_frames", "counted"), [(None, 8), (96, 8), (85, 8), (84, 7), (48, 4), (37, 4), (36, 3), (25, 3)]
)
def test_only_what_ended_in_the_newest_frames_counts(log: TrajectoryLog, newest_frames: int | None, counted: int):
    """Eight episodes of twelve frames ended at frame 12, 24, ... 96; the newest 84 frames are 13 to 96."""
    lessons = read_training_episodes(log, better_half(newest_frames=newest_frames), seed=0)
    assert (lessons.logged, lessons.counted) == (8, counted)
    assert len(lessons.best) == np.ceil(counted / 2)
    assert len(lessons.others) == counted - len(lessons.best)


def test_if_nothing_ended_lately_nothing_is_learnt(log: TrajectoryLog):
    log.frames += 100  # an episode that is still flown
    with pytest.raises(TooLittleDataError, match="no episode has ended in the newest 100 frames"):
        read_training_episodes(log, config(newest_frames=100), seed=0)
    assert read_training_episodes(log, config(newest_frames=101), seed=0).counted == 1


def test_without_an_episode_nothing_is_learnt(tmp_path: Path):
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        read_training_episodes(TrajectoryLog(tmp_path, 1_000, TASK.contexts), config(), seed=0)


def test_the_others_are_a_sample(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "OTHER_EPISODES", 1)
    drawn = [rewards(read_training_episodes(log, better_half(), seed).others) for seed in (0, 0, *range(1, 6))]
    assert drawn[0] == drawn[1]
    assert len(drawn[0]) == 1
    assert len({tuple(each) for each in drawn}) > 1
    assert read_training_episodes(log, config(), seed=0).others == []


def test_windows_without_an_instruction_are_not_learnt_from(log: TrajectoryLog):
    add(log, 1000, 1.0, given=False)  # the best of all
    lessons = read_training_episodes(log, better_half(), seed=0)
    windows = best_windows(lessons.best, better_half(), 5)
    assert (lessons.logged, len(lessons.best)) == (9, 5)
    assert windows.given.all()
    assert len(windows) == 4 * (STEPS + 1 - 5)


def flight(terminated: bool, success: bool, steps: int = 10) -> Episode:
    states = np.column_stack([np.arange(steps + 1.0), np.zeros((steps + 1, 2))])
    told, given = np.ones((steps, 1)), np.ones(steps, bool)
    return Episode(states, np.zeros(steps), np.zeros(steps), told, given, terminated, success, "lower")


CRASHED, ARRIVED, CUT_OFF = flight(True, False), flight(True, True), flight(False, False)


@pytest.mark.parametrize(("end", "whole"), [("clamp", 10), ("drop", 7)])
def test_only_windows_that_reach_the_end_of_an_episode_gone_wrong_are_left_out(end: str, whole: int):
    """Of ten steps those that begin at 0 to 5 end, four steps on, before the last state."""
    episodes = [CRASHED, ARRIVED, CUT_OFF]
    kept = told_windows(episodes, config(window_end=end), 4)
    assert kept is not None
    assert np.bincount(kept.episode).tolist() == [whole] * 3
    dropped = told_windows(episodes, config(window_end=end, failed_ends="drop"), 4)
    assert dropped is not None
    assert dropped.step[dropped.episode == 0].tolist() == [0, 1, 2, 3, 4, 5]
    for other in (1, 2):
        assert dropped.step[dropped.episode == other].tolist() == list(range(whole))


def test_if_nothing_but_failed_ends_is_left_it_is_too_little():
    settings = config(window_end="clamp", failed_ends="drop")
    with pytest.raises(
        TooLittleDataError, match=r"the best 1 episodes have no window of 10 .*the longest has 10 steps"
    ):
        best_windows([CRASHED], settings, 10)
    assert len(best_windows([CRASHED], settings, 9)) == 1


def test_without_episodes_there_is_no_window():
    assert told_windows([], config(), 5) is None
    with pytest.raises(TooLittleDataError, match="the best 0 episodes have no window of 5 steps"):
        best_windows([], config(), 5)


def test_too_short_episodes_are_too_little(log: TrajectoryLog):
    best = read_training_episodes(log, better_half(), seed=0).best
    with pytest.raises(
        TooLittleDataError, match=r"the best 4 episodes have no window of 20 .*the longest has 12 steps"
    ):
        best_windows(best, better_half(), 20)


def test_silence_is_too_little(tmp_path: Path):
    silent = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    for told in (1.0, -1.0, 0.0):
        add(silent, 1, told, given=False)
    with pytest.raises(TooLittleDataError, match="have no window of 5 steps with an instruction"):
        best_windows(read_training_episodes(silent, config(), seed=0).best, config(), 5)


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


def test_only_what_was_said_is_heard(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    add(log, 1000, 1.0, given=False)
    episodes = log.read(range(9))
    states, told = module.said_in(episodes, 0)
    assert states.shape == (8 * STEPS, 3)
    assert told.shape == (8 * STEPS, 1)
    assert np.bincount(told[:, 0].astype(int) + 1).tolist() == [2 * STEPS, 4 * STEPS, 2 * STEPS]
    np.testing.assert_array_equal(states[:, 1], told[:, 0])  # the speed is as told: rows belong together
    monkeypatch.setattr(module, "HEARD_STATES", 10)
    assert len(module.said_in(episodes, 0)[0]) == 10


def test_more_clusters_than_windows_are_too_little(log: TrajectoryLog):
    with pytest.raises(TooLittleDataError, match="32 distinct windows for n_clusters=40"):
        fit(log, n_clusters=40)


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


@pytest.mark.parametrize(
    "changes", [{"space": "network", "memory": None}, {"split": "bisecting", "memory": None}, {"space": "rule"}]
)
def test_what_starts_anew_may_start_anew(changes: dict[str, Any]):
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


def test_what_was_found_stands_and_spans_that_are_not_shorter_are_left_out():
    found = settled(config(horizon_steps=None, spans_steps=[3, 12, 20]), 12)
    assert (found.horizon_steps, found.spans_steps) == (12, [3])
    assert settled(found, 40) is found
    set_by_hand = config(horizon_steps=5, spans_steps=[9])
    assert settled(set_by_hand, 12) is set_by_hand


def test_a_horizon_that_has_not_been_found_is_asked_for_by_nobody():
    assert horizon_of(config(horizon_steps=7)) == 7
    with pytest.raises(ValueError, match=r"mapping\.horizon_steps=null: it has not been found yet"):
        horizon_of(config(horizon_steps=None))


def swinging(folder: Path, episodes: int = 20, told: Any = None) -> TrajectoryLog:
    """A lift that goes up and down again every 40 steps, told to go to where it will be; its floor jumps about."""
    made, random = TrajectoryLog(folder, 10_000, TASK.contexts), np.random.default_rng(0)
    for _ in range(episodes):
        height = np.sin(2 * np.pi * (np.arange(201) / 40 + random.random()))
        states = np.column_stack([height, np.full(201, 3.0), random.normal(size=201)]).astype(np.float32)
        said = -np.sign(np.round(states[:-1, :1])) if told is None else np.full((200, 1), told, np.float32)
        whole = Episode(states, np.zeros(200, int), np.ones(200), said, np.ones(200, bool), True, True, "lower")
        made.add(whole.as_steps(), lambda _: "lower")
    return made


def test_the_horizon_is_found_on_the_axis_on_which_the_words_turn(tmp_path: Path):
    """11 or 12 of 40 steps, of which an instruction stands 13, so that 7 are left at the median moment.

    Where all that changes counted, the noise would say 5.
    """
    log = swinging(tmp_path / "swing")
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == 7
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == find_steps(log, config(horizon_steps=None), TASK, 0)
    assert find_steps(log, config(horizon_steps=9), TASK, 0) == 9


def test_only_the_dimensions_that_count_are_looked_at(tmp_path: Path):
    log = swinging(tmp_path / "swing")
    assert find_steps(log, config(horizon_steps=None, dimensions=["height", "speed"]), TASK, 0) == 7
    assert find_steps(log, config(horizon_steps=None, dimensions=["floor"]), TASK, 0) == 5  # no word turns on it


@pytest.mark.parametrize("told", [0.0, 1.0])
def test_where_one_thing_only_is_said_the_leading_change_counts(tmp_path: Path, told: float):
    log = swinging(tmp_path / "swing", told=told)
    assert find_steps(log, config(horizon_steps=None, dimensions=["height"]), TASK, 0) in (11, 12)


def test_in_silence_too(tmp_path: Path):
    log = TrajectoryLog(tmp_path / "silent", 1_000, TASK.contexts)
    add(log, 1.0, 1.0, given=False)
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == 5


def test_without_an_episode_no_horizon_is_found(tmp_path: Path):
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        find_steps(TrajectoryLog(tmp_path / "empty", 1_000, TASK.contexts), config(horizon_steps=None), TASK, 0)
