"""From a gymnasium environment to what the collector steps: many copies as one TorchRL environment."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import gymnasium
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from tensordict import TensorDictBase
from torchrl.data import Bounded, Composite, Unbounded
from torchrl.envs import GymWrapper, Transform, TransformedEnv
from torchrl.envs.gym_like import default_info_dict_reader

from ibe_rl.data import ConfigError, Instructor, Task, observe


def make_gym(env_id: str, kwargs: Mapping[str, Any]) -> gymnasium.Env[Any, Any]:
    """Make one environment, with its time limit and nothing else around it.

    Raises:
        ConfigError: if ``env_id`` is not registered or the environment declares no task.
    """
    if env_id not in gymnasium.registry:
        ours = ", ".join(name for name in gymnasium.registry if name.startswith("ibe_rl/"))
        raise ConfigError(
            f"env.id={env_id}: not registered with gymnasium; allowed is one that declares a task: {ours}"
        )
    try:
        env = gymnasium.make(env_id, disable_env_checker=True, **kwargs)
    except (TypeError, ValueError, AssertionError) as error:
        raise ConfigError(f"env.id={env_id} with env.kwargs={dict(kwargs)}: {' '.join(str(error).split())}") from None
    if not isinstance(getattr(env.unwrapped, "task", None), Task):
        raise ConfigError(f"env.id={env_id}: the environment declares no task (an attribute of type ibe_rl.data.Task)")
    return env


def task_of(env: gymnasium.Env[Any, Any]) -> Task:
    """What the environment declares of its own."""
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]  # make_gym has looked
    return task


class InstructionTransform(Transform):
    """Write ``state``, ``instruction``, ``instruction_given`` and ``observation`` (all three) in reset and step alike.

    It reads the ``observation`` of the environment below, which becomes the ``state``. The policy reads the
    new ``observation``; IBE explains changes of the ``state``.

    Args:
        instructor: instructs all rows of the environment together.
        instruction_size: d.
    """

    def __init__(self, instructor: Instructor, instruction_size: int):
        super().__init__(in_keys=["observation"], out_keys=["observation", "state", "instruction", "instruction_given"])
        self._instructor, self._size = instructor, instruction_size

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        state = next_tensordict.get("observation")
        instruction, given = self._instructor.instruct(state.numpy())
        seen = observe(state.numpy(), instruction, given)
        values = (torch.from_numpy(seen), state, torch.from_numpy(instruction), torch.from_numpy(given))
        for key, value in zip(self.out_keys, values, strict=True):
            next_tensordict.set(key, value)
        return next_tensordict

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        rows = tensordict.get("_reset", None) if tensordict is not None else None
        everywhere = torch.ones(tensordict_reset.batch_size, dtype=torch.bool)
        self._instructor.reset((everywhere if rows is None else rows.reshape(everywhere.shape)).numpy())
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Declare the four entries."""
        state = observation_spec["observation"]
        rows, total = state.shape[:-1], state.shape[-1] + self._size + 1
        observation_spec["state"] = state.clone()
        observation_spec["observation"] = Unbounded(shape=(*rows, total), dtype=torch.float32)
        observation_spec["instruction"] = Bounded(-1.0, 1.0, shape=(*rows, self._size), dtype=torch.float32)
        observation_spec["instruction_given"] = Bounded(0.0, 1.0, shape=(*rows, 1), dtype=torch.float32)
        return observation_spec


def make_env(env_id: str, kwargs: Mapping[str, Any], count: int, instructor: Instructor, seed: int) -> TransformedEnv:
    """Make ``count`` copies of an environment that step together, seeded ``seed`` to ``seed + count - 1``.

    ``SyncVectorEnv`` without resets of its own, since the collector does that: with gymnasium's other modes
    the last observation of an episode is lost or a made-up transition is added.
    """
    vector = SyncVectorEnv([partial(make_gym, env_id, dict(kwargs))] * count, autoreset_mode=AutoresetMode.DISABLED)
    task: Task = task_of(vector.envs[0])
    env = GymWrapper(vector, categorical_action_encoding=True)
    flag = Unbounded(shape=(count,), dtype=torch.bool)
    env.set_info_dict_reader(default_info_dict_reader([task.success_key], {task.success_key: flag}))
    env = TransformedEnv(env, InstructionTransform(instructor, task.instruction_size))
    env.set_seed(seed)
    return env
