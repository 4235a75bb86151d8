"""A restored game of the lander repeats what follows, and the lean step equals gymnasium's."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from flights import aimed, ground, make

from ibe_rl.envs.lean_step import throttles
from ibe_rl.types import Array

ENGINES = pytest.mark.parametrize("continuous", [False, True], ids=["on or off", "throttled"])


@dataclass(frozen=True)
class Replay:
    """60 steps from a snapshot, against what really happened in them."""

    error: float  # the largest one of the six numbers of the body
    on_ground: bool  # at the beginning
    lands: bool  # at any time
    same_legs: bool  # in the first step


def touching(env: Any) -> bool:
    return any(edge.contact.touching for leg in env.unwrapped.legs for edge in leg.contacts)


def replays(episodes: range, **kwargs: Any) -> list[Replay]:
    """Replay from every seventh step of some landings, in another copy of the game."""
    rolled_out, copy = make(**kwargs), make(**kwargs).unwrapped
    copy.reset(seed=12345)
    found = []
    for seed in episodes:
        state, _ = rolled_out.reset(seed=seed)
        snapshots, actions, states, ground, ended = [], [], [state], [False], False
        while not ended:
            snapshots.append(rolled_out.unwrapped.snapshot())
            actions.append(aimed()(rolled_out, state))
            state, _, ended, _, _ = rolled_out.step(actions[-1])
            states.append(state)
            ground.append(touching(rolled_out))
        for start in range(0, len(actions) - 60, 7):
            copy.restore(snapshots[start])
            again = np.array([copy.step(action)[0] for action in actions[start : start + 60]])
            really = np.array(states[start + 1 : start + 61])
            assert (again[:, 8] == really[:, 8]).all()
            error, same_legs = np.abs(again - really)[:, :6].max(), (again[0, 6:8] == really[0, 6:8]).all()
            found.append(Replay(float(error), ground[start], any(ground[start : start + 61]), bool(same_legs)))
    return found


@pytest.fixture(scope="module", params=[False, True], ids=["on or off", "throttled"])
def landings(request: pytest.FixtureRequest) -> list[Replay]:
    return replays(range(16), continuous=request.param)


@pytest.mark.slow
def test_a_restored_game_repeats_the_flight(landings: list[Replay]):
    errors = [one.error for one in landings if not one.lands]
    assert len(errors) > 100
    assert np.median(errors) < 1e-5
    assert np.percentile(errors, 95) < 1e-4


def test_a_restored_game_repeats_the_touchdown(landings: list[Replay]):
    errors = [one.error for one in landings if one.lands and not one.on_ground]
    assert len(errors) > 50
    assert np.median(errors) < 1e-4
    assert np.percentile(errors, 95) < 1e-2


def test_a_restored_game_repeats_what_follows_on_the_ground(landings: list[Replay]):
    errors = [one.error for one in landings if one.on_ground]
    assert len(errors) > 20
    assert np.median(errors) < 1e-3


def test_a_restored_game_has_the_same_wind():
    errors = [one.error for one in replays(range(3), enable_wind=True, wind_power=15.0) if not one.lands]
    assert len(errors) > 10
    assert np.percentile(errors, 95) < 1e-4


def test_a_leg_that_leaves_the_ground_after_a_restore_is_in_the_air():
    rolled_out, copy = make().unwrapped, make().unwrapped
    copy.reset(seed=1)
    found = []
    for seed in range(7):
        state, _ = rolled_out.reset(seed=seed, options={"pad": "center"})
        while not state[6:8].all():  # until it stands, then take off
            state = rolled_out.step(aimed()(rolled_out, state))[0]
        while touching(rolled_out):
            copy.restore(rolled_out.snapshot())
            legs = rolled_out.step(2)[0][6:8]
            found.append((legs == copy.step(2)[0][6:8]).all())
    assert len(found) > 20
    assert np.mean(found) > 0.9


def test_a_restored_game_goes_on_with_reward_and_pad_of_the_original():
    rolled_out, copy = make(), make()
    copy.reset(seed=9, options={"pad": "right"})
    rolled_out.reset(seed=0, options={"pad": "left"})
    for _ in range(10):
        rolled_out.step(2)
    copy.unwrapped.restore(rolled_out.unwrapped.snapshot())
    assert copy.unwrapped.pad == "left"
    np.testing.assert_array_equal(ground(copy), ground(rolled_out))
    for _ in range(20):
        (state, reward, *_), (expected, expected_reward, *_) = copy.step(2), rolled_out.step(2)
        np.testing.assert_allclose(state, expected, atol=1e-5)
        assert reward == pytest.approx(expected_reward, abs=1e-2)


def test_another_generator_gives_another_future():
    rolled_out, copy = make().unwrapped, make().unwrapped
    rolled_out.reset(seed=0)
    copy.reset(seed=1)
    before = rolled_out.snapshot()

    def future(noise: np.random.Generator | None) -> Array:
        copy.restore(before, noise)
        return np.array([copy.step(2)[0] for _ in range(20)])

    own = future(None)
    np.testing.assert_allclose(own, future(None), atol=1e-5)
    assert np.abs(own - future(np.random.default_rng(5))).max() > 1e-3
    np.testing.assert_allclose(future(np.random.default_rng(5)), future(np.random.default_rng(5)), atol=1e-5)


def test_a_snapshot_changes_nothing_and_does_not_change():
    rolled_out, untouched = make(), make()
    for env in (rolled_out, untouched):
        env.reset(seed=0)
    before = rolled_out.unwrapped.snapshot()
    bodies = before.bodies.copy()
    for _ in range(30):
        np.testing.assert_array_equal(rolled_out.step(3)[0], untouched.step(3)[0])
        rolled_out.unwrapped.snapshot()
    np.testing.assert_array_equal(before.bodies, bodies)


@pytest.mark.slow
@ENGINES
def test_the_lean_step_equals_gymnasiums_to_the_last_bit(continuous: bool) -> None:
    """A copy that could render goes through gymnasium's own step; whole episodes on all pads, all kinds of end."""
    theirs = make(render_mode="rgb_array", continuous=continuous).unwrapped
    lean = make(continuous=continuous).unwrapped
    random, steady, ends = np.random.default_rng(0), aimed(), set()
    for seed in range(12 if continuous else 24):
        state, _ = theirs.reset(seed=seed)
        np.testing.assert_array_equal(lean.reset(seed=seed)[0], state)
        for _ in range(1000):
            anything = random.uniform(-1.3, 1.3, 2).astype(np.float32) if continuous else int(random.integers(4))
            action = anything if seed % 3 == 0 else steady(theirs, state)
            expected, got = theirs.step(action), lean.step(action)
            np.testing.assert_array_equal(got[0], expected[0])
            assert got[1:] == expected[1:]
            state = expected[0]
            if expected[2]:
                ends.add(expected[1])
                break
    assert ends == {-100.0, 100.0}


def test_throttles_by_hand() -> None:
    """The main engine has at least half of its power when it is on; so have the engines at the sides."""
    for action, powers in {
        (0.0, 0.0): (0, 0),
        (-1.0, 0.5): (0, 0),
        (0.5, -0.6): (0.75, -0.6),
        (7.0, -7.0): (1, -1),
        (1e-3, 0.75): (0.5005, 0.75),
    }.items():
        assert throttles(action) == pytest.approx(powers)


def test_a_copy_is_made_of_what_it_was_made_with() -> None:
    copy = deepcopy(make(pad="left", speed=True)).unwrapped
    copy.reset(seed=1)
    assert (copy.pad, copy.task.instruction_size) == ("left", 2)
