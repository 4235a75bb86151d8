"""How far ahead is explained is found again at each refresh; with another horizon everything begins again."""

from __future__ import annotations

import numpy as np
import pytest
from by_hand import TASK, WAYS, add, config, obey, stay

from ibe_rl.ibe import TooLittleDataError
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary import tracker as module
from ibe_rl.vocabulary.tracker import VocabularyTracker

SPANS = [2, 5]


def to_be_found() -> VocabularyTracker:
    return VocabularyTracker(config(horizon_steps=None, spans_steps=SPANS), TASK, seed=0)


def obey_for_long(log: TrajectoryLog, episodes: int = 15) -> None:
    """Lifts that never turn: a fifth of 90 steps is looked ahead."""
    for number in range(episodes):
        add(log, 1.0, WAYS[number % 3], steps=90)


def names(development: VocabularyTracker) -> set[int]:
    assert development.mapping is not None
    return set(development.mapping.ids.tolist())


@pytest.fixture
def begun(log: TrajectoryLog) -> VocabularyTracker:
    """It explains 5 steps, and has an episode judged."""
    obey(log)
    development = to_be_found()
    assert development.settle(log) == 5
    first = development.refresh(log, stay)
    assert first.horizon_found
    development._judged.append((np.ones((2, 2)), np.array([True, False])))
    development.calibration = module.Calibration.fit(np.ones((2, 2)), np.array([True, False]), ("a", "b"))
    return development


def test_another_horizon_begins_everything_again(log: TrajectoryLog, begun: VocabularyTracker):
    before, given = begun.mapping, names(begun)
    obey_for_long(log)
    assert begun.settle(log) == 18
    assert (begun.mapping, begun.probe, begun.calibration, begun.spans) == (None, None, None, {})
    assert (begun.horizons_steps, len(begun._judged)) == ([18, 2, 5], 0)  # 5 is a shorter span now
    second = begun.refresh(log, stay)
    assert second.horizon_found
    assert second.change is None
    assert second.top.horizon_steps == begun.explainer_state().horizon_steps == 18
    assert set(second.spans) == {2, 5}
    assert begun.mapping is second.mapping is not before
    assert begun.probe is not None
    assert not names(begun) & given
    assert names(begun) == {3, 4, 5}


def test_a_name_is_not_given_twice_by_who_goes_on_later(log: TrajectoryLog, begun: VocabularyTracker):
    """Back and forth, over a file each time."""
    given = [names(begun)]
    for steps in (90, 12, 90):
        taken_up = to_be_found()
        taken_up.load_state_dict(begun.state_dict())
        begun = taken_up
        for number in range(60):
            add(log, 1.0, WAYS[number % 3], steps=steps)
        begun._asked_for = module.replace(begun._asked_for, newest_frames=60 * steps)
        assert begun.settle(log) == {90: 18, 12: 5}[steps]
        begun.refresh(log, stay)
        given.append(names(begun))
    assert given == [{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 10, 11}]


@pytest.mark.parametrize(("found", "stays"), [(5, True), (7, True), (8, False), (4, True), (3, False)])
def test_a_horizon_that_hardly_differs_stays(
    log: TrajectoryLog, begun: VocabularyTracker, monkeypatch: pytest.MonkeyPatch, found: int, stays: bool
):
    """By a factor of one and a half."""
    mapping = begun.mapping
    monkeypatch.setattr(module, "find_steps", lambda *_: found)
    assert begun.settle(log) == (5 if stays else found)
    assert (begun.mapping is mapping) == stays
    refresh = begun.refresh(log, stay)
    assert (refresh.change is not None) == stays
    assert refresh.horizon_found == (not stays)


def test_a_horizon_that_is_set_stays_whatever_the_log_says(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(horizon_steps=6), TASK, seed=0)
    assert development.settle(log) == 6
    first = development.refresh(log, stay)
    obey_for_long(log)
    assert development.settle(log) == 6
    assert development.mapping is first.mapping
    assert not first.horizon_found


def test_a_refresh_that_fails_afterwards_takes_it_back(
    log: TrajectoryLog, begun: VocabularyTracker, monkeypatch: pytest.MonkeyPatch
):
    def fails(*_: object) -> None:
        assert (begun.horizon_steps, begun.mapping) == (18, None)
        raise TooLittleDataError("not today")

    def refresh() -> None:
        with begun.all_or_nothing():
            begun.settle(log)
            begun.refresh(log, stay)

    before = dict(vars(begun))
    obey_for_long(log)
    monkeypatch.setattr(module, "learn_vocabulary", fails)
    with pytest.raises(TooLittleDataError, match="not today"):
        refresh()
    assert vars(begun) == before
    assert len(begun._judged) == 1
    assert begun.horizons_steps == [5, 2]


def test_without_an_episode_no_horizon_is_found(log: TrajectoryLog):
    development = to_be_found()
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        development.settle(log)
    assert development.horizon_steps is None
