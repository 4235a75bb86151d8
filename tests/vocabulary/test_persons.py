"""What a person said counts first: alone once it suffices, before that with a weight."""

import json
from pathlib import Path

import numpy as np
import pytest
from by_hand import STEPS, TASK, add, better_half, config

from ibe_rl.instructors.taught import told_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary import persons as module
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.refresh import save_refresh
from ibe_rl.vocabulary.training_episodes import read_training_episodes

PERSON, OTHERS = np.tile(np.array(told_of("person"), np.int32), (STEPS, 1)), np.zeros((STEPS, 3), np.int32)


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    """Three of the person, who means by up what the others mean by down, and nine of others, who earn more."""
    made = TrajectoryLog(tmp_path / "log", 10_000, TASK.contexts)
    for number, instruction in enumerate((1.0, -1.0, 0.0)):
        add(made, number, instruction, went=-instruction, told=PERSON)
        for more in range(3):
            add(made, 10.0 + number + more, instruction, told=OTHERS)
    return made


def test_beside_others_the_person_weighs_as_much_as_they_do_together(log: TrajectoryLog):
    lessons = read_training_episodes(log, config(), seed=0)
    share = lessons.persons
    assert share is not None
    assert (share.episodes, share.windows, share.weight, share.only) == (3, 3 * STEPS, 4, False)
    assert sum(episode.total_reward < 5 for episode in lessons.best) == 3 + 4 * 3  # they are among all as well
    assert len(lessons.best) == 12 + 4 * 3


def test_a_person_who_has_said_enough_is_the_only_one(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "ENOUGH_EPISODES", 3)
    monkeypatch.setattr(module, "ENOUGH_WINDOWS", STEPS)
    lessons = read_training_episodes(log, better_half(newest_frames=1), seed=0)  # however long ago that was
    assert lessons.persons is not None
    assert lessons.persons.only
    assert [round(one.total_reward) for one in lessons.best] == [1, 2]
    assert [round(one.total_reward) for one in lessons.heard] == [0, 1, 2]
    assert (lessons.logged, lessons.counted) == (12, 3)


def test_the_words_mean_what_the_person_means(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    up = np.array([[4.0, 0.0, 0.0]])
    monkeypatch.setattr(module, "ENOUGH_EPISODES", 3)
    for enough, only in ((STEPS, True), (10**6, False)):
        monkeypatch.setattr(module, "ENOUGH_WINDOWS", enough)
        refresh = learn_vocabulary(log, config(kind="paper"), TASK, seed=0)
        assert refresh.mapping.express(up)[0, 0] < -0.5
        saved = json.loads(save_refresh(tmp_path, refresh, config(), TASK).read_text())
        assert saved["person"]["only"] is only
        assert saved["person"]["windows"] == 3 * STEPS


def test_without_a_word_of_the_person_it_is_as_ever(tmp_path: Path):
    other = TrajectoryLog(tmp_path / "other", 10_000, TASK.contexts)
    silent = np.tile(np.array(told_of("nobody"), np.int32), (STEPS, 1))
    plain = TrajectoryLog(tmp_path / "plain", 10_000, TASK.contexts)
    for made, told in ((other, silent), (plain, None)):
        add(made, 1.0, 0.0, given=False, told=told)
        for instruction in (1.0, -1.0, 0.0):
            add(made, 5.0, instruction, told=OTHERS if made is other else None)
    taught, untaught = (read_training_episodes(one, better_half(), seed=0) for one in (other, plain))
    assert taught.persons is untaught.persons is None
    assert [len(one) for one in (taught.best, taught.heard)] == [len(one) for one in (untaught.best, untaught.heard)]
    assert "person" not in json.loads(
        save_refresh(tmp_path, learn_vocabulary(plain, config(kind="paper"), TASK, 0), config(), TASK).read_text()
    )


@pytest.mark.parametrize(("random", "least", "most"), [(True, 0.0, 0.2), (False, 0.9, 1.0)])
def test_keys_at_random_do_not_get_the_vocabulary_of_the_oracle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, random: bool, least: float, most: float
):
    """Beside each episode of the person, in which each key goes with each movement, one that the oracle tells."""
    monkeypatch.setattr(module, "ENOUGH_WINDOWS", 20 * STEPS)
    made = TrajectoryLog(tmp_path / "log", 10_000, TASK.contexts)
    for said in (1.0, -1.0) * 6:
        for went in (1.0, -1.0):
            add(made, 1.0, said if random else went, went=went, told=PERSON)
            add(made, 1.0, went, told=OTHERS)
    learnt = learn_vocabulary(made, config(kind="paper", n_clusters=2), TASK, seed=0)
    clear = np.abs(learnt.mapping.mean_instructions)
    assert least <= clear.min() <= clear.max() <= most
