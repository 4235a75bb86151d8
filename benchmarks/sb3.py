"""The other side: Stable-Baselines3 with the settings of rl-zoo3 for the Lunar Lander; runs in child processes.

It reads the same observation as our agents (state, instruction, whether it was given) and is judged by the same
function on the same seeds.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

from benchmarks.levels import Point, reached
from ibe_rl.collect.rollout import EVALUATION_SEED, play
from ibe_rl.collect.schedule import Schedule
from ibe_rl.config.settings import AgentConfig, InstructorConfig
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.types import Array, observe

ZOO_ENVS = {"ppo": 16, "dqn": 1}
ZOO_PPO: dict[str, Any] = {"batch_size": 64, "gae_lambda": 0.98, "gamma": 0.999, "n_epochs": 4, "ent_coef": 0.01}
ZOO_DQN: dict[str, Any] = {
    "learning_rate": 6.3e-4,
    "batch_size": 128,
    "buffer_size": 50_000,
    "learning_starts": 0,
    "gamma": 0.99,
    "target_update_interval": 250,
    "train_freq": 4,
    "gradient_steps": -1,
    "exploration_final_eps": 0.1,
    "policy_kwargs": {"net_arch": [256, 256]},
}
SUCCESS_BONUS = AgentConfig().success_bonus
"""Both sides learn from the same reward."""
EXPLORED_FRAMES = 12_000
"""The zoo explores over 12 % of its 100,000 frames; ours may fly longer, the schedule stays."""
START = "fork" if "fork" in multiprocessing.get_all_start_methods() else None
"""Of Stable-Baselines3's workers: a fork need not import torch again, 16 of which its clock would count."""
VEC_ENVS: dict[str, Callable[..., VecEnv]] = {
    "dummy": DummyVecEnv,
    "subproc": partial(SubprocVecEnv, start_method=START),
}


class Told(gymnasium.Wrapper[Array, Any, Array, Any]):
    """Writes the oracle's instruction behind the state and pays the bonus for a success, as our agents have it."""

    def __init__(self, env: gymnasium.Env[Array, Any]):
        super().__init__(env)
        task = task_of(env)
        self._rule, self._given, self._success_key = task.rule, np.ones(1, np.float32), task.success_key
        self.observation_space = spaces.Box(-np.inf, np.inf, (task.observation_size,), np.float32)

    def reset(self, **kwargs: Any) -> tuple[Array, dict[str, Any]]:
        """Begin an episode."""
        state, info = self.env.reset(**kwargs)
        return self._seen(state), info

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Step, with the bonus."""
        state, reward, terminated, truncated, info = self.env.step(action)
        bonus = SUCCESS_BONUS if info[self._success_key] else 0.0
        return self._seen(state), float(reward) + bonus, terminated, truncated, info

    def _seen(self, state: Array) -> Array:
        """State ``(S,)`` to what the policy reads ``(O,)``."""
        return observe(state, self._rule(state), self._given)


def make_told(step: str) -> Told:
    """One environment with our "lean" step or with "gymnasium"'s own; runs in the worker's own process."""
    env: Any = make_gym(LANDER_ID, {})
    env.unwrapped.lean = {"lean": True, "gymnasium": False}[step]
    return Told(env)


def make_vec_env(vec_env: str, step: str, count: int) -> VecEnv:
    """As many environments as asked for, as one of Stable-Baselines3's."""
    return VEC_ENVS[vec_env]([partial(make_told, step)] * count)


class CollectsOnly(PPO):
    """PPO that gathers experience and learns nothing from it."""

    def train(self) -> None:
        """Nothing."""


def make_model(algorithm: str, env: VecEnv, seed: int, total_frames: int, rollout_steps: int) -> BaseAlgorithm:
    """PPO, DQN or PPO without learning ("collect") with the zoo's settings."""
    shared: dict[str, Any] = {"env": env, "seed": seed, "device": "cpu"}
    if algorithm == "dqn":
        return DQN("MlpPolicy", exploration_fraction=min(1.0, EXPLORED_FRAMES / total_frames), **shared, **ZOO_DQN)
    kind = {"ppo": PPO, "collect": CollectsOnly}[algorithm]
    return kind("MlpPolicy", n_steps=rollout_steps, **shared, **ZOO_PPO)


