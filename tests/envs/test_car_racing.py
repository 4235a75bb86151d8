"""What is declared of gymnasium's CarRacing, on a hand-made road and against the real game."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.config.command_line import composed
from ibe_rl.envs import car_racing
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.task import IMAGE
from ibe_rl.types import ConfigError

GAS, RIGHT, LEFT = 3, 1, 2
NORTH = 0.0


def driving(place: tuple[float, float], angle: float, road: Any, speed: float = 0.0) -> Any:
    """A car that looks to ``angle``, counted counter-clockwise from north, and drives north."""
    hull = SimpleNamespace(position=place, angle=angle, linearVelocity=(0.0, speed), angularVelocity=0.25)
    return SimpleNamespace(car=SimpleNamespace(hull=hull), track=road, tile_visited_count=7)


NORTHWARD = [(0.0, NORTH, 0.0, 3.5 * number) for number in range(40)]


def test_the_state_is_seen_from_the_car():
    seen = car_racing.car_on_road(driving((2.0, 35.0), NORTH, NORTHWARD, 12.0), None)
    np.testing.assert_allclose(seen, [0, np.arctan2(-2, 28), 2, 12, -0.25, 7])


def test_a_car_that_looks_to_the_left_has_the_road_to_its_right():
    seen = car_racing.car_on_road(driving((0.0, 35.0), np.pi / 6, NORTHWARD, 10.0), None)
    np.testing.assert_allclose(seen[[0, 1, 3]], [-np.pi / 6, np.pi / 6, 10 * np.cos(np.pi / 6)])
    np.testing.assert_array_equal(car_racing.follow_road(seen), [1])


def test_the_rule_is_the_side_to_which_the_road_goes():
    states = np.zeros((3, 6))
    states[:, car_racing.BEND] = -0.3, 0.1, 0.3
    np.testing.assert_array_equal(car_racing.follow_road(states), [[-1], [0], [1]])


def test_it_succeeds_on_the_road_at_the_end_of_the_time():
    state = np.array([0, 0, 2.0, 20, 0, 30])
    assert car_racing.on_the_road(state, False, True)
    assert not car_racing.on_the_road(state, True, True)
    assert not car_racing.on_the_road(state, False, False)
    assert not car_racing.on_the_road(state - [0, 0, 0, 0, 0, 1], False, True)
    assert not car_racing.on_the_road(state - [0, 0, 9, 0, 0, 0], False, True)


def test_the_heading_turns_as_the_car_is_steered():
    env = make_env(composed("train", ["env=car_racing"]).env)
    for action, sign in ((RIGHT, 1), (LEFT, -1)):
        state, _ = env.reset(seed=0)
        for each in (GAS, GAS, GAS, GAS, action, action, action, action):
            before = state
            state, *_ = env.step(each)
        turned = state[car_racing.CAR_HEADING] - before[car_racing.CAR_HEADING]
        assert sign * turned > 0.02
        np.testing.assert_allclose(car_racing.turning(state), turned, rtol=0.5)


def test_its_engine_cannot_be_copied_so_it_is_predicted_from_the_log():
    config = composed("train", ["env=car_racing"])
    assert config.predictor.kind == "regression"
    with pytest.raises(ConfigError, match=r"predictor=simulator .* cannot be saved .* predictor=regression"):
        make_snapshot_env(config.env)


def test_it_trains_on_images_and_explains(tmp_path: Path):
    few = ["total_frames=160", "refresh_every_frames=160", "eval_every_frames=160", "eval_episodes=1", "viewer=off"]
    few += ["collect.envs_per_process=2", "collect.steps_per_batch=80", "env.task.max_episode_steps=40"]
    few += ["mapping.horizon_steps=8", "mapping.top_fraction=1.0", "first_refresh_episodes=0"]
    call("train", "env=car_racing", *SMALL, *few, f"run_dir={tmp_path / 'run'}")
    call("explain", f"run={tmp_path / 'run'}", "viewer=off")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["frames"], summary["refreshes_skipped"]) == (160, 0)
    (image,) = make_env(composed("train", ["env=car_racing"]).env).get_wrapper_attr("task").parts
    assert (image.kind, image.shape) == (IMAGE, (96, 96, 3))
