"""Who predicts what: by hand on the lift, and the episodes of the task on real flights of the demo's policy."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import on_a_line
from rides import TASK, ride

from ibe_rl.agents import make_agent
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.apps.paper import prediction_task
from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    DEFAULT,
    NO_WORDS,
    PAPERS,
    PREDICTED_CHANGE,
    SHUFFLED,
    STRAIGHT,
    SWAPPED,
    TRUE_END,
)
from ibe_rl.apps.paper.prediction_task import (
    COMPARED,
    ObservedEpisodes,
    ShownEpisode,
    ask_observers,
    error_tests,
    most_telling,
    pick_episodes,
)
from ibe_rl.collect.rollout import JUDGING_SEED, record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.instructors import make_instructor
from ibe_rl.metrics.effect import paired_p
from ibe_rl.metrics.observer import Observer
from ibe_rl.storage.checkpoint import load, policies
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Array, Moment, Prediction

ROOT = Path(__file__).parents[3]
HORIZON = 10
FUTURES = 3
VOCABULARIES = {PAPERS: on_a_line([-2, 0, 2], [-0.8, 0, 0.4]), DEFAULT: on_a_line([-2, 0, 2])}
WRONG = [on_a_line([-2, 0, 2], [0.5, 0.5, 0.5]), on_a_line([-2, 0, 2], [0, 0, -1])]
OBSERVER = Observer(typical=5.0)


def shown(heights: Sequence[float], contact: int) -> ShownEpisode:
    episode = ride(heights)
    moments = [Moment(state, np.zeros(1), True) for state in episode.states[:-1]]
    return ShownEpisode(7, RecordedRollout(episode, moments, [], []), {AT_END: len(episode), AT_CONTACT: contact})


RISING = shown(np.arange(41), contact=36)
"""A metre a step; who sees it up to the end foretells at 30 m, up to the contact at 26 m."""
FALLING = shown(100 - 2 * np.arange(46), contact=40)
"""Two metres down a step; who sees it up to the end foretells at 100 - 2 * 35 = 30 m, to the contact at 40 m."""


def policy(observations: Array) -> Array:
    return np.zeros(len(observations), int)


class Foreseen:
    """Foresees 3 m down first, then twice 2 m up at heights that 4 divides, else 2 m down."""

    def __init__(self) -> None:
        self.asked: list[tuple[list[float], Any, int]] = []

    def rollout(self, moments: Sequence[Moment], policy: Any, horizon_steps: int) -> Prediction:
        now = np.array([moment.state for moment in moments], float)
        self.asked.append((now[:, 0].tolist(), policy, horizon_steps))
        change = np.where(now % 4 == 0, 2.0, -2.0)
        change[::FUTURES] = -3
        return Prediction.exact(now[:, None] + change[:, None] * np.linspace(0, 1, horizon_steps + 1)[:, None])


def guesses(cut: str, predictor: Any = None, episodes: Sequence[ShownEpisode] = (RISING, FALLING)) -> ObservedEpisodes:
    return ask_observers(
        episodes,
        cut,
        policy,
        predictor or Foreseen(),
        vocabularies=VOCABULARIES,
        shuffled=WRONG,
        observer=OBSERVER,
        task=TASK,
        horizon_steps=HORIZON,
        futures=FUTURES,
    )


def test_observers_see_so_many_frames_and_foretell_at_the_last():
    predictor = Foreseen()
    found = guesses(AT_CONTACT, predictor)
    [(heights, asked_policy, horizon)] = predictor.asked
    rising, falling = np.arange(26 - SEEN_STEPS + 1, 27), 100 - 2 * np.arange(30 - SEEN_STEPS + 1, 31)
    assert heights == np.repeat([*rising, *falling], FUTURES).tolist()
    assert (asked_policy, horizon) == (policy, HORIZON)
    assert found.position.tolist() == [26, 40]
    assert found.end.tolist() == [36, 20]
    assert {name: said.shape for name, said in found.said.items()} == dict.fromkeys((PAPERS, DEFAULT), (2, SEEN_STEPS))
    np.testing.assert_array_equal(found.said[DEFAULT], np.where(np.array([rising, falling]) % 4 == 0, 1, -1))
    np.testing.assert_array_equal(found.said[PAPERS], np.where(np.array([rising, falling]) % 4 == 0, 0.4, -0.8))


def test_what_every_observer_expects_worked_out_by_hand():
    """At the contact: 26 m, 2 m down foreseen; 40 m, 2 m up foreseen; an expression of 1 is read as 5 m."""
    expected = {name: rows.tolist() for name, rows in guesses(AT_CONTACT).expected.items()}
    assert expected == {
        STRAIGHT: [[26, 40]],
        NO_WORDS: [[26 + 10 * 2.6, 40 + 10 * 4]],
        PAPERS: [[26 - 4, 40 + 2]],
        DEFAULT: [[26 - 5, 40 + 5]],
        SWAPPED: [[26 + 5, 40 - 5]],
        SHUFFLED: [[26 + 2.5, 40 + 2.5], [26, 40 - 5]],
        PREDICTED_CHANGE: [[26 - 3, 40 - 3]],  # of one future, the first
        TRUE_END: [[36, 20]],
    }


def test_cut_at_the_end_everything_is_predicted_from_there():
    found = guesses(AT_END)
    assert (found.position.tolist(), found.end.tolist()) == ([30, 30], [40, 10])
    assert found.expected[DEFAULT].tolist() == [[25, 25]]
    assert found.said[DEFAULT][:, -1].tolist() == [-1, -1]


@pytest.mark.parametrize("cut", [AT_END, AT_CONTACT])
def test_the_last_frame_counts_and_flipped_is_its_mirror_image(cut: str):
    found = guesses(cut)
    for name in VOCABULARIES:
        np.testing.assert_allclose(found.expected[name][0], found.position + 5 * found.said[name][:, -1])
    np.testing.assert_allclose(found.expected[DEFAULT] + found.expected[SWAPPED], 2 * found.position[None])
    errors = found.errors()
    assert errors[TRUE_END].tolist() == [0, 0]
    assert all((errors[name] > 0).any() for name in errors if name != TRUE_END)


def test_errors_are_in_percent_of_the_width_and_means_over_vocabularies():
    errors = guesses(AT_CONTACT).errors()
    assert errors[DEFAULT] == pytest.approx([15 * 5, 25 * 5])
    assert errors[STRAIGHT] == pytest.approx([10 * 5, 20 * 5])
    assert errors[SHUFFLED] == pytest.approx([(7.5 + 10) / 2 * 5, (22.5 + 15) / 2 * 5])
    narrow, none = replace(TASK, explained_range=(2.0,)), np.zeros(1)
    apart = ObservedEpisodes([], AT_END, narrow, HORIZON, {}, {}, none, none, {SHUFFLED: np.array([[1.0], [-1.0]])})
    assert apart.errors()[SHUFFLED].tolist() == [50]  # not that of the mean, which is right


def errors_of(**given: Sequence[float]) -> dict[str, Array]:
    """Of six episodes; who is not given is always 5 off."""
    names = {name for pair in COMPARED for name in pair}
    return {name: np.array(given.get(name, [5] * 6), float) for name in names}


def test_errors_are_compared_by_episode():
    errors = errors_of(**{DEFAULT: [1, 2, 3, 4, 5, 6], NO_WORDS: [3, 3, 3, 9, 9, 9]})
    means, tests = error_tests(errors, 200, 0)
    assert {name: each.value for name, each in means.items()} == dict.fromkeys(errors, 5) | {
        DEFAULT: 3.5,
        NO_WORDS: 6,
    }
    assert 1 < means[DEFAULT].low < 3.5 < means[DEFAULT].high < 6
    assert [(test["explainer"], test["minus"]) for test in tests] == [*COMPARED]
    found = tests[0]
    assert (found["explainer"], found["minus"]) == (DEFAULT, NO_WORDS)
    assert found["difference"]["value"] == -2.5
    assert found["difference"]["low"] < -2.5 < found["difference"]["high"] < 0
    assert (found["better_episodes"], found["worse_episodes"]) == (5, 0)
    assert found["p"] == pytest.approx(2 / 2**5)  # as far out as all one way, the one without a difference either way
    shuffled = tests[COMPARED.index((DEFAULT, SHUFFLED))]
    assert (shuffled["better_episodes"], shuffled["worse_episodes"]) == (4, 1)
    assert shuffled["p"] == paired_p(np.array([-4.0, -3, -2, -1, 0, 1]))


def test_where_all_are_as_far_off_nothing_is_better():
    _, tests = error_tests(errors_of(), 50, 0)
    for test in tests:
        assert (test["better_episodes"], test["worse_episodes"], test["p"]) == (0, 0, 1)
        assert test["difference"] == {"value": 0, "low": 0, "high": 0}


def test_the_episodes_that_an_explanation_helps_and_misleads_most():
    errors = errors_of(**{NO_WORDS: [5, 9, 9, 1, 5, 5], PAPERS: [4, 8, 1, 2, 9, 5], DEFAULT: [0, 9, 9, 9, 9, 6]})
    assert most_telling(errors, PAPERS) == (2, 4)
    assert most_telling(errors, DEFAULT) == (0, 3)


def picked(monkeypatch: pytest.MonkeyPatch, count: int) -> tuple[list[ShownEpisode], list[int], int]:
    """Of rides down, whose lowest place is where they touch the ground."""
    flights = {
        1: ride([*range(30, 0, -1), 2], terminated=True),  # touches at step 29: a frame too early
        2: ride([*range(31, 0, -1), 2], terminated=True),
        3: ride([*range(90, 0, -1), 2], terminated=False),  # runs out of time
        4: ride([*range(50, 0, -1)], terminated=True),
        5: ride([*range(60, 0, -1)], terminated=True),
    }
    rolled_out, steps = [], []

    def fly(*given: Any) -> RecordedRollout:
        rolled_out.append(given[-1])
        return RecordedRollout(flights[given[-1]], [], [], [])

    monkeypatch.setattr(prediction_task, "record_rollout", fly)
    nobody: Any = None
    found = pick_episodes(nobody, TASK, policy, nobody, [*flights], count, HORIZON, lambda: steps.append(1))
    return found, rolled_out, len(steps)


def test_episodes_that_do_not_come_down_or_touch_too_early_are_left_out(monkeypatch: pytest.MonkeyPatch):
    assert SEEN_STEPS + HORIZON == 30
    found, rolled_out, steps = picked(monkeypatch, 9)
    assert [one.seed for one in found] == [2, 4, 5]
    assert [one.ends for one in found] == [
        {AT_END: 31, AT_CONTACT: 30},
        {AT_END: 49, AT_CONTACT: 49},
        {AT_END: 59, AT_CONTACT: 59},
    ]
    assert (rolled_out, steps) == ([1, 2, 3, 4, 5], 3)


def test_with_enough_episodes_no_more_are_rolled_out(monkeypatch: pytest.MonkeyPatch):
    found, rolled_out, steps = picked(monkeypatch, 2)
    assert [one.seed for one in found] == [2, 4]
    assert (rolled_out, steps) == ([1, 2, 3, 4], 2)


@pytest.fixture(scope="module")
def pilot() -> Any:
    [path] = policies(ROOT / "demo" / "checkpoints").values()
    agent = make_agent(PPOConfig(), LANDER_TASK.observation_size, make_gym(LANDER_ID, {}).action_space, 1)
    agent.greedy.load_state_dict(load(path))
    return agent.greedy


def test_real_episodes_where_the_goal_is_hidden(pilot: Any):
    hidden = make_gym(LANDER_ID, dict(LANDER_TASK.hidden_goal))
    instructor, seeds = make_instructor(InstructorConfig("oracle"), LANDER_TASK), range(JUDGING_SEED, JUDGING_SEED + 9)
    found = pick_episodes(hidden, LANDER_TASK, pilot, instructor, seeds, 2, 60)
    assert [one.seed for one in found] == [*seeds[:2]]
    for one in found:
        states, (end, contact) = one.watched.episode.states, one.ends.values()
        assert SEEN_STEPS + 60 <= contact <= end == len(states) - 1 == len(one.watched.moments)
        assert not states[:contact, 6:8].any()
        assert states[contact, 6:8].any()
        again = record_rollout(hidden, pilot, instructor, one.seed)
        np.testing.assert_array_equal(again.episode.states, states)
    assert pick_episodes(hidden, LANDER_TASK, pilot, instructor, seeds[:2], 2, 900) == []
