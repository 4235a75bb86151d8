"""What the agent speaks with, and how what it said of a watched episode is held against what happened."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from by_hand import TASK, WORDS, config, obey, on_a_line, plain, stay

from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, ExplainerState, put_in_words
from ibe_rl.ibe import ClusterMapping, ClusterTransition, Meaning
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.drift import VocabularyDrift
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Episode, Explanation
from ibe_rl.vocabulary import tracker as module
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.refresh import Change, Refresh, load_refresh
from ibe_rl.vocabulary.tracker import VocabularyTracker


def says(*expressions: float) -> ClusterMapping:
    """What a lift is called that goes down, stays, goes up."""
    where = np.column_stack([[-5, 0, 5], np.zeros((3, 2))])
    return replace(on_a_line([0, 0, 0], expressions), space=plain(3), centres=where)


def refreshed(
    log: TrajectoryLog, mapping: ClusterMapping, last: ClusterMapping | None = None, taken: bool = True
) -> Refresh:
    obey(log)
    refresh = replace(learn_vocabulary(log, config(), TASK, seed=0), mapping=mapping, taken=taken)
    if last is None:
        return refresh
    nothing = VocabularyDrift(0.0, 0.0, 1.0)
    return replace(refresh, change=Change(last, 0, ClusterTransition({}, (), ()), nothing, 0.0, {}, 0.0))


def predicted(ways: Iterable[float | Sequence[float]], mapping: ClusterMapping) -> list[Explanation]:
    """What is said before each step if the lift is thought to go so many metres a step for the next five.

    Several numbers are what it would do in each of as many futures, a single one in all of them.
    """
    ways = [*ways]
    most = max(np.size(way) for way in ways)
    futures = np.array([np.resize(way, most) for way in ways])
    ahead = np.multiply.outer(futures, np.arange(6))
    return put_in_words(np.stack([ahead, 0 * ahead, 0 * ahead], axis=3), ExplainerState(mapping, 5, [WORDS]))


def upwards(steps: int) -> Episode:
    states = np.column_stack([np.arange(steps + 1), np.zeros((steps + 1, 2))]).astype(float)
    return Episode(
        states, np.zeros(steps), np.zeros(steps), np.ones((steps, 1)), np.ones(steps, bool), True, True, "lower"
    )


def development() -> VocabularyTracker:
    return VocabularyTracker(config(), TASK, seed=0)


def judge(refresh: Refresh, ways: Sequence[float | Sequence[float]], every_steps: int = 1) -> dict[str, float]:
    """Of steps upwards, of which the last two see less than half the way up before the end."""
    said = predicted(ways, refresh.standing)
    return development().judge(refresh, upwards(len(ways)), said, every_steps)


UP, STILL, DOWN = 1.0, 0.0, -1.0
RIGHT = [UP] * 6 + [STILL] * 2
NEVER_UP = [STILL] * 8


def columns(came_true: float, stale: float | None = None) -> dict[str, float]:
    of_the_last = {} if stale is None else {"ibe/came_true_stale": stale}
    return {"ibe/came_true": came_true, "ibe/unknown": 0.0} | of_the_last


def test_a_first_vocabulary_is_judged_alone(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 0, 1))
    assert judge(refresh, RIGHT) == columns(1)
    assert judge(refresh, [UP] * 8) == columns(0.75)


def test_what_was_said_is_judged_in_both_vocabularies(log: TrajectoryLog):
    """To the one before, up and still were the same: whatever is predicted of the two comes true."""
    refresh = refreshed(log, says(-1, 0, 1), says(-1, 1, 1))
    assert judge(refresh, NEVER_UP) == columns(0.25, stale=1)
    refresh = refreshed(log, says(-1, 1, 1), says(-1, 0, 1))
    assert judge(refresh, NEVER_UP) == columns(1, stale=0.25)


def test_the_vocabulary_before_would_have_voted_too(log: TrajectoryLog):
    """Of down, still, up, up: up to the new one. The old one called the first two alike, and those came first."""
    refresh = refreshed(log, says(-1, 0, 1), says(-1, -1, 1))
    assert judge(refresh, [[DOWN, STILL, UP, UP]] * 6) == columns(4 / 6, stale=2 / 6)


def test_the_vocabulary_that_stands_is_judged(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 1, 1), says(-1, 0, 1), taken=False)
    assert judge(refresh, NEVER_UP) == columns(0.25, stale=0.25)


def test_what_was_newly_said_counts(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 0, 1), says(-1, 1, 1))
    assert judge(refresh, [UP, STILL] * 4, every_steps=2) == columns(0.75, stale=1)
    assert judge(refresh, [STILL, UP] * 4, every_steps=2) == columns(0.25, stale=1)


def test_what_the_agent_did_not_know_is_counted_and_judged_all_the_same(log: TrajectoryLog):
    refresh = refreshed(log, says(-1, 0, 1))
    said = predicted([UP] * 8, refresh.standing)
    unsure = [replace(one, known=step not in (1, 6, 7)) for step, one in enumerate(said)]
    found = development().judge(refresh, upwards(8), unsure, 1)
    assert found == {"ibe/came_true": 0.75, "ibe/unknown": 3 / 8}
    found = development().judge(refresh, upwards(8), unsure, 2)  # new at 0, 2, 4 and 6
    assert found == {"ibe/came_true": 0.75, "ibe/unknown": 1 / 4}


def one_way(mapping: ClusterMapping, **known: bool) -> ClusterMapping:
    return replace(mapping, meanings=(Meaning(**known),))


def test_what_the_agent_cannot_tell_does_not_count(log: TrajectoryLog):
    """Up is not known: of six ups and two stills only the stills are words."""
    refresh = refreshed(log, one_way(says(-1, 0, 1), positive=False))
    ours = development()
    found = ours.judge(refresh, upwards(8), predicted(RIGHT, refresh.standing), 1)
    assert found == {"ibe/came_true": 1.0, "ibe/unknown": 6 / 8}
    assert same(ours.calibration, fitted([(1.0, 1.0)] * 2, [True] * 2))


def test_of_no_word_nothing_is_learnt(log: TrajectoryLog):
    last = one_way(says(-1, 0, 1), negative=False, positive=False)
    refresh, ours = refreshed(log, one_way(says(-1, 0, 1), negative=False, positive=False), last), development()
    found = ours.judge(refresh, upwards(8), predicted(RIGHT, refresh.standing), 1)
    assert np.isnan([found["ibe/came_true"], found["ibe/came_true_stale"]]).all()
    assert found["ibe/unknown"] == 1
    assert ours.calibration is None
    assert ours.state_dict()["judged"] == []


def fitted(features: Sequence[tuple[float, float]], true: Sequence[bool]) -> Calibration:
    return Calibration.fit(np.array(features), np.array(true), CONFIDENCE_FEATURES)


def same(one: Calibration | None, other: Calibration) -> bool:
    return one is not None and one.to_dict() == other.to_dict()


def test_the_calibration_grows_from_episode_to_episode(log: TrajectoryLog):
    """Of one mind where it comes true, of two where it does not; what was judged before is not forgotten."""
    refresh, ours = refreshed(log, says(-1, 0, 1)), development()
    assert ours.calibration is None
    ours.judge(refresh, upwards(4), predicted([UP, UP, STILL, STILL], refresh.standing), every_steps=1)
    seen, true = [(1.0, 1.0)] * 4, [True] * 4  # 4, 3, 2 and 1 m to the end
    assert same(ours.calibration, fitted(seen, true))
    assert chance(ours, 1) == chance(ours, 2 / 3) == pytest.approx(5 / 6)
    ours.judge(refresh, upwards(4), predicted([[DOWN, DOWN, UP]] * 4, refresh.standing), every_steps=2)
    seen, true = [*seen, (2 / 3, 1), (2 / 3, 1)], [*true, False, False]  # only what was newly said
    assert same(ours.calibration, fitted(seen, true))
    assert chance(ours, 1) > 0.8 > 0.4 > chance(ours, 2 / 3)
    ours.judge(refresh, upwards(4), predicted([[DOWN, UP, UP], DOWN, UP, UP], refresh.standing), every_steps=1)
    seen, true = [*seen, (2 / 3, 1), (1, 1), (1, 1), (1, 1)], [*true, True, False, False, False]
    assert same(ours.calibration, fitted(seen, true))


def test_only_the_newest_episodes_count_for_the_calibration(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    """Else it, and each state of the run, would grow for as long as a run is."""
    monkeypatch.setattr(module, "JUDGED_EPISODES", 2)
    refresh, ours = refreshed(log, says(-1, 0, 1)), development()
    for ways in ([[DOWN, DOWN, UP]] * 4, [UP, UP, STILL, STILL], [UP, UP, UP, UP]):
        ours.judge(refresh, upwards(4), predicted(ways, refresh.standing), every_steps=1)
    seen, true = [(1.0, 1.0)] * 8, [True] * 4 + [True, True, False, False]
    assert same(ours.calibration, fitted(seen, true))
    assert len(ours.state_dict()["judged"]) == 2


def chance(ours: VocabularyTracker, agreement: float) -> float:
    assert ours.calibration is not None
    return float(ours.calibration.probability(np.array([[agreement, 1.0]]))[0])


def test_the_agent_speaks_with_what_stands(log: TrajectoryLog):
    """With the newest vocabularies of all spans; with the calibration of the episodes so far."""
    ours = VocabularyTracker(config(spans_steps=[2]), TASK, seed=0)
    obey(log)
    refresh = ours.refresh(log, stay)
    assert ours.explainer_state() == ExplainerState(refresh.mapping, 5, TASK.phrases, refresh.spans)
    assert list(ours.explainer_state().spans) == [2]
    ours.judge(refresh, upwards(8), predicted([UP] * 8, refresh.standing), every_steps=1)
    obey(log)
    second = ours.refresh(log, stay)
    explainer = ours.explainer_state(futures=7, min_confidence=0.25)
    assert (explainer.mapping, explainer.spans) == (second.mapping, second.spans)
    assert (explainer.futures, explainer.min_confidence) == (7, 0.25)
    assert explainer.calibration is ours.calibration is not None


def test_a_vocabulary_that_stays_is_spoken_on(log: TrajectoryLog):
    ours = VocabularyTracker(config(spans_steps=[2]), TASK, seed=0, when_stale=1.0)
    obey(log)
    first = ours.refresh(log, stay)
    obey(log)
    assert not ours.refresh(log, stay).taken
    assert (ours.explainer_state().mapping, ours.explainer_state().spans) == (first.mapping, first.spans)


def test_a_refresh_keeps_the_calibration_of_the_episodes_before_it(log: TrajectoryLog, tmp_path: Path):
    ours, kept, path = development(), [], tmp_path / "refreshes"
    path.mkdir()
    for _ in range(3):
        obey(log)
        refresh = ours.refresh(log, stay)
        ours.save(path, refresh)
        kept.append(ours.calibration)
        ours.judge(refresh, upwards(6), predicted([UP, STILL, [UP, UP, DOWN]] * 2, refresh.standing), every_steps=1)
    saved = [load_refresh(each).calibration for each in sorted(path.glob("*.json"))]
    assert kept[0] is None
    assert saved[0] is None
    for one, other in zip(saved[1:], kept[1:], strict=True):
        assert other is not None
        assert same(one, other)
    assert not same(saved[1], saved[2] or fitted([(1, 1)], [True]))
