"""What an agent's training put before its observations is taken from the agent, a setting or not at all."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bead import BEAD_ID, BEAD_TASK, to_zero
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.api.explained import explain_agent, open_run
from ibe_rl.apps.external import finding
from ibe_rl.apps.external.finding import find_agent, load_statistics
from ibe_rl.apps.external.policy import as_policy
from ibe_rl.apps.external.reading import Reading, compared_returns, forgotten, reading_of
from ibe_rl.config.command_line import composed
from ibe_rl.envs.make import make_gym
from ibe_rl.types import ConfigError, observe

QUICK = ["mapping.horizon_steps=5", "mapping.spans_steps=[3]", "predictor.futures=1", "viewer=off"]


def bead() -> Any:
    return make_gym(BEAD_ID, {"masked": False})


def model_in(wrapped: Any) -> Any:
    """A model with a few updates, in an environment whose statistics are not 0 and 1."""
    return PPO("MlpPolicy", wrapped, n_steps=64, seed=0, policy_kwargs={"net_arch": [8]}, device="cpu").learn(256)


@pytest.mark.parametrize("inner", [VecNormalize, VecFrameStack])
def test_it_acts_as_behind_its_own_wrappers(inner: Any, tmp_path: Path) -> None:
    """Step for step as the library's own wrappers, from the model itself and from its two files."""
    plain = DummyVecEnv([bead])
    wrapped: Any
    wrapped = VecFrameStack(VecNormalize(plain), 3) if inner is VecNormalize else VecNormalize(VecFrameStack(plain, 3))
    model = model_in(wrapped)
    statistics = wrapped.venv if inner is VecNormalize else wrapped
    model.save(tmp_path / "model.zip")
    statistics.save(str(tmp_path / "norm.pkl"))
    settings = composed("explain", [f"agent_vec_normalize={tmp_path / 'norm.pkl'}", "agent_frame_stack=3"])
    loaded = find_agent(str(tmp_path / "model.zip"))
    readings = [(model, reading_of(model, composed("explain", []))), (loaded, reading_of(loaded, settings))]
    statistics.training = False
    for agent, reading in readings:
        env = bead()
        states = np.array([env.reset(seed=seed)[0] for seed in range(5)])
        policy = as_policy(
            agent, BEAD_TASK, env.action_space, reading, observe(states, to_zero(states), np.ones((5, 1)))
        )
        memories: Any = [None]
        seen = wrapped.reset()
        for _ in range(8):
            state = plain.envs[0].unwrapped._seen()
            actions, memories = policy.act_with_memory(observe(state, [0], [1])[None], memories, None)
            expected = model.predict(seen, deterministic=True)[0]
            np.testing.assert_array_equal(actions, expected)
            seen = wrapped.step(expected)[0]


def test_a_folder_never_names_the_file_and_says_that_it_is_missing(tmp_path: Path, monkeypatch: Any) -> None:
    wrapped = VecNormalize(DummyVecEnv([bead]))
    model_in(wrapped).save(tmp_path / "model.zip")
    wrapped.save(str(tmp_path / "norm.pkl"))
    settings = [*QUICK, f"agent_vec_normalize={tmp_path / 'norm.pkl'}", "mapping.top_fraction=1"]
    made = explain_agent(str(tmp_path / "model.zip"), bead, episodes=12, run_dir=tmp_path / "run", settings=settings)
    assert made.run.config.agent.vec_normalize == str(tmp_path / "norm.pkl")
    assert open_run(tmp_path / "run", str(tmp_path / "model.zip"), settings[:-1], env=bead).run.policy is not None
    monkeypatch.setattr(finding.pickle, "loads", lambda _: pytest.fail("a folder made it load"))
    with pytest.raises(
        ConfigError, match=r"agent_vec_normalize=null: this folder's agent read .* by .*norm.pkl; allowed"
    ):
        open_run(tmp_path / "run", str(tmp_path / "model.zip"), QUICK, env=bead)


def test_settings_go_before_the_folder_and_the_folder_before_the_agent() -> None:
    cfg, known = composed("explain", []), ExternalPolicyConfig(frame_stack=4, sees_instruction=True)
    agent = SimpleNamespace(env=VecFrameStack(DummyVecEnv([bead]), 2))
    assert reading_of(agent, cfg) == Reading(None, 2)
    assert reading_of(agent, cfg, known) == Reading(True, 4)
    asked = composed("explain", ["agent_frame_stack=5", "agent_sees_instruction=false"])
    assert reading_of(agent, asked, known) == Reading(False, 5)


def test_what_holds_no_statistics_is_refused(tmp_path: Path) -> None:
    for name, content in (("text", b"text"), ("dict", pickle.dumps({})), ("module", b"cno_such_module\nnothing\n.")):
        (tmp_path / name).write_bytes(content)
    for name, why in (
        ("missing", "it cannot be read .FileNotFoundError"),
        ("text", "it cannot be read"),
        ("dict", r"it holds dict; allowed is what VecNormalize.save\(\) wrote"),
        ("module", r"No module named 'no_such_module'; install the extra ibe_rl\[sb3\]"),
    ):
        with pytest.raises(ConfigError, match=rf"agent_vec_normalize=.*{name}: {why}"):
            load_statistics(str(tmp_path / name))
    rewards = VecNormalize(DummyVecEnv([bead]), norm_obs=False)
    assert finding.statistics_of(rewards) is None


def test_statistics_beside_a_model_are_pointed_out(tmp_path: Path) -> None:
    assert forgotten(tmp_path / "model.zip", Reading()) == []
    (tmp_path / "vecnormalize.pkl").touch()
    (line,) = forgotten(tmp_path / "model.zip", Reading())
    assert line.endswith(f"name it: agent_vec_normalize={tmp_path / 'vecnormalize.pkl'}")
    assert forgotten("module:agent", Reading()) == []


def test_returns_far_below_those_of_its_own_training_are_pointed_out() -> None:
    def lines(here: list[float], there: list[float]) -> list[str]:
        agent = SimpleNamespace(ep_info_buffer=[{"r": one} for one in there])
        return compared_returns(agent, [SimpleNamespace(total_reward=one) for one in here])

    assert lines([100, 120], [110.0] * 5 + [130.0] * 5) == []
    assert lines([-50], [110.0] * 4) == []
    (line,) = lines([-50, -70], [110.0] * 5 + [130.0] * 5)
    assert "return -60.0 on average here, and returned 120.0 at the end" in line
    assert compared_returns(len, []) == []
