"""What an environment gives is copied, converted where that is harmless, and else refused in one line."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from awkward import STEPS, Lift, SameBuffer, behind_gate
from gymnasium import spaces

from ibe_rl.collect.rollout import play
from ibe_rl.envs.conversions import UnfitError, taken
from ibe_rl.envs.errors import GateError, located
from ibe_rl.envs.gate import gate_of
from ibe_rl.envs.wrappers import drawn, task_of
from ibe_rl.instructors.oracle import Oracle


def put(index: int, value: Any, at: int = 3) -> Any:
    """A change of one entry of a step."""

    def change(step: int, given: list[Any]) -> Any:
        if step == at:
            given[index] = value
        return tuple(given)

    return change


def after(change: Any, steps: int = 3) -> Any:
    env = behind_gate(change)
    env.reset(seed=7)
    return [env.step(1) for _ in range(steps)][-1]


REFUSED = {
    "nan": (0, np.array([0, np.nan], np.float32), r"speed \(observation\[1\]\) is nan; allowed are finite numbers"),
    "infinite": (0, np.array([np.inf, 0], np.float32), r"height \(observation\[0\]\) is inf"),
    "shape": (
        0,
        np.zeros(3, np.float32),
        r"observation has the shape \(3,\); allowed are float32 numbers of shape \(2,\)",
    ),
    "words": (0, ["a", "b"], r"observation is \['a', 'b'\]; allowed are"),
    "ragged": (0, [[1], [1, 2]], r"observation is \[\[1\], \[1, 2\]\]; allowed are"),
    "no reward": (1, None, r"the reward is None; allowed is one finite number"),
    "two rewards": (1, [1, 2], r"the reward is \[1, 2\]"),
    "ragged rewards": (1, [[1], [1, 2]], r"the reward is \[\[1\], \[1, 2\]\]"),
    "infinite reward": (1, -np.inf, r"the reward is -inf"),
    "end": (2, "no", r"terminated is 'no'; allowed is True or False"),
    "limit": (3, 0.5, r"truncated is 0\.5"),
    "no info": (4, None, r"info is None; allowed is a dict"),
    "success": (4, {"arrived": "yes"}, r"info\['arrived'\] is 'yes'; allowed is True or False"),
    "half a success": (4, {"arrived": 0.3}, r"info\['arrived'\] is 0\.3"),
}


@pytest.mark.parametrize(("index", "value", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_used_is_refused_with_its_place(index: int, value: Any, reason: str):
    with pytest.raises(GateError, match=r"^env\.id=lift, episode of seed 7, step 3: " + reason):
        after(put(index, value))


HARMLESS = {
    "list": (0, [0.5, 0.25], np.array([0.5, 0.25], np.float32)),
    "double": (0, np.array([0.5, 0.25]), np.array([0.5, 0.25], np.float32)),
    "reward in an array": (1, np.array([2]), 2.0),
    "whole reward": (1, 2, 2.0),
    "end as a number": (2, 1.0, True),
    "end of numpy": (3, np.bool_(True), True),
    "success as a number": (4, {"arrived": 1.0}, {"arrived": True}),
    "success in an array": (4, {"arrived": np.array([False])}, {"arrived": False}),
    "no success": (4, {}, {"arrived": False}),
}


@pytest.mark.parametrize(("index", "value", "taken_as"), HARMLESS.values(), ids=HARMLESS)
def test_harmless_differences_are_converted(index: int, value: Any, taken_as: Any):
    found = after(put(index, value))[index]
    assert type(found) is type(taken_as)
    np.testing.assert_equal(found, taken_as)


@pytest.mark.parametrize("given", [(1, 2, 3, 4), 5])
def test_a_step_of_another_interface_is_refused(given: Any):
    with pytest.raises(GateError, match=r"what step\(\) gave is .*; allowed is observation, reward, terminated"):
        after(lambda *_: given)


class Resets(Lift):
    """Its ``reset`` gives or raises what it is told."""

    given: Any = None

    def reset(self, **_: Any) -> Any:
        if isinstance(self.given, Exception):
            raise self.given
        return self.given


RESETS = {
    "alone": (np.zeros(2), r"what reset\(\) gave is array.*; allowed is an observation and an info"),
    "info": ((np.zeros(2), 3), r"info is 3; allowed is a dict"),
    "raises": (KeyError("door"), r"its reset\(\) raised KeyError: 'door' \(.*test_gate\.py, line \d+, in reset\)"),
    "nan": ((np.full(2, np.nan), {}), r"height \(observation\[0\]\) is nan"),
}


@pytest.mark.parametrize(("given", "reason"), RESETS.values(), ids=RESETS)
def test_a_reset_is_checked(given: Any, reason: str):
    env = Resets()
    env.given = given
    with pytest.raises(GateError, match=r"^env\.id=lift, episode of seed 2, reset: " + reason):
        behind_gate(env=env).reset(seed=2)


def test_what_a_step_raises_is_shown_as_the_users_own():
    def breaks(step: int, given: list[Any]) -> Any:
        return tuple(given) if step < 3 else given[0].no_such_thing

    reason = r"step 3: its step\(\) raised AttributeError: .*no_such_thing.* \(.*test_gate\.py, line \d+, in breaks\)"
    with pytest.raises(GateError, match=reason) as caught:
        after(breaks)
    assert caught.value.__suppress_context__


def test_an_observation_that_is_handed_out_again_is_copied():
    env = behind_gate(env=SameBuffer())
    states = [env.reset(seed=1)[0], *(env.step(2)[0] for _ in range(3))]
    heights = np.array(states)[:, 0]
    np.testing.assert_allclose(np.diff(heights), 0.1, rtol=1e-5)


def test_the_time_limit_is_kept_and_shown_in_the_spec():
    env = behind_gate()
    env.reset(seed=0)
    assert [env.step(1)[3] for _ in range(STEPS)] == [False] * (STEPS - 1) + [True]
    made = gymnasium.make("CartPole-v1", max_episode_steps=7)
    assert behind_gate(env=made).unwrapped is made.unwrapped


@pytest.mark.parametrize("info", [{}, {"arived": True}])
def test_it_counts_infos_without_the_key_of_success(info: dict[str, Any]):
    env = behind_gate(lambda _, given: (*given[:4], info))
    gate = gate_of(env)
    assert gate is not None
    assert not gate.never_succeeds()
    env.reset(seed=0)
    env.step(1)
    assert (gate.never_succeeds(), gate.keys_seen) == (True, set(info))
    gate.env.unwrapped.change = None  # from now on the key comes
    env.step(1)
    assert not gate.never_succeeds()
    assert gate_of(Lift()) is None


def test_an_unknown_context_is_refused_where_the_episode_begins():
    env = behind_gate(context=lambda _: "beside")
    with pytest.raises(
        GateError, match=r"^env\.id=lift, episode of seed 4, reset: task\.context=.*'beside' for the state"
    ):
        env.reset(seed=4)


def test_a_drawing_that_raises_is_the_users_own():
    env = behind_gate()
    env.unwrapped.figure = lambda: 1 / 0
    with pytest.raises(GateError, match=r"its figure\(\) raised ZeroDivisionError"):
        drawn(env, "figure")


def test_an_error_of_a_function_is_located_by_its_state():
    envs = [behind_gate(), behind_gate()]
    states = [env.reset(seed=seed)[0] for seed, env in enumerate(envs)]
    found = located(GateError("it fails", states[1]), envs, states)
    assert str(found) == "env.id=lift, episode of seed 1, reset: it fails"
    lost = GateError("it fails", np.zeros(2))
    assert located(lost, envs, states) is lost


def test_the_rule_fails_in_the_episode_in_which_it_fails():
    def late(states: np.ndarray) -> np.ndarray:
        return np.where(states[:, :1] > 1.05, np.nan, 0.0)

    env = behind_gate(rule=late)
    with pytest.raises(
        GateError, match=r"^env\.id=lift, episode of seed \d, step \d+: task\.rule=.*late: it returned \[nan\]"
    ):
        play([env], lambda seen: np.full(len(seen), 2), Oracle(task_of(env).rule), range(9))


KINDS = {
    "dict": (spaces.Dict(a=spaces.Discrete(3), b=spaces.Box(0, 1, (1,))), {"a": np.int64(2), "b": [0.5], "c": 0}),
    "tuple": (spaces.Tuple([spaces.MultiDiscrete([3, 2]), spaces.MultiBinary(2)]), ([2, 1], (0, 1))),
    "image": (spaces.Box(0, 255, (2, 2, 1), np.uint8), np.full((2, 2, 1), 9)),
}


@pytest.mark.parametrize(("space", "value"), KINDS.values(), ids=KINDS)
def test_observations_of_any_kind_are_taken_in_the_types_of_their_space(space: Any, value: Any):
    assert space.contains(taken(space, value, "observation"))


UNFIT = {
    "no dict": (KINDS["dict"][0], 3, "observation is 3; allowed is a dict with a, b"),
    "key": (KINDS["dict"][0], {"a": 1}, "allowed is a dict with a, b"),
    "inner": (KINDS["dict"][0], {"a": 1, "b": [np.nan]}, r"observation\['b'\]\[0\] is nan"),
    "tuple": (KINDS["tuple"][0], ([2, 1],), "allowed is a tuple of 2"),
    "choice": (KINDS["tuple"][0], ([5, 1], (0, 1)), r"observation\[0\] is \[5, 1\]; allowed is one of MultiDiscrete"),
    "fraction": (KINDS["image"][0], np.full((2, 2, 1), 0.5), "allowed are uint8 numbers"),
}


@pytest.mark.parametrize(("space", "value", "reason"), UNFIT.values(), ids=UNFIT)
def test_observations_that_do_not_fit_are_refused(space: Any, value: Any, reason: str):
    with pytest.raises(UnfitError, match=reason):
        taken(space, value, "observation")
