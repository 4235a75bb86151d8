"""Baselines on moments and episodes made by hand."""

from dataclasses import replace

import numpy as np
from lift import TASK, moments

from ibe_rl.evaluation.baselines import CHEAP, StateRegressor, as_instruction, cheap_baselines, fit_state_regressors
from ibe_rl.types import Array, Episode


class Zero:
    def predict(self, states: Array) -> Array:
        return np.zeros(len(states))


REGRESSORS = [StateRegressor("ridge", Zero(), {})]
HERE = moments([1, -1], [[1], [1]], instruction=[1, -1], episode=[0, 1], speed=[3, -4])


def test_what_can_be_said_without_a_simulator():
    said = cheap_baselines(HERE, 5, TASK, REGRESSORS)
    assert tuple(said) == CHEAP
    assert said["present_velocity"].tolist() == [[1.5], [-2.0]]
    assert said["direction_to_goal"].tolist() == [[5], [5]]
    assert said["last_instruction"].tolist() == [[1], [-1]]
    assert said["constant"].tolist() == said["state_regressor"].tolist() == [[0], [0]]


def test_what_the_task_does_not_declare_is_left_out():
    bare = replace(TASK, motion=None, goal_offset=None)
    assert set(cheap_baselines(HERE, 5, bare, REGRESSORS)) == {"last_instruction", "constant", "state_regressor"}


def test_changes_become_instructions_by_the_way_they_go():
    change = np.array([[-2, -0.4, 0, 0.4, 2], [-2, -0.4, 0, 0.4, 2]]).T
    assert as_instruction("present_velocity", change, (0.5, 0.3)).T.tolist() == [[-1, 0, 0, 0, 1], [-1, -1, 0, 1, 1]]
    assert as_instruction("last_instruction", change, (0.5, 0.3)).tolist() == change.tolist()


def episode(seed: int, bent: bool) -> Episode:
    """Goes on at its speed; bent: upwards whichever way it goes."""
    random = np.random.default_rng(seed)
    speed = random.normal()
    step = abs(speed) if bent else speed
    states = np.column_stack([np.arange(9) * step, np.full(9, speed), random.normal(size=9)])
    return Episode(states, np.zeros(8), np.zeros(8), np.zeros((8, 1)), np.ones(8, bool), True, True, "lower")


def test_the_regression_that_foretells_left_out_episodes_better_is_kept():
    [straight] = fit_state_regressors([episode(seed, bent=False) for seed in range(60)], 1, TASK, seed=0)
    assert straight.kind == "ridge"
    assert straight.r2["ridge"] > 0.999 > straight.r2["boosting"]
    np.testing.assert_allclose(straight.predict(np.array([[0, 2, 0], [7, -1, 0]])), [2, -1], atol=0.02)
    [bent] = fit_state_regressors([episode(seed, bent=True) for seed in range(60)], 1, TASK, seed=0)
    assert bent.kind == "boosting"
    assert bent.r2["ridge"] < 0.5 < bent.r2["boosting"]
