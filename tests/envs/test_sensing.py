"""Observations of any space become a row for the agent and a declared state, and both stay what the game said."""

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces.utils import unflatten
from torchrl.envs.utils import check_env_specs
from walker import KINDS, LIMIT, SIZES, STATEFUL, WORD, Walker, place_and_speed, to_middle, walker, walker_config

from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.given import GivenEnv, make_given
from ibe_rl.envs.instructed_envs import episode_seed, make_vector_env
from ibe_rl.envs.make import make_gym, make_snapshot_env
from ibe_rl.envs.sensing import Sense
from ibe_rl.envs.snapshots import stoppable
from ibe_rl.envs.wrappers import Instructed, task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.task import FLAGS, IMAGE, NUMBERS, PERCEPT, Phrases, Task
from ibe_rl.types import ConfigError, observe


def plain(seen: Any) -> Any:
    """Numbers in lists and dicts, whatever they came in."""
    if isinstance(seen, dict):
        return {key: plain(one) for key, one in seen.items()}
    return [plain(one) for one in seen] if isinstance(seen, tuple) else np.asarray(seen).tolist()


@pytest.mark.parametrize("obs", SIZES)
def test_every_space_becomes_a_state_and_a_percept(obs: str):
    env = walker(obs)
    task = task_of(env)
    assert task.percept_size == SIZES[obs]
    assert task.observation_size == SIZES[obs] + 2
    state, info = env.reset(seed=5)
    for action in (2, 0, 2, 2):
        game = env.unwrapped
        assert (state.shape, state.dtype) == ((2,), np.float32)
        np.testing.assert_array_equal(state, place_and_speed(game, 0).astype(np.float32))
        if obs in STATEFUL:
            again: Any = unflatten(KINDS[obs], info[PERCEPT])
            assert plain(again) == plain(game.seen())
        else:
            assert PERCEPT not in info
        state, _, _, _, info = env.step(action)


def test_parts_are_numbers_flags_and_images():
    def parts(obs: str) -> list[tuple[Any, ...]]:
        return [(part.name, part.kind, part.shape, part.channels_first) for part in task_of(walker(obs)).parts]

    assert parts("dict") == [
        ("goal", NUMBERS, (1,), False),
        ("here", NUMBERS, (2,), False),
        ("way", FLAGS, (2,), False),
    ]
    assert parts("tuple") == [("0", NUMBERS, (2,), False), ("1", FLAGS, (2,), False)]
    assert parts("image") == [("", IMAGE, (6, 8, 3), False)]
    assert parts("channels") == [("", IMAGE, (6, 8, 3), True)]
    assert parts("gray") == [("", IMAGE, (6, 8, 1), False)]
    assert parts("multidiscrete") == [("", FLAGS, (23,), False)]
    assert parts("row") == parts("box") == []


@pytest.mark.parametrize(("obs", "kept"), [("image", np.uint8), ("discrete", np.uint8), ("mixed", np.float32)])
def test_images_and_flags_are_kept_as_bytes(obs: str, kept: type):
    env = walker(obs)
    assert task_of(env).percept_type is env.reset(seed=0)[1][PERCEPT].dtype.type is kept


def test_a_state_that_is_declared_beside_a_row_is_explained_and_the_row_is_read():
    env = walker("box", state="walker:place_and_speed")
    state, info = env.reset(seed=0)
    np.testing.assert_allclose(info[PERCEPT], state, rtol=1e-6)
    assert [part.kind for part in task_of(env).parts] == [NUMBERS]


def test_the_agent_reads_the_keys_that_are_named():
    env = walker("dict", observes=["way", "here"])
    assert [part.name for part in task_of(env).parts] == ["way", "here"]
    assert env.reset(seed=0)[1][PERCEPT].shape == (4,)
    assert task_of(walker("words", observes=["here"])).percept_size == 2


@pytest.mark.parametrize(
    ("obs", "changes", "refusal"),
    [
        (
            "dict",
            {"state": None},
            r"env\.task\.state=null with env\.id=Walker-v0: it observes Dict.* allowed is module:",
        ),
        ("image", {"state": None}, r"env\.task\.state=null .* it observes Box\(0, 255, \(6, 8, 3\), uint8\)"),
        ("words", {}, r"it observes mission: Text.* allowed are Box.* or env\.task\.observes=\[here\]"),
        ("dict", {"observes": ["hear"]}, r"env\.task\.observes=\['hear'\].*: hear is no key .* are goal, here, way"),
        ("tuple", {"observes": ["a"]}, r"env\.task\.observes=\['a'\].* allowed are none, as it is no Dict"),
        ("dict", {"state": "walker:a_table"}, r"env\.task\.state .* shape \(1, 2\); allowed is one row of numbers$"),
        ("dict", {"state": "walker:fails"}, r"env\.task\.state .*: it raised KeyError: 'nowhere'"),
        ("dict", {"state": "walker:nowhere"}, r"env\.task\.state=walker:nowhere"),
        ("dict", {"state_names": ["x"]}, r"env\.task\.state_names=\['x'\]: allowed are 2 different names"),
    ],
)
def test_what_cannot_be_read_is_refused(obs: str, changes: dict[str, Any], refusal: str):
    with pytest.raises(ConfigError, match=refusal):
        walker(obs, **changes)


