"""What a refresh adds to metrics.csv, and how much of what was said came true in two vocabularies."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from by_hand import TASK, WORDS, config, defy, obey, on_a_line, plain, race, stay

from ibe_rl.config import MappingConfig
from ibe_rl.data import Episode, Explanation
from ibe_rl.development import FIGURES, Development, figures, truth
from ibe_rl.explainer import put_in_words
from ibe_rl.ibe import ClusterMapping, Transition
from ibe_rl.log import TrajectoryLog
from ibe_rl.metrics import SCORES, VocabularyDrift
from ibe_rl.refresh import Change, Refresh, learn_vocabulary

MOVED = {f"ibe/{name}" for name in ("survived", "vanished", "emerged")} | {
    *("ibe/vocabulary_drift", "ibe/expression_moved", "ibe/cluster_agreement")
}
SCORED = {f"ibe/{name}" for name in SCORES}
STALE = {f"ibe/{name}_stale" for name in SCORES}
HELD_AGAINST = {"ibe/policy_drift", "ibe/staleness"}
ALWAYS = {"ibe/episodes", "ibe/windows"}


def test_figures_tell_of_a_first_refresh_what_it_stands_on_and_its_scores(log: TrajectoryLog):
    obey(log)
    row = figures(Development(config(), TASK, seed=0).refresh(log, stay))
    assert set(row) == ALWAYS | SCORED
    assert (row["ibe/episodes"], row["ibe/windows"], row["ibe/motion_auc"]) == (3, 24, 1)


def test_figures_tell_of_a_new_vocabulary_what_moved(log: TrajectoryLog, only_the_newest_count: MappingConfig):
    obey(log)
    development = Development(only_the_newest_count, TASK, seed=0)
    development.refresh(log, stay)
    defy(log)
    row = figures(development.refresh(log, lambda seen: stay(seen) + 1))
    assert set(row) == ALWAYS | SCORED | STALE | HELD_AGAINST | MOVED
    assert set(row) | {"ibe/came_true", "ibe/came_true_stale"} == set(FIGURES)
    assert len(FIGURES) == len(set(FIGURES))
    assert (row["ibe/survived"], row["ibe/vanished"], row["ibe/emerged"]) == (3, 0, 0)
    assert row["ibe/vocabulary_drift"] == pytest.approx(2 / 3)
    assert row["ibe/expression_moved"] == pytest.approx(4 / 3)
    assert (row["ibe/cluster_agreement"], row["ibe/policy_drift"], row["ibe/staleness"]) == (1, 1, -1)
    assert (row["ibe/motion_auc_stale"], row["ibe/motion_auc"]) == (1, 0)


def test_figures_tell_of_a_vocabulary_that_stays_its_own_scores(
    log: TrajectoryLog, only_the_newest_count: MappingConfig
):
    obey(log)
    development = Development(only_the_newest_count, TASK, seed=0, when_stale=0.0)
    development.refresh(log, stay)
    race(log)
    obey(log)
    defy(log)
    row = figures(development.refresh(log, stay))
    assert set(row) == ALWAYS | SCORED | STALE | HELD_AGAINST  # nothing has moved
    assert row["ibe/staleness"] == -1
    assert row["ibe/motion_auc"] == row["ibe/motion_auc_stale"] == 1


def says(*expressions: float) -> ClusterMapping:
    """What a lift is called that goes down, stays, goes up."""
    where = np.column_stack([[-5, 0, 5], np.zeros((3, 2))])
    return replace(on_a_line([0, 0, 0], expressions), space=plain(3), centres=where)


def refreshed(log: TrajectoryLog, mapping: ClusterMapping, last: ClusterMapping | None, taken: bool = True) -> Refresh:
    obey(log)
    refresh = replace(learn_vocabulary(log, config(), TASK, seed=0), mapping=mapping, taken=taken)
    if last is None:
        return refresh
    nothing = VocabularyDrift(0.0, 0.0, 1.0)
    return replace(refresh, change=Change(last, 0, Transition({}, (), ()), nothing, 0.0, {}, 0.0))


def predicted(way: Iterable[float], mapping: ClusterMapping) -> list[Explanation]:
    """What is said before each step if the lift is thought to go so many metres a step for the next five."""
    ahead = np.multiply.outer(np.array([*way]), np.arange(6))
    return put_in_words(np.stack([ahead, 0 * ahead, 0 * ahead], axis=2), mapping, 5, [WORDS])


def upwards(steps: int) -> Episode:
    states = np.column_stack([np.arange(steps + 1), np.zeros((steps + 1, 2))]).astype(float)
    return Episode(
        states, np.zeros(steps), np.zeros(steps), np.ones((steps, 1)), np.ones(steps, bool), True, True, "lower"
    )


def tell(refresh: Refresh, way: Sequence[float], every_steps: int = 1) -> dict[str, float]:
    """``truth`` of eight steps upwards, of which the last three see less than half the way up before the end."""
    return truth(refresh, upwards(len(way)), predicted(way, refresh.standing), every_steps, [WORDS])


UP, STILL = 1.0, 0.0
RIGHT = [UP] * 6 + [STILL] * 2


def test_truth_of_a_first_vocabulary_is_its_own(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 0, 1), None)
    assert tell(refresh, RIGHT) == {"ibe/came_true": 1}
    assert tell(refresh, [UP] * 8) == {"ibe/came_true": 0.75}


def test_truth_is_told_in_both_vocabularies(log: TrajectoryLog):
    """To the one before, up and still were the same: whatever is predicted of the two comes true."""
    refresh = refreshed(log, says(-1, 0, 1), says(-1, 1, 1))
    assert tell(refresh, [UP] * 4 + [STILL] * 4) == {"ibe/came_true": 0.75, "ibe/came_true_stale": 1}
    refresh = refreshed(log, says(-1, 1, 1), says(-1, 0, 1))
    assert tell(refresh, [UP] * 4 + [STILL] * 4) == {"ibe/came_true": 1, "ibe/came_true_stale": 0.75}


def test_truth_is_of_the_vocabulary_that_stands(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 1, 1), says(-1, 0, 1), taken=False)
    assert tell(refresh, [UP] * 4 + [STILL] * 4) == {"ibe/came_true": 0.75, "ibe/came_true_stale": 0.75}


def test_truth_counts_what_was_newly_said(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 0, 1), says(-1, 1, 1))
    assert tell(refresh, [UP, STILL] * 4, every_steps=2) == {"ibe/came_true": 0.75, "ibe/came_true_stale": 1}
    assert tell(refresh, [STILL, UP] * 4, every_steps=2) == {"ibe/came_true": 0.25, "ibe/came_true_stale": 1}
