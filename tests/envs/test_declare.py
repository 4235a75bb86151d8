"""What a config declares is what the rest of the program reads; what cannot be is refused by name, at once."""

import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from omegaconf import OmegaConf
from rules import WORDS, declared

from ibe_rl.config.settings import EnvConfig
from ibe_rl.config.task_parts import MirrorConfig, PhrasesConfig
from ibe_rl.envs.declare import declare, load_function
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.envs.make import make_env, make_gym
from ibe_rl.envs.wrappers import Declared, drawn, task_of
from ibe_rl.ibe import phrase
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import ConfigError


def cart_pole(**changes: Any) -> Any:
    return make_gym("CartPole-v1", {}, declared(**changes))


def test_what_is_declared_is_the_task():
    names, units = ["x", "vx", "angle", "turn"], ["m", "m/s", "rad", "rad/s"]
    task = task_of(cart_pole(state_names=names, state_units=units, explained=["angle"], explained_band=[0.2]))
    assert (task.name, task.state_names, task.state_units) == ("Cart-pole", tuple(names), tuple(units))
    assert (task.explained, task.explained_band, task.instruction_size) == ((2,), (0.2,), 1)
    assert (task.instruction_values, task.max_episode_steps) == ((-1.0, 0.0, 1.0), 500)
    assert task.rule(np.array([[2.0, 0, 0, 0], [-2.0, 0, 0, 0]])).tolist() == [[-1], [1]]
    said = [phrase(np.array([value]), task.phrases) for value in (0.1, -0.3, 0.9)]
    assert said == ["standing", "going slightly left", "going right"]
    assert (task.contexts, task.context(np.zeros(4))) == (("any",), "any")


def test_what_is_not_declared_has_a_name_all_the_same():
    assert task_of(cart_pole()).state_names == ("state_0", "state_1", "state_2", "state_3")
    assert task_of(cart_pole()).state_units == ("", "", "", "")


def test_a_rule_may_be_a_class_and_an_instruction_several_numbers():
    assert task_of(cart_pole(rule="rules:GoTo")).rule(np.full((1, 4), -3.0)).tolist() == [[1]]
    two = {"rule": "rules:both", "phrases": [WORDS, WORDS], "explained": ["state_0", "state_2"]}
    task = task_of(cart_pole(**two, explained_band=[0.1, 0.2]))
    assert (task.instruction_size, task.explained, task.explained_band) == (2, (0, 2), (0.1, 0.2))


def played(env: Any, steps: int) -> tuple[Any, ...]:
    env.reset(seed=0)
    return [env.step(number % 2) for number in range(steps)][-1]


def test_success_is_what_the_rule_says():
    env = cart_pole(success="rules:stood", max_episode_steps=20)
    assert (task_of(env).judges_success, task_of(env).max_episode_steps) == (True, 20)
    state, reward, terminated, truncated, info = played(env, 20)
    assert (state.dtype, reward, terminated, truncated, info["success"]) == (np.float32, 1.0, False, True, True)
    assert played(env, 19)[4]["success"] is False


def test_nobody_may_say_what_success_is():
    env = cart_pole()
    assert not task_of(env).judges_success
    assert played(env, 9)[4]["success"] is False


