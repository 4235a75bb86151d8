"""The game is gymnasium's but for the pad: its physics, its pads, its reward, its end, its picture."""

from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from flights import aimed, erratic, fly, ground, make
from gymnasium.utils.env_checker import check_env

from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.lander_task import PAD_X
from ibe_rl.types import Array

YELLOW = (204, 204, 0)  # gymnasium's flags


def pads_drawn(env: Any, count: int, **first: Any) -> list[str]:
    env.reset(**first)
    names = [env.unwrapped.pad]
    for _ in range(count - 1):
        env.reset()
        names.append(env.unwrapped.pad)
    return names


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_with_the_pad_in_the_centre_it_is_gymnasiums_lander_exactly(share: float):
    original, ours = gymnasium.make("LunarLander-v3"), make(pad="center")
    pilot = erratic(0, share)
    for seed in range(5):
        state, _ = ours.reset(seed=seed)
        expected, _ = original.reset(seed=seed)
        ended = False
        while not ended:
            np.testing.assert_array_equal(state, np.append(expected, np.float32(0)))
            action = pilot(ours, state)
            expected, *rest, _ = original.step(action)
            state, *ends, _ = ours.step(action)
            assert ends == rest
            ended = rest[1] or rest[2]


def test_all_pads_are_drawn_and_the_same_seed_draws_the_same():
    drawn = pads_drawn(make(), 200, seed=1)
    assert drawn == pads_drawn(make(), 200, seed=1)
    assert drawn != pads_drawn(make(), 200, seed=2)
    counts = [drawn.count(pad) for pad in PAD_X]
    assert min(counts) > 40
    assert sum(counts) == 200


def test_pads_are_not_drawn_from_the_numbers_of_the_terrain():
    env = make()
    names, same = list(PAD_X), 0
    for seed in range(150):
        env.reset(seed=seed)
        same += names[np.random.default_rng(seed).integers(3)] == env.unwrapped.pad
    assert 30 < same < 70


def test_a_fixed_pad_shifts_no_later_draw():
    free, fixed = make(), make()
    expected = pads_drawn(free, 20, seed=3)
    fixed.reset(seed=3, options={"pad": "left"})
    assert fixed.unwrapped.pad == "left"
    for later in expected[1:]:
        fixed.reset()
        assert fixed.unwrapped.pad == later


def test_the_pad_does_not_touch_the_random_stream_of_the_physics():
    envs = [make(pad=pad) for pad in ("random", *PAD_X)]
    starts = [env.reset(seed=4)[0][:8] for env in envs]
    for _ in range(20):  # in the air
        states = [env.step(2)[0][:8] for env in envs]
    for env, start, state in zip(envs, starts, states, strict=True):
        np.testing.assert_array_equal(start, starts[0])
        np.testing.assert_array_equal(state, states[0])
        assert env.unwrapped.np_random.bit_generator.state == envs[0].unwrapped.np_random.bit_generator.state


def test_option_before_argument_before_draw():
    env = make(pad="right")
    assert pads_drawn(env, 3, seed=0) == ["right"] * 3
    env.reset(options={"pad": "left"})
    assert env.unwrapped.pad == "left"
    env.reset(options={})
    assert env.unwrapped.pad == "right"
    assert {env.unwrapped.pad for _ in range(40) if env.reset(options={"pad": "random"})} == set(PAD_X)


def test_another_pad_is_refused():
    with pytest.raises(ValueError, match="pad='up': choose one of random, left, center, right"):
        make(pad="up")
    with pytest.raises(ValueError, match="pad='up': choose one of"):
        make().reset(options={"pad": "up"})


@pytest.mark.parametrize("pad", PAD_X)
def test_the_state_ends_with_the_goal_and_names_the_pad(pad: str):
    env = make()
    state, info = env.reset(seed=0, options={"pad": pad})
    assert state.shape == (9,)
    assert state.dtype == np.float32
    assert state[8] == np.float32(PAD_X[pad])
    assert env.step(0)[0][8] == state[8]
    assert LANDER_TASK.context(state) == pad
    assert info == {"landed": False}


