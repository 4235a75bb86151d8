"""Many environments as one TorchRL environment for the collector, with the instruction in the observation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Bounded, Composite, Unbounded
from torchrl.envs import EnvBase
from torchrl.envs.libs.gym import _gym_to_torchrl_spec_transform as torchrl_spec

from ibe_rl.envs.errors import GateError, located
from ibe_rl.envs.wrappers import task_of
from ibe_rl.storage.log_columns import TOLD_COLUMN, TOLD_SIZE
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.task import PERCEPT
from ibe_rl.types import Array, Instructor, observe

TRAINING_SEEDS = 2_000_000_000
"""Seeds of training episodes are below this, those of all others are not."""


class InstructedEnvs(EnvBase):
    """Environments that are stepped and instructed together, one row each.

    Reset and step write ``state``, ``instruction``, ``instruction_given``, ``observation`` (all three, for the policy)
    and ``success`` (``info`` at the task's success key). Where the agent does not perceive the state itself, they also
    write ``percept``, which ``observation`` has in place of the state, and ``told`` where the instructor tells who
    speaks. Resetting is left to the collector, so no last
    state is lost. gymnasium's vector environment and TorchRL's transforms took a third of the time (docs/LOG.md).

    Each episode has a seed of its own (``episode_seed``), so that it can be replayed alone.

    Args:
        envs: environments of one kind that declare a task.
        instructor: instructs all rows.
        partial_episodes: per row the episode that the first reset resumes.
    """

    def __init__(
        self,
        envs: Sequence[gymnasium.Env[Any, Any]],
        instructor: Instructor,
        partial_episodes: Sequence[PartialEpisode] = (),
    ):
        super().__init__(batch_size=[len(envs)])
        self._environments, self._instructor, self._task = envs, instructor, task_of(envs[0])
        self._partial_episodes, self._first_seed, self._episodes_begun = list(partial_episodes), 0, [0] * len(envs)
        self._states = np.zeros((len(envs), len(self._task.state_names)), np.float32)
        size = (len(envs), self._task.percept_size)
        self._percepts = np.zeros(size, self._task.percept_type) if self._task.parts else None
        self._said = np.zeros((len(envs), self._task.instruction_size + 1), np.float32)
        self._tells = hasattr(instructor, "told_rows")
        self._declare()

    def _declare(self) -> None:
        """Declare the specs."""
        rows, task, env = len(self._environments), self._task, self._environments[0]
        state = torchrl_spec(env.observation_space, categorical_action_encoding=True)
        flag = Unbounded(shape=(rows, 1), dtype=torch.bool)
        self.observation_spec = Composite(
            observation=Unbounded(shape=(rows, task.observation_size), dtype=torch.float32),
            state=state.expand(rows, *state.shape),
            instruction=Bounded(-1.0, 1.0, shape=(rows, task.instruction_size), dtype=torch.float32),
            instruction_given=Bounded(0.0, 1.0, shape=(rows, 1), dtype=torch.float32),
            success=flag,
            shape=[rows],
        )
        if self._percepts is not None:
            percepts = torch.from_numpy(self._percepts)
            self.observation_spec["percept"] = Unbounded(shape=percepts.shape, dtype=percepts.dtype)
        if self._tells:
            self.observation_spec[TOLD_COLUMN] = Unbounded(shape=(rows, TOLD_SIZE), dtype=torch.int32)
        action = torchrl_spec(env.action_space, categorical_action_encoding=True)
        self.action_spec = action.expand(rows, *action.shape)
        self.reward_spec = Unbounded(shape=(rows, 1), dtype=torch.float32)
        self.done_spec = Composite({name: flag.clone() for name in ("done", "terminated", "truncated")}, shape=[rows])

    def _set_seed(self, seed: int | None) -> None:
        self._first_seed = episode_seed(0, 0) if seed is None else seed
        self._episodes_begun = [0] * len(self._environments)

    def _reset(self, tensordict: TensorDictBase | None, **_: Any) -> TensorDictBase:
        asked = None if tensordict is None else tensordict.get("_reset", None)
        rows = np.ones(len(self._environments), bool) if asked is None else asked.numpy().reshape(-1)
        no = torch.zeros(len(self._environments), 1, dtype=torch.bool)
        fresh = self._replay() if self._partial_episodes else rows
        for row in np.flatnonzero(fresh).tolist():
            self._begin(row)
        self._instructor.reset(fresh)
        return TensorDict(self._seen(rows) | {"success": no}, self.batch_size)

    def _begin(self, row: int) -> None:
        """Begin the next episode of a row."""
        seed = episode_seed(self._first_seed + row, self._episodes_begun[row])
        self._episodes_begun[row] += 1
        self._take(row, *self._environments[row].reset(seed=seed))

    def _take(self, row: int, state: Array, info: Mapping[str, Any]) -> None:
        self._states[row] = state
        if self._percepts is not None:
            self._percepts[row] = info[PERCEPT]

    def _replay(self) -> Array:
        """Replay the partial episodes, with the instructor called at each step.

        Returns:
            The rows ``(N,)`` to reset: without a partial episode, or with a replay that ended in another state.
        """
        partial_episodes, self._partial_episodes = self._partial_episodes, []
        self._episodes_begun = [one.ended for one in partial_episodes]
        going = np.array([one.state is not None for one in partial_episodes])
        for row in np.flatnonzero(going).tolist():
            self._begin(row)
        self._instructor.reset(going)
        played = [plain(one.actions) for one in partial_episodes]
        for step in range(max(len(one.actions) for one in partial_episodes)):
            playing = going & [step < len(one.actions) for one in partial_episodes]
            self._instructor.instruct(self._states, playing)
            for row in np.flatnonzero(playing).tolist():
                state, _, terminated, truncated, info = self._environments[row].step(played[row][step])
                self._take(row, state, info)
                going[row] = not (terminated or truncated)
        same = [
            one.state is not None and np.array_equal(state, one.state)
            for state, one in zip(self._states, partial_episodes, strict=True)
        ]
        return ~(going & same)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        actions = tensordict.get("action")
        states, rewards, terminated, truncated, infos = step_together(self._environments, actions.numpy())
        self._states = np.array(states, np.float32)
        if self._percepts is not None:
            self._percepts = np.array([info[PERCEPT] for info in infos])
        ended = torch.tensor([terminated, truncated]).unsqueeze(-1)
        success = [info[self._task.success_key] for info in infos]
        entries = self._seen(~np.array(terminated)) | {
            "reward": torch.tensor(rewards, dtype=torch.float32).unsqueeze(-1),
            "terminated": ended[0],
            "truncated": ended[1],
            "done": ended.any(dim=0),
            "success": torch.tensor(success).unsqueeze(-1),
        }
        return TensorDict(entries, self.batch_size)

    def _seen(self, asked: Array) -> dict[str, torch.Tensor]:
        """Observation entries for the current states, in new memory.

        Only the rows ``(N,)`` in ``asked`` get a new instruction: the others have theirs for this state, or have
        terminated.
        """
        try:
            instruction, given = self._instructor.instruct(self._states, asked)
        except GateError as error:
            raise located(error, self._environments, self._states) from None
        self._said = np.where(asked[:, None], np.concatenate([instruction, given], axis=1), self._said)
        perceived = self._states if self._percepts is None else self._percepts
        observation = torch.from_numpy(observe(perceived, self._said[:, :-1], self._said[:, -1:]))
        end = perceived.shape[1]
        entries = {
            "observation": observation,
            "state": observation[:, :end].clone(),
            "instruction": observation[:, end:-1].clone(),
            "instruction_given": observation[:, -1:].clone(),
        }
        if self._percepts is not None:
            entries["state"] = torch.from_numpy(self._states.copy())
            entries["percept"] = torch.from_numpy(self._percepts.copy())
        if self._tells:
            entries[TOLD_COLUMN] = torch.from_numpy(self._instructor.told_rows.copy())  # type: ignore[attr-defined]  # it has
        return entries


def step_together(envs: Sequence[gymnasium.Env[Any, Any]], actions: Array) -> Sequence[Sequence[Any]]:
    """Step each environment once: states, rewards, terminated, truncated, infos of ``N`` environments."""
    steps = [env.step(action) for env, action in zip(envs, plain(actions), strict=True)]
    return list(zip(*steps, strict=True))


def plain(actions: Array) -> Any:
    """Integer actions ``()`` or ``(N,)`` as plain ints, which environments read faster; others unchanged."""
    return actions.tolist() if actions.dtype.kind in "iu" and actions.ndim <= 1 else actions


def make_vector_env(
    envs: Sequence[gymnasium.Env[Any, Any]],
    instructor: Instructor,
    seed: int,
    partial_episodes: Sequence[PartialEpisode] = (),
    kind: Callable[..., InstructedEnvs] = InstructedEnvs,
) -> EnvBase:
    """Make ``InstructedEnvs``, or a ``kind`` of them, with rows seeded from ``seed`` on."""
    env = kind(envs, instructor, partial_episodes)
    env.set_seed(seed)
    return env


def episode_seed(row_seed: int, number: int) -> int:
    """The seed of a training episode.

    Args:
        row_seed: of its environment.
        number: of earlier episodes in this environment.
    """
    return int(np.random.SeedSequence([row_seed, number]).generate_state(1, np.uint64)[0]) % TRAINING_SEEDS
