"""The game is gymnasium's cart-pole; the target, the pay, the success, the snapshots and the drawing are by hand."""

from collections import Counter
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from ibe_rl.envs import CART_POLE_ID, CART_POLE_TASK
from ibe_rl.envs.cart_pole import MOVES_FROM, MOVES_UNTIL
from ibe_rl.envs.cart_pole_task import (
    CART_POLE_EPISODE_STEPS,
    TARGET_X,
    cart_pole_goal_offset,
    cart_pole_instruction,
    cart_pole_motion,
)
from ibe_rl.types import Array


def make(**kwargs: Any) -> Any:
    return gymnasium.make(CART_POLE_ID, disable_env_checker=True, **kwargs)


def pilot(state: Array) -> int:
    """Lean towards the target: a state feedback found by hand; it takes the cart there within 120 steps."""
    x, vx, angle, turning, target = state
    lean = np.clip(0.12 * np.clip(target - x, -0.8, 0.8) - 0.12 * vx, -0.12, 0.12)
    return int(angle - lean + 0.4 * turning > 0)


def play(env: Any, **reset: Any) -> tuple[Array, list[tuple[float, bool, bool, dict[str, Any]]], list[int]]:
    """One episode: its states ``(T + 1, 5)``, what else each step returned, and the actions."""
    states, steps, actions = [env.reset(**reset)[0]], [], []
    while not steps or not (steps[-1][1] or steps[-1][2]):
        actions.append(pilot(states[-1]))
        state, *rest = env.step(actions[-1])
        states.append(state)
        steps.append(tuple(rest))
    return np.array(states), steps, actions


@pytest.fixture(scope="module")
def episodes() -> list[tuple[Array, list[Any], list[int]]]:
    env = make()
    return [play(env, seed=seed) for seed in range(30)]


def test_the_physics_are_gymnasiums():
    ours, theirs = make(), gymnasium.make("CartPole-v1").unwrapped
    random = np.random.default_rng(0)
    for seed in range(5):
        state, (expected, _) = ours.reset(seed=seed)[0], theirs.reset(seed=seed)
        fallen = False
        while not fallen:
            np.testing.assert_array_equal(state[:4], expected)
            action = int(random.integers(2))
            expected, _, fallen, _, _ = theirs.step(action)
            state, reward, ended, _, _ = ours.step(action)
            assert ended == fallen
            assert (reward == 0) == fallen
        np.testing.assert_array_equal(state[:4], expected)


def test_the_target_moves_once_between_its_steps_to_any_other_place(episodes: Any):
    moves, ways = [], set()
    for states, _, _ in episodes:
        places = states[:, 4]
        (move,) = np.flatnonzero(np.diff(places))
        moves.append(move + 1)
        ways.add((float(places[0]), float(places[-1])))
        assert {float(place) for place in places} <= {float(np.float32(x)) for x in TARGET_X.values()}
    assert MOVES_FROM <= min(moves) < MOVES_FROM + 30
    assert MOVES_UNTIL - 30 < max(moves) < MOVES_UNTIL
    assert len(ways) == 6


def test_a_target_that_does_not_move_stays():
    states, _, _ = play(make(moving=False), seed=1)
    assert len(states) == CART_POLE_EPISODE_STEPS + 1
    assert np.ptp(states[:, 4]) == 0


def test_it_pays_for_being_near_the_target_and_more_close_to_it(episodes: Any):
    for states, steps, _ in episodes[:5]:
        distance = np.abs(states[1:, 0].astype(float) - states[1:, 4])
        expected = 0.5 * np.maximum(0, 1 - distance / 2.4) + 0.5 * np.maximum(0, 1 - distance / 0.4)
        np.testing.assert_allclose([step[0] for step in steps], expected, atol=1e-6)


def test_success_is_to_stand_at_the_target_at_the_end(episodes: Any):
    outcomes = Counter()
    for states, steps, _ in episodes:
        assert not any(info["there"] for *_, info in steps[:-1])
        _, terminated, truncated, info = steps[-1]
        there = len(steps) == CART_POLE_EPISODE_STEPS and abs(states[-1, 4] - states[-1, 0]) <= 0.2
        assert info["there"] == (there and not terminated)
        outcomes[info["there"], truncated] += 1
    assert min(outcomes[True, True], outcomes[False, True]) > 5


def test_an_end_elsewhere_or_a_fall_is_no_success():
    env = make(moving=False, target="right")
    state, _ = env.reset(seed=0)
    for _ in range(CART_POLE_EPISODE_STEPS):
        state, _, _, truncated, info = env.step(pilot(np.append(state[:4], 0)))  # it stays in the middle
    assert truncated
    assert not info["there"]
    env.reset(seed=0)
    fallen = False
    while not fallen:
        _, reward, fallen, _, info = env.step(1)
    assert reward == 0
    assert not info["there"]


