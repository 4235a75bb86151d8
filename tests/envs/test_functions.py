"""Functions of a task get copies, and their answers are checked at every call."""

import pickle
from functools import partial
from typing import Any

import numpy as np
import pytest
from awkward import Lift, behind_gate, lift_task, up_or_down

from ibe_rl.envs.errors import GateError
from ibe_rl.envs.functions import checked_success, name_of, with_checks

STATES = np.array([[0.5, 0], [-0.5, 0], [0, 0]], np.float32)


def checked(**functions: Any) -> Any:
    return with_checks(lift_task(**functions), {}, "task")


def spoils(states: np.ndarray) -> np.ndarray:
    said = up_or_down(states)
    states[:] = 78.8
    return said


def fails_below(states: np.ndarray) -> np.ndarray:
    if (states[..., 0] < 0).any():
        raise ValueError("below")
    return up_or_down(states)


def test_a_function_that_writes_into_its_argument_spoils_nothing():
    states = STATES.copy()
    assert checked(rule=spoils).rule(states).ravel().tolist() == [-1, 1, 0]
    np.testing.assert_array_equal(states, STATES)


def test_an_error_names_the_function_the_line_and_the_state():
    with pytest.raises(
        GateError, match=r"task\.rule=.*fails_below: it raised ValueError: below \(.*, line \d+"
    ) as caught:
        checked(rule=fails_below).rule(STATES)
    np.testing.assert_array_equal(caught.value.state, STATES[1])


def test_an_error_only_of_all_states_together_has_the_first():
    def together(states: np.ndarray) -> np.ndarray:
        return up_or_down(states) if len(states) == 1 else 1 / 0

    with pytest.raises(GateError, match="ZeroDivisionError") as caught:
        checked(rule=together).rule(STATES)
    np.testing.assert_array_equal(caught.value.state, STATES[0])


WRONG = {
    "half": (
        "rule",
        lambda s: up_or_down(s) / 2,
        r"returned \[-0\.5\] for the state \[0\.5, 0\.0\]; allowed is -1, 0, 1",
    ),
    "nan": ("rule", lambda s: up_or_down(s) * np.nan, r"returned \[nan\]"),
    "far": ("rule", lambda s: up_or_down(s) * 7, r"returned \[-7\.0\]"),
    "shape": (
        "rule",
        lambda s: up_or_down(s)[..., 0],
        r"for 3 states it gave an array of shape \(3,\); allowed is \(3, 1\)",
    ),
    "words": ("rule", lambda _: "up", r"returned 'up' for the state .*; allowed is numbers"),
    "motion": (
        "motion",
        lambda s: s[..., :1] * np.inf,
        r"returned \[inf\] for the state .*; allowed is finite numbers",
    ),
    "goal": ("goal_offset", lambda s: s, r"shape \(3, 2\); allowed is \(3, 1\)"),
    "path": ("scene_path", lambda s: s[..., :1], r"shape \(3, 1\); allowed is \(3, 2\)"),
    "contact": ("first_contact", len, r"returned 3 for the state .*; allowed is a step from 0 to 2"),
}


@pytest.mark.parametrize(("name", "function", "reason"), WRONG.values(), ids=WRONG)
def test_answers_that_cannot_be_used_are_refused(name: str, function: Any, reason: str):
    with pytest.raises(GateError, match=reason):
        getattr(checked(**{name: function}), name)(STATES)


def test_answers_that_can_be_used_pass():
    task = checked(motion=lambda s: s[..., 1:], scene_path=lambda s: s, first_contact=lambda _: np.int64(1))
    assert (task.context(STATES[0]), task.first_contact(STATES)) == ("above", 1)
    assert task.motion(STATES).shape == (3, 1)
    assert task.scene_path(STATES[0]).shape == (2,)
    near = with_checks(lift_task(rule=lambda s: s[..., :1], instruction_values=(-0.3, 0.3)), {}, "task")
    assert near.rule(np.array([[0.3000001, 0.0]])).shape == (1, 1)


@pytest.mark.parametrize("answer", [1.0, np.array([True]), np.bool_(True), True])
def test_a_success_is_a_bool(answer: Any):
    env = behind_gate(success=checked_success(lambda *_: answer, "mine:won", lift_task()))
    env.reset(seed=0)
    assert env.step(1)[4]["success"] is True


def test_a_success_that_is_none_is_refused_with_its_place():
    env = behind_gate(success=checked_success(lambda *_: "yes", "mine:won", lift_task()))
    env.reset(seed=0)
    with pytest.raises(
        GateError, match=r"seed 0, step 1: env\.task\.success=mine:won: it returned 'yes' for the state"
    ):
        env.step(1)
    assert checked_success(None, None, lift_task()) is None


def test_a_checked_task_can_be_sent_and_is_not_checked_twice():
    task = with_checks(lift_task(context=context), {"rule": "rules:mine"}, "env.task")
    assert pickle.loads(pickle.dumps(task)).rule(STATES).ravel().tolist() == [-1, 1, 0]  # noqa: S301 - our own
    assert task.rule.label == "env.task.rule=rules:mine"
    assert with_checks(task, {}, "task").rule is task.rule


def context(_: np.ndarray) -> str:
    return "above"


def test_functions_are_called_by_their_own_names():
    assert name_of(partial(partial(up_or_down))) == "awkward.up_or_down"
    assert name_of(Lift()) == "awkward.Lift"
