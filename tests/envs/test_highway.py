"""What is declared of highway-env's road, on hand-made traffic and against the real one."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.config.command_line import composed
from ibe_rl.envs import highway
from ibe_rl.envs.make import make_env
from ibe_rl.envs.trial import try_out
from ibe_rl.envs.wrappers import task_of
from ibe_rl.evaluation.runs import load_run
from ibe_rl.ibe import phrases_of

IDLE, LANE_RIGHT, FASTER = 1, 2, 3


def road_with(car: tuple[float, float], *others: tuple[float, float], speed: float = 25.0) -> Any:
    """A car and others, each at (metres along the road, lane)."""
    places = [np.array([x, 4.0 * lane]) for x, lane in (car, *others)]
    vehicles = [SimpleNamespace(position=place, speed=speed, velocity=np.array([speed, 0.5])) for place in places]
    return SimpleNamespace(vehicle=vehicles[0], road=SimpleNamespace(vehicles=vehicles))


def test_the_state_has_the_free_road_of_each_lane_and_who_is_behind():
    game = road_with((200, 1), (230, 1), (260, 1), (195, 0), (180, 2), (400, 2))
    np.testing.assert_allclose(highway.traffic(game, None), [1, 25, 0.5, 0, 30, 100, 2])


def test_a_vehicle_between_two_lanes_is_in_both():
    np.testing.assert_allclose(highway.traffic(road_with((0, 2), (40, 0.5)), None)[3:6], [40, 40, 100])


def test_who_is_just_behind_in_the_own_lane_is_not_in_the_way():
    np.testing.assert_allclose(highway.traffic(road_with((0, 0), (-6, 0), (-6, 1)), None)[3:6], [100, 0, 100])


RULES = [
    (1, 30, (100, 100, 100), (1, 0)),  # to the right where it is free
    (2, 25, (100, 100, 100), (0, 1)),
    (2, 30, (100, 100, 35), (-1, 0)),  # overtake on the left
    (2, 30, (100, 15, 35), (0, 0)),  # no gap there
    (2, 30, (100, 15, 25), (0, -1)),  # so slower
    (0, 20, (25, 25, 100), (1, 0)),  # the free lane is two to the right; slow enough
    (1, 25, (40, 35, 30), (0, 0)),  # no lane is clear, none much better
    (1, 25, (48, 35, 30), (-1, 0)),
    (1.4, 25, (100, 30, 100), (1, 0)),  # between lanes: of the nearest
]


@pytest.mark.parametrize(("lane", "speed", "ahead", "said"), RULES)
def test_the_rule_keeps_right_overtakes_and_keeps_its_distance(
    lane: float, speed: float, ahead: tuple[float, ...], said: tuple[float, ...]
):
    assert tuple(highway.driving_rule(np.array([lane, speed, 0, *ahead, 0]))) == said


def test_the_rule_answers_many_states_at_once():
    states = np.array([[lane, speed, 0, *ahead, 0] for lane, speed, ahead, _ in RULES])
    np.testing.assert_array_equal(highway.driving_rule(states.reshape(3, 3, 7)).reshape(-1, 2), [r[3] for r in RULES])


def test_it_has_overtaken_if_it_was_in_time_and_in_one_piece():
    state = np.array([2, 30, 0, 100, 100, 100, 3.0])
    assert highway.overtook(state, False, True)
    assert not highway.overtook(state, True, False)
    assert not highway.overtook(state - 1, False, True)


def test_both_numbers_rise_as_the_rule_says():
    env = make_env(composed("train", ["env=highway"]).env)
    state, _ = env.reset(seed=1)  # in the middle lane
    for action, number in ((LANE_RIGHT, highway.CAR_LANE), (FASTER, highway.CAR_SPEED)):
        before = state[number]
        state, *_ = env.step(action)
        assert state[number] > before + 0.5
    assert task_of(env).explained == (highway.CAR_LANE, highway.CAR_SPEED)


def test_the_trial_copies_it_exactly():
    assert try_out(composed("train", ["env=highway"]).env, simulated=True) == []


def test_it_trains_and_explains(tmp_path: Path):
    few = ["total_frames=640", "refresh_every_frames=640", "eval_every_frames=640", "eval_episodes=2", "viewer=off"]
    few += ["collect.steps_per_batch=40", "mapping.horizon_steps=4", "first_refresh_episodes=0", "predictor.futures=1"]
    few += ["mapping.dimensions=[]"]  # which are looked for in many random steps
    call("train", "env=highway", *SMALL, *few, f"run_dir={tmp_path / 'run'}")
    call("explain", f"run={tmp_path / 'run'}", "viewer=off", "predictor.futures=1")
    run = load_run(tmp_path / "run")
    assert "staying in this lane and at this speed" in phrases_of(np.zeros((1, 2)), run.task.phrases)
    assert run.mapping.expressions.shape[1] == 2
