"""How far a vocabulary has gone stale: its scores, the drift of the policy, and when a new one is taken."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, add, config, defy, obey, stay

from ibe_rl.ibe import IBEConfig
from ibe_rl.metrics.quality import SCORES
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary import tracker as module
from ibe_rl.vocabulary.tracker import VocabularyTracker


def test_staleness_is_what_the_new_vocabulary_tells_better(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    obey(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0)
    first = development.refresh(log, stay)
    defy(log)
    second = development.refresh(log, stay)
    assert second.change is not None
    assert first.scores["motion_auc"] == second.change.last_scores["motion_auc"] == 1
    assert second.scores["motion_auc"] == 0  # it says down for what it was told down before, and went up
    assert second.change.staleness == -1
    obey(log)
    third = development.refresh(log, stay)
    assert third.change is not None
    assert (third.change.last_scores["motion_auc"], third.scores["motion_auc"], third.change.staleness) == (0, 1, 1)


def test_what_is_scored_is_the_same_for_both_and_of_the_newest_episodes(
    log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch
):
    seen = []

    def noting(*given: Any) -> list[dict[str, float]]:
        seen.append(given)
        return [dict.fromkeys(SCORES, 0.5)]

    monkeypatch.setattr(module, "SCORED_EPISODES", 2)
    monkeypatch.setattr(module, "number_scores", noting)
    obey(log)
    add(log, 1.0, 1.0, given=False)  # in silence: not scored
    development = VocabularyTracker(config(), TASK, seed=0)
    first = development.refresh(log, stay)
    obey(log)
    second = development.refresh(log, stay)
    assert second.change is not None
    assert [mapping for mapping, _, _ in seen] == [first.mapping, first.mapping, second.mapping]
    assert all(task is TASK for _, _, task in seen)
    assert len(seen[0][1]) == 3  # the last episode with an instruction, at every fourth step of twelve
    assert seen[1][1] is seen[2][1]
    assert seen[1][1].step.tolist() == [0, 4, 8, 0, 4, 8]
    assert set(seen[1][1].instruction[:, 0]) == {-1, 0}  # the last two of three
    np.testing.assert_allclose(seen[1][1].delta[:, 0], [-5, -5, -4, 0, 0, 0], atol=0.1)  # to the end where that is near


def test_a_vocabulary_that_is_good_enough_stays(log: TrajectoryLog, only_the_newest_count: IBEConfig, tmp_path: Path):
    obey(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0, when_stale=0.0)
    first = development.refresh(log, stay)
    defy(log)
    second = development.refresh(log, stay)
    assert second.change is not None
    assert second.change.staleness == -1
    assert not second.taken
    assert second.standing is development.mapping is first.mapping
    assert first.mapping.ids.tolist() == [0, 1, 2]
    for refresh in (first, second):
        development.save(tmp_path, refresh)
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["000000000036.json"]
    obey(log)
    third = development.refresh(log, stay)
    assert third.change is not None
    assert third.change.since_frame == first.frame  # that one still stands
    assert third.change.last is first.mapping


@pytest.mark.parametrize(("when_stale", "taken"), [(None, True), (0.99, True), (1.0, False), (-1.0, True)])
def test_a_new_vocabulary_is_taken_if_it_tells_more_by_more_than_asked_for(
    log: TrajectoryLog, only_the_newest_count: IBEConfig, when_stale: float | None, taken: bool
):
    defy(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0, when_stale=when_stale)
    first = development.refresh(log, stay)
    obey(log)
    second = development.refresh(log, stay)
    assert second.change is not None
    assert second.change.staleness == 1
    assert second.taken is taken
    assert second.standing is development.mapping is (second if taken else first).mapping


def test_a_vocabulary_that_cannot_be_judged_is_taken(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    obey(log)
    development = VocabularyTracker(replace(only_the_newest_count, n_clusters=2), TASK, seed=0, when_stale=1.0)
    development.refresh(log, stay)
    for instruction in (0.0, 0.0, 1.0):
        add(log, 1.0, instruction)  # never down
    second = development.refresh(log, stay)
    assert second.change is not None
    assert np.isnan(second.change.staleness)
    assert second.taken


def test_silence_in_the_newest_episodes_does_not_end_a_run(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "SCORED_EPISODES", 1)
    obey(log)
    development = VocabularyTracker(config(), TASK, seed=0)
    development.refresh(log, stay)
    add(log, 1.0, 1.0, given=False)
    assert np.isnan(list(development.refresh(log, stay).scores.values())).all()


def test_policy_drift_is_measured_from_the_policy_of_the_last_refresh(log: TrajectoryLog):
    """One action where the lift was told up, or everywhere, or nowhere; a third of the probe was told up."""

    def when_instructed(*values: float) -> Any:
        return lambda observations: np.isin(observations[:, -2], values).astype(int)

    obey(log)
    development, drifts = VocabularyTracker(config(), TASK, seed=0), []
    for policy in (stay, stay, when_instructed(1), when_instructed(1, 0), when_instructed(-1)):
        refresh = development.refresh(log, policy)
        drifts.append(refresh.change.policy_drift if refresh.change else None)
    assert drifts == [None, 0, pytest.approx(1 / 3), pytest.approx(1 / 3), 1]


def test_policy_drift_is_measured_since_the_vocabulary_that_stands(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(), TASK, seed=0, when_stale=1.0)  # never another one
    development.refresh(log, stay)
    for policy, expected in ((lambda seen: stay(seen) + 1, 1), (stay, 0)):
        refresh = development.refresh(log, policy)
        assert refresh.change is not None
        assert refresh.change.policy_drift == expected


def test_actions_of_several_numbers_are_compared_too(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(), TASK, seed=0)
    development.refresh(log, lambda seen: np.zeros((len(seen), 2)))
    refresh = development.refresh(log, lambda seen: np.outer(seen[:, -2] == 1, [0, 1]))
    assert refresh.change is not None
    assert refresh.change.policy_drift == pytest.approx(1 / 3)