@pytest.mark.parametrize("pad", PAD_X)
def test_the_ground_is_flat_between_the_flags_wherever_the_pad_is(pad: str):
    env, level = make(), make()
    for seed in range(5):
        env.reset(seed=seed, options={"pad": pad})
        level.reset(seed=seed, options={"pad": "center"})
        corners = ground(env)
        inside = np.abs(corners[:, 0] - PAD_X[pad]) < 0.2 + 1e-6
        assert inside.sum() == 3
        np.testing.assert_allclose(corners[inside, 1], ground(level)[5, 1])
        assert np.ptp(corners[:, 1]) > 0.5  # and hilly elsewhere
        np.testing.assert_allclose(np.sort(corners[:, 1]), np.sort(ground(level)[:, 1]))  # the game's own hills
        np.testing.assert_allclose(env.unwrapped.background()[0].points[:, 1], corners[:, 1], atol=1e-6)


def test_flat_is_flat_everywhere():
    env = make(flat=True)
    for pad in PAD_X:
        env.reset(seed=1, options={"pad": pad})
        assert np.ptp(ground(env)[:, 1]) == 0


@pytest.mark.parametrize("pad", PAD_X)
def test_in_the_air_the_reward_is_gymnasiums_with_the_distance_to_the_pad(pad: str):
    original, ours = gymnasium.make("LunarLander-v3"), make(pad=pad)
    random = np.random.default_rng(0)
    for seed in range(3):
        original.reset(seed=seed)
        states, rewards, theirs = [ours.reset(seed=seed)[0]], [], []
        for action in random.integers(4, size=40):
            state, reward, *_ = ours.step(action)
            assert not state[6:8].any()
            states.append(state)
            rewards.append(reward)
            theirs.append(original.step(action)[1])
        x, y, goal = np.array(states, float)[:, [0, 1, 8]].T
        gap = np.hypot(x - goal, y) - np.hypot(x, y)
        np.testing.assert_allclose(rewards, theirs - 100 * np.diff(gap), atol=1e-4)
        if pad != "center":
            assert np.abs(np.subtract(rewards, theirs)).max() > 0.01


@pytest.mark.parametrize("pad", PAD_X)
def test_on_the_ground_too_the_reward_is_the_change_of_the_potential_less_fuel(pad: str):
    env = make(pad=pad)
    state, _ = env.reset(seed=7)
    states, actions, rewards, ended = [state], [], [], False
    while not ended:
        actions.append(aimed()(env, state))
        state, reward, ended, _, _ = env.step(actions[-1])
        states.append(state)
        rewards.append(reward)
    s = np.array(states, float)
    assert s[:, 6:8].any()
    distance, speed = np.hypot(s[:, 0] - s[:, 8], s[:, 1]), np.hypot(s[:, 2], s[:, 3])
    potential = -100 * distance - 100 * speed - 100 * np.abs(s[:, 4]) + 10 * (s[:, 6] + s[:, 7])
    fuel = np.array([0, 0.03, 0.3, 0.03])[actions]
    np.testing.assert_allclose(rewards[:-1], (np.diff(potential) - fuel)[:-1], atol=1e-3)
    assert rewards[-1] == 100


@pytest.mark.parametrize("pad", PAD_X)
def test_a_rest_on_both_legs_between_the_flags_is_a_landing(pad: str):
    """In contact is what the state says; it can say 0 for a leg on a corner of the ground (docs/LOG.md)."""
    found = []
    for seed in range(12):
        steps = fly(make(), aimed(), seed=seed, options={"pad": pad})
        state, reward, terminated, _, info = steps[-1]
        assert not any(info["landed"] for *_, info in steps[:-1])
        if reward == 100 and terminated and abs(state[0] - PAD_X[pad]) < 0.2:
            found.append(info["landed"])
            assert info["landed"] == state[6:8].all()
    assert 2 <= sum(found) <= len(found) >= 6