class Judge(BaseCallback):
    """Evaluates every so often, keeps the clock without it, and ends a run that has reached every level.

    Args:
        start: when the clock began.
        every: frames between two evaluations.
        episodes: of each.
        levels: shares of episodes that succeed.
        cap_seconds: where the run ends in any case.
    """

    def __init__(self, start: float, every: int, episodes: int, levels: list[float], cap_seconds: float):
        super().__init__()
        self._start, self._due, self._evaluating = start, Schedule(every), 0.0
        self._episodes, self._levels, self._cap_seconds = episodes, levels, cap_seconds
        self._envs = [make_gym(LANDER_ID, {}) for _ in range(episodes)]
        self._skilled = False
        self.points: list[Point] = []

    def seconds(self) -> float:
        """Spent so far on anything but evaluations."""
        return time.perf_counter() - self._start - self._evaluating

    def evaluate_if_due(self) -> None:
        """Evaluate at most once for the same weights: the same result twice would be no two in a row."""
        if self._due(self.num_timesteps):
            self.evaluate()

    def evaluate(self) -> None:
        """Fly the deterministic policy, as ``train.py`` does with ours."""
        begun, before = time.perf_counter(), self.seconds()
        instructor = make_instructor(InstructorConfig("oracle"), task_of(self._envs[0]))
        seeds = range(EVALUATION_SEED, EVALUATION_SEED + self._episodes)
        flown = play(self._envs, self._act, instructor, seeds)
        self._evaluating += time.perf_counter() - begun
        self.points.append(Point(self.num_timesteps, before, float(np.mean([e.success for e in flown]))))
        self._skilled = all(reached(self.points, level) for level in self._levels)

    def _act(self, observations: Array) -> Array:
        return np.asarray(self.model.policy.predict(observations, deterministic=True)[0])

    def ended(self) -> bool:
        """Whether nothing is left to find out."""
        return self._skilled or self.seconds() > self._cap_seconds

    def _on_rollout_start(self) -> None:  # between two updates, as ours is evaluated
        self.evaluate_if_due()

    def _on_step(self) -> bool:
        return not self.ended()


def to_skill(
    algorithm: str,
    seed: int,
    vec_env: str,
    step: str,
    evaluate_every: int,
    episodes: int,
    levels: list[float],
    cap_frames: int,
    cap_seconds: float,
    rollout_steps: int,
) -> list[dict[str, Any]]:
    """Train until every level is reached or a cap; returns the evaluations (see ``levels.Point``)."""
    torch.set_num_threads(1)
    start = time.perf_counter()
    env = make_vec_env(vec_env, step, ZOO_ENVS[algorithm])
    model = make_model(algorithm, env, seed, cap_frames, rollout_steps)
    judge = Judge(start, evaluate_every, episodes, levels, cap_seconds)
    model.learn(cap_frames, callback=judge)
    judge.evaluate_if_due()
    if not judge.points:
        judge.evaluate()
    env.close()
    return [asdict(point) for point in judge.points]


def rate(algorithm: str, vec_env: str, step: str, frames: int, rollout_steps: int) -> float:
    """Frames a second of learn(), after one round to warm up; without set-up and without any evaluation."""
    torch.set_num_threads(1)
    env = make_vec_env(vec_env, step, ZOO_ENVS["ppo"])
    model = make_model(algorithm, env, 0, frames, rollout_steps)
    warm = rollout_steps * env.num_envs if algorithm == "collect" else 0
    if warm:
        model.learn(warm)
    start = time.perf_counter()
    model.learn(frames, reset_num_timesteps=not warm)
    seconds = time.perf_counter() - start
    env.close()
    return (model.num_timesteps - warm) / seconds