def test_option_before_argument_before_draw():
    env = make(target="right")
    assert env.reset(seed=0)[0][4] == np.float32(1.2)
    assert env.reset(options={"target": "left"})[0][4] == np.float32(-1.2)
    drawn = Counter(float(env.reset(options={"target": "random"})[0][4]) for _ in range(200))
    assert min(drawn.values()) > 40
    with pytest.raises(ValueError, match="target='up': choose one of random, left, center, right"):
        make(target="up")
    with pytest.raises(ValueError, match="target='up': choose one of"):
        env.reset(options={"target": "up"})


def test_a_fixed_target_shifts_no_later_draw():
    free, fixed = make(), make()
    free.reset(seed=3)
    fixed.reset(seed=3, options={"target": "left"})
    assert [free.reset()[0][4] for _ in range(20)] == [fixed.reset()[0][4] for _ in range(20)]


def test_what_the_task_says_of_states():
    states = np.array([[1.0, 2, 0, 0, 0], [-0.2, 0, 0, 0, 0], [0.1, -3, 0, 0, 1.2]], np.float32)
    assert cart_pole_instruction(states)[:, 0].tolist() == [-1, 0, 1]
    np.testing.assert_allclose(cart_pole_goal_offset(states)[:, 0], [-1, 0.2, 1.1], atol=1e-6)
    np.testing.assert_allclose(cart_pole_motion(states)[:, 0], [0.04, 0, -0.06], atol=1e-6)
    assert [CART_POLE_TASK.context(state) for state in states] == ["center", "center", "right"]


def test_motion_is_the_change_of_x_in_one_step(episodes: Any):
    states = episodes[0][0]
    np.testing.assert_allclose(cart_pole_motion(states)[:-1, 0], np.diff(states[:, 0]), atol=1e-6)


def test_a_restored_game_repeats_the_original_to_the_last_bit(episodes: Any):
    rolled_out, copy = make().unwrapped, make().unwrapped
    copy.reset(seed=99)
    for seed, (states, steps, actions) in enumerate(episodes[:6]):
        rolled_out.reset(seed=seed)
        for step, action in enumerate(actions):
            if step % 50 == 0:
                copy.restore(rolled_out.snapshot())
                for ahead in range(step, min(step + 120, len(actions))):
                    state, reward, fallen, _, info = copy.step(actions[ahead])
                    np.testing.assert_array_equal(state, states[ahead + 1])
                    assert (reward, fallen, info) == (steps[ahead][0], steps[ahead][1], steps[ahead][3])
            rolled_out.step(action)


def test_another_generator_moves_the_target_otherwise():
    rolled_out, copy = make().unwrapped, make().unwrapped
    state, _ = rolled_out.reset(seed=0, options={"target": "center"})
    copy.reset(seed=1)
    for _ in range(MOVES_FROM - 1):
        state = rolled_out.step(pilot(state))[0]
    before = rolled_out.snapshot()

    def moves(noise: np.random.Generator | None) -> tuple[int, str]:
        copy.restore(before, noise)
        now, steps = state, 0
        while not copy.snapshot().moved:
            now, steps = copy.step(pilot(now))[0], steps + 1
        return steps, copy.target

    assert moves(None) == moves(None)
    drawn = [moves(np.random.default_rng(seed)) for seed in range(60)]
    assert drawn[5] == moves(np.random.default_rng(5))
    assert {place for _, place in drawn} == {"left", "right"}
    assert np.mean([steps for steps, _ in drawn]) == pytest.approx((MOVES_UNTIL - MOVES_FROM) / 2, abs=12)


def test_a_snapshot_changes_nothing_and_does_not_change():
    rolled_out, untouched = make(), make()
    for env in (rolled_out, untouched):
        env.reset(seed=0)
    before = rolled_out.unwrapped.snapshot()
    kept = before.state.copy()
    for step in range(20):
        np.testing.assert_array_equal(rolled_out.step(step % 2)[0], untouched.step(step % 2)[0])
        rolled_out.unwrapped.snapshot()
    np.testing.assert_array_equal(before.state, kept)


def test_the_drawing_has_the_cart_where_the_scene_path_says_and_inside_the_scene():
    env = make()
    width, height = CART_POLE_TASK.scene_size
    assert CART_POLE_TASK.scene_path is not None
    for place, x in TARGET_X.items():
        state, _ = env.reset(seed=0, options={"target": place})
        for _ in range(40):
            state = env.step(pilot(state))[0]
        cart, pole, target = env.unwrapped.figure()
        np.testing.assert_allclose(cart.points.mean(axis=0), CART_POLE_TASK.scene_path(state), atol=1e-4)
        np.testing.assert_allclose(pole.points[0], CART_POLE_TASK.scene_path(state), atol=1e-4)
        assert np.hypot(*(pole.points[1] - pole.points[0])) == pytest.approx(4)
        assert target.points[0, 0] == pytest.approx(width / 2 + 4 * x)
        for shape in (cart, pole, target, *env.unwrapped.background()):
            assert (shape.points >= 0).all()
            assert (shape.points <= [width, height]).all()


@pytest.mark.filterwarnings("ignore::UserWarning")  # the checker advises; what it refuses it raises
def test_gymnasiums_checker_passes():
    check_env(make().unwrapped, skip_render_check=True)
