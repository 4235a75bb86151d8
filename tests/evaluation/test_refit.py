"""Vocabularies relearnt from a log made by hand."""

import re
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, config, obey
from lift import heights, words

from ibe_rl.evaluation import refit as module
from ibe_rl.evaluation.refit import Refits, fit_shuffled
from ibe_rl.ibe import TooLittleDataError
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError

Run = Callable[..., Any]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A lift that followed the instruction, so many times."""

    def make(times: int, **changes: Any) -> Any:
        log = TrajectoryLog(tmp_path / "trajectories", 2_000, TASK.contexts)
        for _ in range(times):
            obey(log)
        log.flush()
        return SimpleNamespace(
            folder=tmp_path,
            reactions=None,
            task=TASK,
            policy=None,
            config=SimpleNamespace(mapping=config(**changes)),
        )

    return make


def test_a_vocabulary_of_another_horizon(run: Run):
    made = run(8)
    for steps in (3, 5):
        said = Refits(made, 0).fit(config(), steps).express(heights(np.array([-1.0 * steps, 0, steps])))
        np.testing.assert_allclose(said[:, 0], [-1, 0, 1], atol=0.05)


def test_vocabularies_learnt_side_by_side_are_those_learnt_one_after_the_other(run: Run):
    made = run(20)
    calls = [(config(), 5), (config(), 3)]
    one, two = (Refits(made, 0).each("fit", calls, processes) for processes in (1, 2))
    assert [mapping.to_dict() for mapping in two] == [mapping.to_dict() for mapping in one]
    made.reactions = Lock()  # no other process can have it
    assert len(Refits(made, 0).each("fit", calls, 2)) == 2


def test_shuffled_lessons_teach_something_else_each_time(run: Run):
    several = Refits(run(20), 0).shuffled(config(), 5, 6)
    means = [np.abs(mapping.mean_instructions).max() for mapping in several]
    assert len(means) == 6
    assert len(set(means)) > 1
    assert max(means) < 0.8  # what was told goes with nothing any more


def test_a_shuffle_that_teaches_nothing_is_drawn_again_but_not_for_ever(run: Run, monkeypatch: pytest.MonkeyPatch):
    refits, drawn, real = Refits(run(20), 0), [], module.fit_mapping

    def every_third(*given: Any, **more: Any) -> Any:
        drawn.append(given)
        if len(drawn) % 3:
            raise TooLittleDataError("nothing has moved")
        return real(*given, **more)

    monkeypatch.setattr(module, "fit_mapping", every_third)
    assert len(refits.shuffled(config(), 5, 2)) == 2
    assert len(drawn) == 6
    monkeypatch.setattr(module, "MOST_REDRAWN", 2)
    drawn.clear()
    assert len(refits.shuffled(config(), 5, 2)) == 1  # fewer than asked for
    assert len(drawn) == 4
    monkeypatch.setattr(module, "MOST_REDRAWN", 1)
    drawn.clear()
    assert refits.shuffled(config(), 5, 2) == []  # a control that is missing loses nothing else
    assert len(drawn) == 2


def test_vocabularies_of_shuffled_episodes_need_no_log_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    log, taught = TrajectoryLog(tmp_path, 2_000, TASK.contexts), []
    for _ in range(20):
        obey(log)
    episodes, real = log.read(range(60)), module.fit_mapping

    def heard(best: Any, *more: Any, **others: Any) -> Any:
        taught.append(best)
        return real(best, *more, **others)

    monkeypatch.setattr(module, "fit_mapping", heard)
    steps: list[int] = []
    several = fit_shuffled(episodes, episodes, config(), TASK, 0, 5, 3, lambda: steps.append(1))
    assert len(several) == len(steps) == 3
    instruction = [[float(episode.instructions[0, 0]) for episode in episodes] for episodes in (episodes, *taught)]
    assert all(sorted(each) == sorted(instruction[0]) for each in instruction)
    assert len({tuple(each) for each in instruction}) == len(instruction)
    for shuffled in taught:
        for one, other in zip(shuffled, episodes, strict=True):
            np.testing.assert_array_equal(one.states, other.states)
    again = fit_shuffled(episodes, episodes, config(), TASK, 0, 5, 3)
    assert [mapping.to_dict() for mapping in again] == [mapping.to_dict() for mapping in several]


def test_episodes_that_teach_nothing_give_fewer_vocabularies_of_shuffled_ones(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 2_000, TASK.contexts)
    obey(log)
    episodes = log.read(range(3))
    assert fit_shuffled(episodes, episodes, config(), TASK, 0, 50, 2) == []


def test_all_that_is_held_against_a_vocabulary(run: Run):
    settings: Any = SimpleNamespace(shuffles=3)
    learnt = Refits(run(20), 0).learn({"ibe:lift": words()}, config(), 5, settings)
    assert list(learnt.vocabularies) == ["ibe:lift", "baseline:paper"]
    assert {name: len(several) for name, several in learnt.ensembles.items()} == {
        "baseline:shuffled": 3,
        "baseline:random_clusters": 3,
        "baseline:random_names": 3,
    }
    assert learnt.regressors[0].r2["ridge"] > 0.9


def test_all_mappings_learn_from_as_many_frames_as_the_run_did(run: Run):
    refits = Refits(run(20, newest_frames=130), 0)
    assert refits.lessons(config(newest_frames=None)).counted == 11  # of 12 steps each


def test_a_run_without_a_log_or_with_a_damaged_one_is_refused(run: Run, tmp_path: Path):
    empty = SimpleNamespace(folder=tmp_path / "nowhere")
    with pytest.raises(ConfigError, match=r"nowhere: it has no log \(trajectories/\) to learn other vocabularies from"):
        Refits(empty, 0)
    made = run(2)
    (tmp_path / "trajectories" / "episodes.npy").write_text("no array")
    with pytest.raises(ConfigError, match=re.escape(f"run={tmp_path}: {tmp_path / 'trajectories'} is not a readable")):
        Refits(made, 0)


def test_a_log_that_is_too_small_is_refused(run: Run):
    with pytest.raises(ConfigError, match=r"its log is too small for a vocabulary \(no episode has ended yet\)"):
        Refits(run(0), 0).lessons(config())
    with pytest.raises(ConfigError, match=r"its log is too small for a vocabulary \(the best .* no window of 50 steps"):
        Refits(run(2), 0).fit(config(), 50)