def test_the_environment_may_say_itself_what_success_is():
    class Says(gymnasium.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            state, reward, terminated, truncated, _ = self.env.step(action)
            return state, reward, terminated, truncated, {"solved": True}

    env = declare(Says(gymnasium.make("CartPole-v1")), declared(success_key="solved"))
    assert (task_of(env).success_key, task_of(env).judges_success) == ("solved", True)
    assert played(env, 1)[4]["solved"] is True
    assert env.reset(seed=0)[1]["solved"] is False


def test_a_context_names_the_episode():
    task = task_of(cart_pole(context="rules:side", contexts=["left", "right"]))
    assert (task.context(np.full(4, -1.0)), task.contexts) == ("left", ("left", "right"))


def test_a_mirror_image_may_be_declared():
    mirrored = MirrorConfig(["state_0", "state_1", "state_2", "state_3"], actions=[1, 0])
    found = task_of(cart_pole(mirror=mirrored)).mirror
    assert found == Mirror(("state_0", "state_1", "state_2", "state_3"), actions=(1, 0))
    assert task_of(cart_pole()).mirror is None


def test_what_can_be_drawn_is_drawn():
    env = cart_pole(figure="rules:dot")
    env.reset(seed=0)
    assert drawn(env, "figure")[0].points[0, 0] == env.unwrapped.state[0]
    assert drawn(env, "background") == []


def test_states_of_64_bits_are_handed_on_as_32():
    env = make_gym("Pendulum-v1", {}, declared(explained=["state_0"]))
    assert isinstance(env, Declared)
    assert env.reset(seed=0)[0].dtype == env.observation_space.dtype == np.float32


def test_many_of_them_step_together():
    settings = EnvConfig("CartPole-v1", {}, declared(success="rules:stood"))
    games = [make_env(settings) for _ in range(3)]
    batch = make_vector_env(games, Oracle(task_of(games[0]).rule), seed=0).rollout(30, break_when_any_done=False)
    assert batch["observation"].shape == (3, 30, 6)
    assert batch["next", "done"].any()


def test_a_module_may_register_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "my_games.py").write_text(
        "import gymnasium\ngymnasium.register('Mine-v0', 'gymnasium.envs.classic_control:CartPoleEnv')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match=r"env\.task\.max_episode_steps=None: Mine-v0 is registered without a time"):
        make_gym("my_games:Mine-v0", {}, declared())
    assert task_of(make_gym("my_games:Mine-v0", {}, declared(max_episode_steps=7))).max_episode_steps == 7


def test_a_module_lies_where_the_program_was_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "lies_here.py").write_text("def rule(states): return states\n")
    monkeypatch.chdir(tmp_path)
    assert load_function("env.task.rule", "lies_here:rule")(4) == 4


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "module": ({"rule": "nowhere:rule"}, r"rule=nowhere:rule: allowed is module:function or module:class \(ModuleNot"),
    "function": ({"rule": "rules:none"}, r"rule=rules:none: allowed is module:function .*AttributeError"),
    "no function": ({"rule": "rules:NO_FUNCTION"}, r"allowed is what can be called, this is int"),
    "shape": ({"rule": "rules:flat"}, r"rule=.*flat: for 2 states it gave .* shape \(2,\); allowed is \(2, 1\)"),
    "range": (
        {"rule": "rules:too_loud"},
        r"rule=.*too_loud: it returned \[7\.0\] for the state .*; allowed is -1, 0, 1",
    ),
    "error": ({"rule": "rules:fails"}, r"rule=rules:fails: it raised IndexError: no such column"),
    "explained": ({"explained": ["x"]}, r"explained=\['x'\]: allowed are 1 of state_0, .*, one for each entry"),
    "too many": ({"explained": ["state_0", "state_1"]}, r"explained=.*: allowed are 1 of"),
    "band": ({"explained_band": [0.0]}, r"explained_band=\[0\.0\]: allowed are 1 numbers above 0"),
    "bands": ({"explained_band": []}, r"explained_band=\[\]: allowed are 1 numbers above 0"),
    "reach": ({"explained_range": [-1.0]}, r"explained_range=\[-1\.0\]: allowed are 1 numbers above 0"),
    "names": ({"state_names": ["x"]}, r"state_names=\['x'\]: allowed are 4 different names"),
    "mirrored name": (
        {"mirror": MirrorConfig(["nothing"])},
        r"mirror=\{'flipped': \['nothing'\].*\}: Task.mirror: nothing: allowed are state_0, state_1, state_2, state_3",
    ),
    "mirrored pair": (
        {"mirror": MirrorConfig([], [["state_0"]])},
        r"mirror\.swapped=\[\['state_0'\]\]: allowed are pairs",
    ),
    "twice": ({"state_names": ["x", "x", "y", "z"]}, r"state_names=.*: allowed are 4 different names"),
    "units": ({"state_units": ["m"]}, r"state_units=\['m'\]: allowed are 4 names"),
    "context": ({"context": "rules:side"}, r"context=rules:side with .*contexts=\[\]: allowed is both"),
    "contexts": (
        {"context": "rules:side", "contexts": ["up"]},
        r"context=rules:side: it returned '(left|right)' for the state .*; allowed is one of up",
    ),
    "degrees": (
        {"phrases": [PhrasesConfig("a", "b", "c", {"very": 0.5, "": 0.2})]},
        r"phrases: degrees=\(\(0\.5, 'very '\), \(0\.2, ''\)\): allowed are pairs .* with rising limits",
    ),
    "braces": ({"phrases": [PhrasesConfig("a", "b {much}", "c")]}, r"phrases: phrase 'b \{much\}': allowed in braces"),
}


@pytest.mark.parametrize(("changes", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_is_refused(changes: dict[str, Any], reason: str):
    with pytest.raises(ConfigError, match=r"env\.task\.") as caught:
        cart_pole(**changes)
    assert caught.match(reason)


FEW_DEGREES = {"degrees": {"": 0.3}}


def test_degrees_of_a_file_take_the_place_of_the_default_ones():
    own = {"zero": "a", "negative": "{degree}b", "positive": "{degree}c"}
    default, given = (OmegaConf.to_object(OmegaConf.merge(PhrasesConfig, own | more)) for more in ({}, FEW_DEGREES))
    words = [task_of(cart_pole(phrases=[one])).phrases[0] for one in (default, given)]
    assert words[0].degrees == ((0.3, "slightly "), (0.4, "moderately "), (0.9, ""))
    assert words[1].degrees == ((0.3, ""),)


def test_states_that_are_no_row_of_numbers_are_refused():
    refusal = r"env\.task\.state=null with env\.id=FrozenLake-v1: it observes Discrete.* allowed is module:name"
    with pytest.raises(ConfigError, match=refusal):
        make_gym("FrozenLake-v1", {}, declared())


def test_a_module_that_does_not_import_is_refused():
    with pytest.raises(ConfigError, match=r"env\.id=nowhere:Mine-v0: nowhere cannot be imported"):
        make_gym("nowhere:Mine-v0", {}, declared())


def test_what_an_extra_installs_names_the_extra(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "minigrid", None)
    with pytest.raises(ConfigError, match=r"minigrid cannot be imported .*; install the extra ibe_rl\[environments\]$"):
        make_gym("minigrid:Any-v0", {}, declared())


def test_a_module_may_lie_where_the_program_was_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    entry = "gymnasium.envs.classic_control:CartPoleEnv"
    (tmp_path / "registers_here.py").write_text(f"import gymnasium\ngymnasium.register('HereCart-v0', '{entry}')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert make_gym("registers_here:HereCart-v0", {}, declared(max_episode_steps=9)).observation_space.shape == (4,)
