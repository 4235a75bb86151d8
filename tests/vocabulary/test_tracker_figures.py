"""What a refresh adds to metrics.csv."""

import pytest
from by_hand import TASK, config, defy, obey, race, stay

from ibe_rl.ibe import IBEConfig
from ibe_rl.metrics.quality import OF_THE_MOMENTS, SCORES
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary.refresh_columns import REFRESH_COLUMNS, figures
from ibe_rl.vocabulary.tracker import VocabularyTracker

OF_THE_EPISODE = {
    *("ibe/came_true", "ibe/came_true_stale", "ibe/unknown", "ibe/listens"),
    *("ibe/phrase_changes_per_100", "ibe/flicker"),
}
"""Of the explained episode, not of the refresh."""
MOVED = {f"ibe/{name}" for name in ("survived", "vanished", "emerged")} | {
    *("ibe/vocabulary_drift", "ibe/expression_moved", "ibe/cluster_agreement")
}
SCORED = {f"ibe/{name}" for name in SCORES}
STALE = {f"ibe/{name}_stale" for name in SCORES if name != OF_THE_MOMENTS}
HELD_AGAINST = {"ibe/policy_drift", "ibe/staleness"}
ALWAYS = {"ibe/episodes", "ibe/windows", "ibe/delay_steps"}


def test_figures_tell_of_a_first_refresh_what_it_stands_on_and_its_scores(log: TrajectoryLog):
    obey(log)
    row = figures(VocabularyTracker(config(), TASK, seed=0).refresh(log, stay))
    assert set(row) == ALWAYS | SCORED
    assert (row["ibe/episodes"], row["ibe/windows"], row["ibe/motion_auc"]) == (3, 24, 1)


def test_figures_tell_of_a_new_vocabulary_what_moved(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    obey(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0)
    development.refresh(log, stay)
    defy(log)
    row = figures(development.refresh(log, lambda seen: stay(seen) + 1))
    assert set(row) == ALWAYS | SCORED | STALE | HELD_AGAINST | MOVED
    assert set(row) | OF_THE_EPISODE == set(REFRESH_COLUMNS)
    assert len(REFRESH_COLUMNS) == len(set(REFRESH_COLUMNS))
    assert (row["ibe/survived"], row["ibe/vanished"], row["ibe/emerged"]) == (3, 0, 0)
    assert row["ibe/vocabulary_drift"] == pytest.approx(2 / 3)
    assert row["ibe/expression_moved"] == pytest.approx(4 / 3)
    assert (row["ibe/cluster_agreement"], row["ibe/policy_drift"], row["ibe/staleness"]) == (1, 1, -1)
    assert (row["ibe/motion_auc_stale"], row["ibe/motion_auc"]) == (1, 0)


def test_figures_tell_of_a_vocabulary_that_stays_its_own_scores(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    obey(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0, when_stale=0.0)
    development.refresh(log, stay)
    race(log)
    obey(log)
    defy(log)
    row = figures(development.refresh(log, stay))
    assert set(row) == ALWAYS | SCORED | STALE | HELD_AGAINST  # nothing has moved
    assert row["ibe/staleness"] == -1
    assert row["ibe/motion_auc"] == row["ibe/motion_auc_stale"] == 1
