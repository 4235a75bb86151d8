"""The test-bed with known truth: its judge by hand, and whether its truths are real."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, on_a_line

from benchmarks.meaning import Situation, Trial, Truth, Verdict, judge, situations, trial
from benchmarks.meaning.__main__ import main
from benchmarks.meaning.judge import fresh_changes
from benchmarks.meaning.point_mass import MIXTURE, UNMIXED, PointMass, unmixed
from benchmarks.meaning.rules import Planned, Rarely, always, only_below, the_sign_of, towards
from benchmarks.meaning.table import as_markdown
from ibe_rl.envs.wrappers import task_of
from ibe_rl.ibe.meaning import Meaning
from ibe_rl.types import Array, Episode, observe

pytestmark = pytest.mark.slow

ALL = situations()
UP = Truth(np.array([1.0]), 0.5, True, "by hand")
BOTH_WAYS = [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0]]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "LOG_EPISODES", 3)
    monkeypatch.setattr(trial, "TEST_EPISODES", 8)


def by_hand(paths: Sequence[Sequence[float]], horizon_steps: int = 1) -> Trial:
    """Fresh episodes of one number; nothing else of it is read."""
    fresh = [
        Episode(
            states=np.array(path, float)[:, None],
            actions=np.zeros(len(path) - 1),
            rewards=np.zeros(len(path) - 1),
            instructions=np.zeros((len(path) - 1, 1)),
            given=np.ones(len(path) - 1, bool),
            terminated=False,
            success=False,
            context="any",
        )
        for path in paths
    ]
    nothing: Any = None
    return Trial("hand", 0, TASK, *([nothing] * 4), [], fresh, horizon_steps, True, True)


# ---- the judge


def test_windows_begin_at_every_fourth_step_and_end_with_the_episode() -> None:
    changes = fresh_changes(by_hand([[0, 1, 3, 6, 10, 15, 21]], horizon_steps=3))
    np.testing.assert_array_equal(changes, [[6], [11]])  # 6 - 0, and 21 - 10 at the end


@pytest.mark.parametrize(
    ("expressions", "outcome", "auc"),
    [([-1, 1], "true", 1.0), ([1, -1], "reversed", 0.0), ([0.5, 0.5], "weak", 0.5)],
)
def test_a_vocabulary_is_held_against_the_direction(expressions: list[float], outcome: str, auc: float) -> None:
    verdict = judge(on_a_line([-1, 1], expressions), by_hand(BOTH_WAYS), UP)
    assert (verdict.outcome, verdict.auc, verdict.known) == (outcome, auc, 1.0)


def test_the_direction_counts_not_the_state_dimension() -> None:
    down = replace(UP, direction=np.array([-1.0]))
    assert judge(on_a_line([-1, 1]), by_hand(BOTH_WAYS), down).outcome == "reversed"


@pytest.mark.parametrize(
    ("meaning", "outcome", "known"),
    [
        (Meaning(False, False, "no idea"), "silent", 0.0),
        (Meaning(False, True), "reversed", 0.5),  # half is not more than half
    ],
)
def test_who_does_not_know_the_words_is_silent(meaning: Meaning, outcome: str, known: float) -> None:
    mapping = replace(on_a_line([-1, 1], [1, -1]), meanings=(meaning,))
    verdict = judge(mapping, by_hand(BOTH_WAYS), UP)
    assert (verdict.outcome, verdict.known, verdict.reason) == (outcome, known, meaning.reason)


def test_episodes_that_go_one_way_only_judge_nothing() -> None:
    with pytest.raises(ValueError, match=r"hand: its new episodes do not go both ways by 0\.5"):
        judge(on_a_line([-1, 1]), by_hand(BOTH_WAYS[:1]), UP)


def test_the_table_counts() -> None:
    silent = Verdict("silent", float("nan"), 0.0, "too | little")
    found = [Verdict("true", 1.0, 1.0), Verdict("reversed", 0.1, 1.0)]
    lines = as_markdown({"a": UP, "b": replace(UP, tellable=False)}, {"a": found, "b": [silent, silent]}).splitlines()
    assert lines[2:4] == ["| a | yes | true 1.00 | reversed 0.10 |  |", "| b | no | silent | silent | too / little |"]
    assert lines[5:] == [
        "- silently reversed: 1 of 4",
        "- tellable and true: 1 of 2",
        "- tellable and silent: 0 of 2",
        "- not tellable and silent: 2 of 2",
    ]


# ---- what is said, and in which world


def test_rules() -> None:
    states = np.array([[-1.0], [0.0], [1.0]])
    first = lambda states: states[..., 0]  # noqa: E731 - a feature in a line
    assert towards(first, 1.0, 0.5)(states).tolist() == [[1], [1], [0]]
    assert the_sign_of(first)(states).tolist() == [[-1], [0], [1]]
    assert only_below(first, 0.5)(states).tolist() == [[1], [1], [0]]
    assert always(1)(states).tolist() == [[1], [1], [1]]


def test_somebody_speaks_rarely_and_in_spells() -> None:
    rare, rows = Rarely(always(1), 0.05, 6, seed=0), np.ones(50, bool)
    rare.reset(rows)
    given = np.array([rare.instruct(np.zeros((50, 1)), rows)[1][:, 0] for _ in range(400)])
    assert given.mean() == pytest.approx(0.05, abs=0.01)
    begins = (np.diff(given, axis=0) == 1).sum()
    assert given.sum() / begins == pytest.approx(6, abs=0.3)


def test_a_plan_goes_by_the_clock_and_waits_for_who_is_not_asked() -> None:
    plan, rows = Planned(3, 3, seed=0), np.array([True, False])
    plan.reset(rows | True)
    said = np.array([plan.instruct(np.zeros((2, 1)), rows)[0][:, 0] for _ in range(300)])
    assert np.all(said[:, 0].reshape(-1, 3) == said[::3, :1])
    assert {*said[:, 0].tolist()} == {-1, 0, 1}
    assert not said[:, 1].any()


def test_the_mass_is_seen_in_a_mixture_and_moves_as_pushed() -> None:
    np.testing.assert_allclose(UNMIXED @ MIXTURE, np.eye(4), atol=1e-12)
    game = PointMass()
    paths = []
    for along_x in (-1, 1):
        seen = [game.reset(seed=3)[0], *(game.step(np.array([along_x, 0.0]))[0] for _ in range(10))]
        paths.append(unmixed(np.array(seen)))
    apart = paths[1][-1] - paths[0][-1]
    assert apart[0] > 0.8
    assert apart[1] > 1.5
    np.testing.assert_allclose(apart[2:], 0, atol=1e-5)


# ---- are the truths real?


def test_names_and_reasons() -> None:
    assert len(ALL) >= 18
    for name, one in ALL.items():
        assert one.name == name
        assert one.truth.reason
        assert len(one.truth.direction) == len(one.world.state_names) + one.lamp


@pytest.mark.parametrize("name", ALL)
def test_truth_is_what_the_agent_does_when_instructed(name: str) -> None:
    """Under +1 it ends higher along the direction than under -1 from the same seed, or does not listen."""
    one = ALL[name]
    higher = moved(one, 1.0) - moved(one, -1.0)
    if "_corrective_opposite_" in name:
        assert np.all(higher < 0)
    elif "obeys" in name:
        assert np.mean(higher > 0) >= 0.75
        assert np.all(higher >= 0)
    elif "beginner" in name or "half" in name:
        assert higher.mean() > 0
    else:
        np.testing.assert_array_equal(higher, 0)


def moved(one: Situation, word: float) -> Array:
    """How far ``(8,)`` it goes along the direction in the horizon, told the same throughout."""
    return np.array([_moved(one, word, seed) for seed in range(8)])


def _moved(one: Situation, word: float, seed: int) -> float:
    game = one.make_env()
    first = state = game.reset(seed=seed)[0]
    for _ in range(one.steps_ahead):
        seen = observe(state[None], np.array([[word]]), np.ones((1, 1)))
        state, _, terminated, truncated, _ = game.step(one.policy(seen)[0])
        if terminated or truncated:
            break
    return float((state - first) @ one.truth.direction)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("name", ALL)
def test_episodes_fit_together_and_goes_both_ways(name: str) -> None:
    one = ALL[name]
    made = one.make(0)
    change = fresh_changes(made) @ one.truth.direction
    assert np.mean(change > one.truth.band) > 0.02
    assert np.mean(change < -one.truth.band) > 0.02
    assert task_of(made.make_env()).name == name
    episode = made.log_episodes[0]
    assert made.make_env().action_space.contains(episode.actions[0])
    assert episode.states.shape == (len(episode) + 1, len(made.task.state_names))
    assert len(made.log_episodes) == 3
    assert len(episode) <= 200


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("name", ["mass_plan_obeys_a_step", "mass_rare_obeys_rest", "lander_corrective_obeys_lands"])
def test_a_seed_gives_the_same_log_also_from_the_cache(name: str, tmp_path: Path) -> None:
    flights = [ALL[name].make(1), ALL[name].make(1, tmp_path), ALL[name].make(1, tmp_path)]
    assert len(list(tmp_path.iterdir())) == 1
    for other in flights[1:]:
        for lot in ("log_episodes", "fresh"):
            for a, b in zip(getattr(flights[0], lot), getattr(other, lot), strict=True):
                for column in (*trial.PER_STEP, *trial.PER_EPISODE):
                    np.testing.assert_array_equal(getattr(a, column), getattr(b, column))
    assert not np.array_equal(flights[0].log_episodes[0].states, ALL[name].make(2).log_episodes[0].states)


def test_the_command() -> None:
    table = main(["--seeds", "1", "--only", "cart_plan_obeys_a_step"])
    assert "| cart_plan_obeys_a_step | yes | " in table
    assert "- silently reversed: 0 of 1" in table