def test_a_state_of_another_length_is_refused_when_it_comes():
    env = Walker("dict")
    env.reset(seed=0)
    sense = Sense(env, lambda game, _: np.zeros(game.place + 1))
    env.place = 1
    sense(env, env.seen())
    env.place = 4
    with pytest.raises(ConfigError, match=r"of shape \(5,\); allowed is one row of numbers, 2 of them as before"):
        sense(env, env.seen())


def own_task(**changes: Any) -> Task:
    said = Phrases("staying", "left", "right", [(0.2, "")])
    settings: dict[str, Any] = {"state_names": ("x", "v"), "state_units": ("", ""), "rule": to_middle}
    settings |= {"instruction_values": (-1.0, 0.0, 1.0), "phrases": (said,), "context": lambda _: "any"}
    settings |= {"contexts": ("any",), "context_option": "", "success_key": "success", "explained": (0,)}
    settings |= {"explained_band": (0.1,), "max_episode_steps": LIMIT}
    return Task(name="Walker", **settings | changes)


def test_a_task_of_an_environment_may_have_a_state_too():
    given = GivenEnv("walker", {"obs": "image"}, given=True)
    given.maker, given.declared, given.token = Walker, own_task(state=place_and_speed), "t"
    env = make_given(given)
    assert env.task.percept_size == 144
    assert env.reset(seed=0)[1][PERCEPT].dtype == np.uint8
    given.declared = own_task()
    with pytest.raises(ConfigError, match=r"env\.task\.state=null with env\.id=Walker: it observes Box"):
        make_given(given)


def test_the_wrapper_for_other_libraries_wants_an_observed_state():
    game: Any = Walker("dict")
    game.task = own_task(state=place_and_speed)
    with pytest.raises(ConfigError, match="its task makes a state of the observation; allowed is one that observes it"):
        Instructed(game)


@pytest.mark.parametrize("obs", SIZES)
def test_many_together_say_what_each_says_alone(obs: str):
    rows, seed = 3, 40
    envs, one = [walker(obs) for _ in range(rows)], walker(obs)
    task = task_of(one)
    torch.manual_seed(0)
    rolled = make_vector_env(envs, make_instructor(InstructorConfig("oracle"), task), seed).rollout(LIMIT)
    state, info = one.reset(seed=episode_seed(seed + 1, 0))
    for step in rolled[1]:
        percept = info.get(PERCEPT, state)
        np.testing.assert_array_equal(step["state"], state)
        np.testing.assert_array_equal(step["observation"], observe(percept, task.rule(state), np.ones(1)))
        assert ("percept" in step.keys()) == (obs in STATEFUL)  # noqa: SIM118 - a TensorDict
        if obs in STATEFUL:
            np.testing.assert_array_equal(step["percept"], percept)
        state, _, _, _, info = one.step(int(step["action"]))
        np.testing.assert_array_equal(step["next", "state"], state)
        np.testing.assert_array_equal(step["next", "observation"][:-2], info.get(PERCEPT, state))
    check_env_specs(make_vector_env([walker(obs)], make_instructor(InstructorConfig("oracle"), task), seed))


@pytest.mark.parametrize("obs", SIZES)
def test_a_copy_gives_states_and_percepts_as_the_original(obs: str):
    env, copy = walker(obs), make_snapshot_env(walker_config(obs))
    game: Any = stoppable(env)
    env.reset(seed=1)
    copy.reset(seed=2)
    copy.unwrapped.restore(game.snapshot())
    for action in (2, 2, 0, 1, 2):
        state, _, _, _, info = env.step(action)
        same, _, _, _, also = copy.step(action)
        np.testing.assert_array_equal(state, same)
        np.testing.assert_array_equal(info.get(PERCEPT, state), also.get(PERCEPT, same))


def test_spaces_that_nobody_knows_are_named_where_no_key_helps():
    class Graph(Walker):
        observation_space = WORD

        def __init__(self) -> None:
            pass

    with pytest.raises(ConfigError, match=r"env\.id=Graph: it observes Text.*; allowed are Box, Discrete.* of these$"):
        Sense(Graph(), place_and_speed)


def test_a_row_needs_no_function():
    env = make_gym("CartPole-v1", {}, walker_config("box", state_names=["x", "v", "a", "w"]).task)
    assert env.sense.as_it_is
    assert task_of(env).parts == ()
