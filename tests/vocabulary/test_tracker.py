"""A vocabulary learnt again and again from a log that grows, of a lift that obeys or does not."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, add, config, defy, obey, race, stay

from ibe_rl.ibe import ClusterTransition, IBEConfig, Meaning, TooLittleDataError
from ibe_rl.metrics.drift import VocabularyDrift
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array
from ibe_rl.vocabulary import tracker as module
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.refresh import Refresh, load_refresh, save_refresh
from ibe_rl.vocabulary.refresh_columns import figures
from ibe_rl.vocabulary.tracker import VocabularyTracker


def names(refresh: Refresh) -> list[int]:
    return refresh.mapping.ids.tolist()


def test_the_first_vocabulary_is_taken_and_has_nothing_before_it(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(), TASK, seed=0, when_stale=1.0)
    assert development.mapping is None
    assert development.probe is None
    first = development.refresh(log, stay)
    assert first.taken
    assert first.change is None
    assert development.mapping is first.mapping is first.standing
    assert names(first) == [0, 1, 2]
    assert first.scores["motion_auc"] == first.scores["instruction_f1"] == 1
    assert first.scores["motion_spearman"] > 0.9  # no two changes are just the same, but many are called the same
    assert np.isnan(first.scores["motion_auc_disobeyed"])
    plain = learn_vocabulary(log, config(), TASK, seed=0)
    assert first.mapping.to_dict() == plain.mapping.to_dict()


def test_nothing_moves_while_nothing_new_happens(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(hold_within=0.0), TASK, seed=0)
    first = development.refresh(log, stay)
    for since_frame in (36, 72):
        obey(log)
        refresh = development.refresh(log, stay)
        assert refresh.change is not None
        assert refresh.change.since_frame == since_frame
        assert refresh.change.transition == ClusterTransition({0: 1.0, 1: 1.0, 2: 1.0}, (), ())
        assert refresh.change.drift == VocabularyDrift(0.0, 0.0, 1.0)
        assert refresh.change.policy_drift == refresh.change.staleness == 0
        assert refresh.change.last_scores == pytest.approx(refresh.scores, nan_ok=True)
        assert names(refresh) == names(first)
        np.testing.assert_array_equal(refresh.mapping.expressions, first.mapping.expressions)


def test_each_vocabulary_is_held_against_the_one_before(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(), TASK, seed=0)
    refreshes = [development.refresh(log, stay)]
    for _ in range(3):
        obey(log)
        refreshes.append(development.refresh(log, stay))
    for before, after in pairwise(refreshes):
        assert after.change is not None
        assert after.change.last is before.mapping
        assert after.change.since_frame == before.frame
    memory = config().memory
    assert memory
    np.testing.assert_allclose(refreshes[1].mapping.evidence, 16 + memory * 8)  # in the log, and remembered
    np.testing.assert_allclose(refreshes[2].mapping.evidence, 24 + memory * (16 + memory * 8))


def test_without_memory_a_vocabulary_starts_from_nothing_but_keeps_its_names(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(memory=None, survival_overlap=0.1), TASK, seed=0)
    development.refresh(log, stay)
    defy(log)
    second = development.refresh(log, stay)
    assert second.mapping.to_dict() | {"ids": 0, "expressions": 0} == (
        learn_vocabulary(log, config(), TASK, seed=0).mapping.to_dict() | {"ids": 0, "expressions": 0}
    )
    assert sorted(names(second)) == [0, 1, 2]


def test_names_follow_the_clusters_when_the_words_turn_round(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    obey(log)
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0)
    first = development.refresh(log, stay)
    defy(log)
    second = development.refresh(log, stay)
    assert second.change is not None
    assert names(second) == [2, 1, 0]  # sorted by what was told, which is the other way round now
    up, down = np.array([[5.0, 0, 0]]), np.array([[-5.0, 0, 0]])
    for delta in (up, down):
        assert first.mapping.ids[first.mapping.cluster(delta)] == second.mapping.ids[second.mapping.cluster(delta)]
        assert first.mapping.express(delta) == -second.mapping.express(delta)
    assert second.change.transition.survived == {0: 1.0, 1: 1.0, 2: 1.0}
    assert second.change.drift == VocabularyDrift(pytest.approx(2 / 3), pytest.approx(2 * 2 / 3), 1.0)


def test_a_name_is_never_given_twice(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    """Three lifts of the old kind, three racing ones, and the old kind again: all come under new names."""
    development, given = VocabularyTracker(only_the_newest_count, TASK, seed=0), []
    for fly in (obey, race, obey):
        fly(log)
        refresh = development.refresh(log, stay)
        given.append(sorted(names(refresh)))
    assert given == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    assert refresh.change is not None
    assert refresh.change.transition == ClusterTransition({}, (3, 4, 5), (6, 7, 8))


def test_names_of_a_vocabulary_that_was_not_taken_are_free(log: TrajectoryLog):
    obey(log)
    development = VocabularyTracker(config(newest_frames=3 * STEPS, memory=None), TASK, seed=0, when_stale=1.0)
    development.refresh(log, stay)
    race(log)
    offered = development.refresh(log, stay)
    assert not offered.taken
    assert sorted(names(offered)) == [3, 4, 5]
    development._when_stale = None
    taken = development.refresh(log, stay)
    assert taken.taken
    assert sorted(names(taken)) == [3, 4, 5]


def test_limits_of_survival_and_of_holding_are_the_configs(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    def second(**changes: float) -> Refresh:
        again = TrajectoryLog(log.folder.parent / str(changes), 10_000, TASK.contexts)
        development = VocabularyTracker(replace(only_the_newest_count, **changes), TASK, seed=0)
        obey(again)
        development.refresh(again, stay)
        defy(again)
        return development.refresh(again, stay)

    assert second(hold_within=1.99).mapping.expressions[:, 0].tolist() == [-1, 0, 1]
    held = second(hold_within=2.0)
    assert (names(held), held.mapping.expressions[:, 0].tolist()) == ([2, 1, 0], [1, 0, -1])
    race_development = VocabularyTracker(replace(only_the_newest_count, survival_overlap=0.01), TASK, seed=0)
    obey(log)
    race_development.refresh(log, stay)
    race(log)
    refresh = race_development.refresh(log, stay)
    assert refresh.change is not None
    assert len(refresh.change.transition.survived) >= 1


def test_the_probe_is_kept_with_the_first_refresh_and_a_file_with_each(log: TrajectoryLog, tmp_path: Path):
    development = VocabularyTracker(config(), TASK, seed=0)
    folder = tmp_path / "refreshes"
    folder.mkdir()
    obey(log)
    development.save(folder, development.refresh(log, stay))
    kept = (folder / "probe.npz").read_bytes()
    race(log)
    second = development.refresh(log, stay)
    development.save(folder, second)
    assert sorted(path.name for path in folder.iterdir()) == ["000000000036.json", "000000000072.json", "probe.npz"]
    assert (folder / "probe.npz").read_bytes() == kept
    loaded = load_refresh(folder / "000000000072.json")
    assert loaded.mapping.to_dict() == second.mapping.to_dict()
    assert (loaded.horizon_steps, loaded.frame) == (5, 72)
    saved = json.loads((folder / "000000000072.json").read_text())
    assert saved["change"]["since_frame"] == 36
    assert saved["scores"]["motion_auc"] == second.scores["motion_auc"]


def test_too_little_data_leaves_the_vocabulary_as_it_was(log: TrajectoryLog, only_the_newest_count: IBEConfig):
    development = VocabularyTracker(only_the_newest_count, TASK, seed=0)
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        development.refresh(log, stay)
    assert development.probe is None
    obey(log)
    first = development.refresh(log, stay)
    for _ in range(3):
        add(log, 1.0, 1.0, given=False)
    with pytest.raises(TooLittleDataError, match="with an instruction"):
        development.refresh(log, stay)
    assert development.mapping is first.mapping
    obey(log)
    after = development.refresh(log, stay)
    assert after.change is not None
    assert (after.change.last, after.change.since_frame) == (first.mapping, 36)


def test_the_same_seed_gives_the_same(tmp_path: Path):
    def run(name: str, seed: int) -> tuple[Any, Array]:
        log = TrajectoryLog(tmp_path / name, 10_000, TASK.contexts)
        development, found = VocabularyTracker(config(n_clusters=4), TASK, seed), []
        for fly in (obey, race, defy):
            fly(log)
            refresh = development.refresh(log, stay)
            found.append((refresh.mapping.to_dict(), figures(refresh)))
        assert development.probe is not None
        return found, development.probe.observations

    (once, probe), (again, same), (_, other) = run("a", 3), run("b", 3), run("c", 4)
    for (mapping, row), (mapping_again, row_again) in zip(once, again, strict=True):
        assert mapping == mapping_again
        assert row == pytest.approx(row_again, abs=0, rel=0, nan_ok=True)
    np.testing.assert_array_equal(probe, same)
    assert (probe != other).any()


def test_words_that_go_against_what_is_declared_are_noted_and_remembered(
    log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch
):
    """The lift always goes down when told up; its best episodes teach that up is what it did then."""
    learn = module.learn_vocabulary

    def with_meaning(*given: Any) -> Refresh:
        learnt = learn(*given)
        return replace(learnt, mapping=replace(learnt.mapping, meanings=(Meaning(reason="seen"),)))

    monkeypatch.setattr(module, "learn_vocabulary", with_meaning)
    ours = VocabularyTracker(config(), TASK, seed=0)
    defy(log)
    refresh = ours.refresh(log, stay)
    assert refresh.scores["motion_auc"] == 0
    assert [one.level for one in refresh.verdicts(TASK)] == ["reversed"]
    assert ours.notes == [
        "env.task.explained=[height] says that height rises with +1, but in the log +1 asks it to fall: check the sign"
    ]
    again = VocabularyTracker(config(), TASK, seed=0)
    again.load_state_dict(ours.state_dict())
    assert again.notes == ours.notes


def test_the_scores_of_each_number_are_those_of_the_vocabulary_that_stands(log: TrajectoryLog, tmp_path: Path):
    ours = VocabularyTracker(config(), TASK, seed=0, when_stale=0.0)
    obey(log)
    first = ours.refresh(log, stay)
    assert [one["motion_auc"] for one in first.scores_of_numbers] == [first.scores["motion_auc"]] == [1]
    (tmp_path / "refreshes").mkdir()
    ours.save(tmp_path / "refreshes", first)
    [path] = (tmp_path / "refreshes").glob("*.json")
    [read] = load_refresh(path).scores_of_numbers
    assert read == pytest.approx(first.scores_of_numbers[0], nan_ok=True)
    race(log)
    obey(log)
    defy(log)
    second = ours.refresh(log, stay)
    assert not second.taken
    assert second.change is not None
    assert second.scores_of_numbers[0]["motion_auc"] == second.change.last_scores["motion_auc"]


def test_a_horizon_that_nobody_set_is_found_at_the_first_refresh_and_stays(log: TrajectoryLog, tmp_path: Path):
    """A lift that never turns is explained for a fifth of an episode, but at least 5 steps."""
    obey(log)
    development = VocabularyTracker(config(horizon_steps=None, spans_steps=[2, 5]), TASK, seed=0)
    assert (development.horizon_steps, development.horizons_steps) == (None, [])
    first = development.refresh(log, stay)
    assert first.horizon_found
    assert (development.horizon_steps, development.horizons_steps, list(first.spans)) == (5, [5, 2], [2])
    assert first.top.horizon_steps == development.explainer_state().horizon_steps == 5
    for _ in range(20):
        add(log, 100.0, 1.0, steps=90)
    second = development.refresh(log, stay)
    assert not second.horizon_found
    assert second.top.horizon_steps == development.horizon_steps == 5
    taken_up = VocabularyTracker(config(horizon_steps=None, spans_steps=[2, 5]), TASK, seed=0)
    taken_up.load_state_dict(development.state_dict())
    assert taken_up.horizons_steps == [5, 2]
    assert taken_up.refresh(log, stay).mapping.to_dict() == development.refresh(log, stay).mapping.to_dict()
    path = save_refresh(tmp_path, second, config(horizon_steps=development.horizon_steps), TASK)
    assert load_refresh(path).horizon_steps == 5


def test_a_first_refresh_that_fails_finds_no_horizon_for_good(log: TrajectoryLog):
    development = VocabularyTracker(config(horizon_steps=None, n_clusters=8, n_init=1), TASK, seed=0)
    add(log, 1.0, 1.0, steps=3)
    with pytest.raises(TooLittleDataError), development.all_or_nothing():
        development.refresh(log, stay)
    assert development.horizon_steps is None
    assert VocabularyTracker(config(), TASK, seed=0).horizons_steps == [5]