@pytest.mark.parametrize(("pad", "seed"), [("left", 13), ("center", 2), ("right", 67)])
def test_a_crash_is_no_landing_even_onto_the_pad(pad: str, seed: int):
    *_, (state, *rest) = fly(make(), lambda *_: 0, seed=seed, options={"pad": pad})
    assert rest == [-100, True, False, {"landed": False}]
    assert abs(state[0] - PAD_X[pad]) < 0.2
    assert state[6:8].all()


@pytest.mark.parametrize("aside", [-0.4, 0.4])
def test_a_rest_beside_the_pad_is_no_landing(aside: float):
    for seed in (2, 3, 4):
        *_, (state, *rest) = fly(make(flat=True), aimed(aside), seed=seed, options={"pad": "center"})
        assert rest == [100, True, False, {"landed": False}]
        assert 0.2 < abs(state[0]) < 0.5
        assert state[6:8].all()


def test_a_rest_on_one_leg_is_no_landing():
    def one_leg(game: Any, state: Array) -> int:
        game.unwrapped.legs[0] = SimpleNamespace(ground_contact=False, contacts=[])  # hangs in the air
        return aimed()(game, state)

    *_, (state, *rest) = fly(make(pad="center"), one_leg, seed=1)
    assert abs(state[0]) < 0.2
    assert rest == [100, True, False, {"landed": False}]


def test_the_episode_is_cut_off_after_a_thousand_steps():
    steps = fly(make(), aimed(y=0.8), seed=0)
    assert len(steps) == 1000 == LANDER_TASK.max_episode_steps
    assert [truncated for _, _, _, truncated, _ in steps] == [False] * 999 + [True]
    assert not any(terminated for _, _, terminated, _, _ in steps)
    assert steps[-1][4] == {"landed": False}


def yellow_columns(env: Any) -> list[int]:
    """Where in the picture flags begin, from the left."""
    columns = np.flatnonzero((env.render() == YELLOW).all(axis=-1).any(axis=0))
    return columns[np.diff(columns, prepend=-100) > 1].tolist()


def test_the_picture_shows_the_flags_where_they_are():
    env = make(render_mode="rgb_array")
    for pad, x in PAD_X.items():
        env.reset(seed=0, options={"pad": pad})
        assert yellow_columns(env) == pytest.approx([300 * (1 + x - 0.2), 300 * (1 + x + 0.2)], abs=2)
        left, right = (float(flag.points[0, 0]) for flag in env.unwrapped.background()[1:])
        assert (left, right) == pytest.approx((10 * (1 + x - 0.2), 10 * (1 + x + 0.2)))


def test_hidden_flags_are_hidden_and_change_nothing_else():
    hidden, shown = make(render_mode="rgb_array", flags=False), make(render_mode="rgb_array")
    for env in (hidden, shown):
        env.reset(seed=0, options={"pad": "right"})
        assert env.render().any()
    assert yellow_columns(hidden) == []
    assert len(yellow_columns(shown)) == 2
    assert len(hidden.unwrapped.background()) == 1
    assert hidden.unwrapped.helipad_x1 == shown.unwrapped.helipad_x1
    np.testing.assert_array_equal(hidden.step(2)[0], shown.step(2)[0])


def test_the_drawing_has_the_lander_where_the_scene_path_says():
    env = make()
    state, _ = env.reset(seed=0, options={"pad": "left"})
    for _ in range(30):
        state = env.step(2)[0]
    body, *legs = env.unwrapped.figure()
    assert len(legs) == 2
    assert LANDER_TASK.scene_path is not None
    np.testing.assert_allclose(body.points.mean(axis=0), LANDER_TASK.scene_path(state), atol=0.2)


@pytest.mark.filterwarnings("ignore::UserWarning")  # the checker advises; what it refuses it raises
def test_gymnasiums_checker_passes():
    check_env(make().unwrapped, skip_render_check=True)
