"""How the agents of each library are called: one class for each, all with the same arguments.

Each is called with observations ``(N, seen)``, a memory for each of the ``N`` episodes (None at its beginning) and the
``N`` environments (None if there are none). It returns ``N`` actions and the memories after them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Dict
from gymnasium.spaces.utils import unflatten
from gymnasium.vector.utils import concatenate, create_empty_array
from tensordict import TensorDict
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import set_recurrent_mode

from ibe_rl.envs.masks import masks_of
from ibe_rl.types import Array, ConfigError

Memories = Sequence[Any]
Adapter = Callable[[Array, Memories, Sequence[Any] | None], tuple[Any, Memories]]


def plain_array(chosen: Any) -> Array:
    """Actions as an array, from a tensor too."""
    return np.asarray(chosen.detach().cpu() if isinstance(chosen, torch.Tensor) else chosen)


@dataclass(frozen=True)
class Batched:
    """A function of a batch of observations."""

    function: Callable[[Array], Any]

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        return self.function(observations), memories


@dataclass(frozen=True)
class OneByOne:
    """A function of a single observation."""

    function: Callable[[Array], Any]

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        return np.stack([plain_array(self.function(observation)) for observation in observations]), memories


@dataclass(frozen=True)
class Predicts:
    """A model of stable-baselines3, or its policy."""

    model: Any

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module.

        Raises:
            ConfigError: if the model keeps a state of a kind that is not known here.
        """
        actions, state = self.model.predict(observations, deterministic=True)
        if state is not None:
            raise ConfigError(
                f"agent: its predict() returns a state, {type(state).__name__}; allowed are a model without a memory "
                "and the recurrent ones of sb3-contrib"
            )
        return actions, memories


@dataclass(frozen=True)
class PredictsMasked:
    """A policy of sb3-contrib that takes masks from the environment; without environments all actions are allowed."""

    policy: Any

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        masks = None if envs is None else np.stack([masks_of(env) for env in envs])
        return self.policy.predict(observations, deterministic=True, action_masks=masks)[0], memories


@dataclass(frozen=True)
class PredictsRecurrently:
    """A recurrent policy of sb3-contrib. A memory is its hidden and cell state, ``(layers, width)`` each."""

    policy: Any

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        layers, _, width = self.policy.lstm_hidden_state_shape
        blank = np.zeros((2, layers, width), np.float32)
        before = np.stack([blank if memory is None else memory for memory in memories], axis=2)
        begins = np.array([memory is None for memory in memories])
        actions, after = self.policy.predict(observations, tuple(before), begins, deterministic=True)
        return actions, list(np.stack(after).transpose(2, 0, 1, 3))


@dataclass(frozen=True)
class ReadsTensorDicts:
    """A policy module of TorchRL, which reads ``observation`` and writes ``action``.

    Attributes:
        module: evaluated deterministically.
        first: the first discrete action, added to one-hot actions; None: continuous.
        carried: keys that it reads, and writes below ``next``: its recurrent state.
    """

    module: TensorDictModuleBase
    first: int | None
    carried: tuple[Any, ...]

    @classmethod
    def of(cls, module: TensorDictModuleBase, first: int | None) -> ReadsTensorDicts:
        """Find the recurrent state among its keys.

        Raises:
            ConfigError: if it reads anything else, or writes no action.
        """
        written, read = list(module.out_keys), list(module.in_keys)
        carried = tuple(key for key in read if ("next", key) in written)
        foreign = [key for key in read if key not in ("observation", "is_init", *carried)]
        if foreign or "action" not in written:
            raise ConfigError(
                f"agent: it reads {', '.join(map(str, read))} and writes {', '.join(map(str, written))}; allowed is to "
                "read observation, is_init and recurrent states that it writes below next, and to write action"
            )
        return cls(module, first, carried)

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        begins = torch.tensor([[memory is None] for memory in memories])
        read = TensorDict(
            {
                "observation": torch.from_numpy(np.ascontiguousarray(observations)),
                "is_init": begins,
                **self._had(memories),
            },
            [len(observations)],
        )
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC), set_recurrent_mode(False):
            written = self.module(read)
        action: Array = written["action"].cpu().numpy()
        if self.first is not None and action.ndim == 2 and action.shape[1] > 1:
            action = action.argmax(-1) + self.first
        return action, self._keep(written, memories)

    def _had(self, memories: Memories) -> dict[Any, torch.Tensor]:
        """The recurrent states of all rows; those that begin have zeros. Empty if all begin: the module has its own."""
        known = next((memory for memory in memories if memory is not None), None)
        if known is None:
            return {}
        return {
            key: torch.stack([torch.zeros_like(known[at]) if memory is None else memory[at] for memory in memories])
            for at, key in enumerate(self.carried)
        }

    def _keep(self, written: Any, memories: Memories) -> Memories:
        if not self.carried:
            return memories
        after = [written["next", key].cpu() for key in self.carried]
        return [tuple(state[row].clone() for state in after) for row in range(len(memories))]


@dataclass(frozen=True)
class Stacked:
    """An agent that reads the last observations at once, as behind ``VecFrameStack``; those before the episode are 0.

    A memory is the observations before, and the agent's own memory.
    """

    agent: Adapter
    frames: int

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        width = observations.shape[1]
        blank = np.zeros((self.frames - 1) * width, observations.dtype)
        before = np.array([blank if memory is None else memory[0] for memory in memories])
        frames = np.concatenate([before, observations], axis=1)
        own = [None if memory is None else memory[1] for memory in memories]
        actions, own_after = self.agent(frames, own, envs)
        return actions, list(zip(frames[:, width:], own_after, strict=True))


@dataclass(frozen=True)
class Statistics:
    """What ``VecNormalize`` has learnt about observations: numbers, and no code."""

    mean: Array
    variance: Array
    epsilon: float
    clip: float

    def __call__(self, observations: Array) -> Array:
        """Observations ``(N, ·)`` as the model reads them."""
        scaled = (observations - self.mean) / np.sqrt(self.variance + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32)

    def are_of(self, space: gymnasium.Space[Any]) -> bool:
        """Whether they are of observations of a space."""
        return self.mean.shape == space.shape


@dataclass(frozen=True)
class KeyStatistics:
    """The same of some keys of a dict; the others are read as they are."""

    by_key: Mapping[str, Statistics]

    def __call__(self, observations: Mapping[str, Array]) -> dict[str, Array]:
        """Observations, each key ``(N, ·)``, as the model reads them."""
        return {key: self.by_key[key](part) if key in self.by_key else part for key, part in dict(observations).items()}

    def are_of(self, space: gymnasium.Space[Any]) -> bool:
        """See ``Statistics``."""
        known = space.spaces if isinstance(space, Dict) else {}
        return all(key in known and one.are_of(known[key]) for key, one in self.by_key.items())


@dataclass(frozen=True)
class InParts:
    """An agent that reads observations as the environment has them, such as a dict or an image, not in a row."""

    agent: Adapter
    space: gymnasium.Space[Any]

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        parts, empty = (
            [unflatten(self.space, row) for row in observations],
            create_empty_array(self.space, len(observations)),
        )
        together: Any = concatenate(self.space, parts, empty)  # type: ignore[arg-type]  # empty is as the space says
        return self.agent(together, memories, envs)


@dataclass(frozen=True)
class Normalised:
    """An agent that reads normalised observations, as behind ``VecNormalize``."""

    agent: Adapter
    statistics: Statistics | KeyStatistics

    def __call__(self, observations: Array, memories: Memories, envs: Sequence[Any] | None) -> tuple[Any, Memories]:
        """See the module."""
        read: Any = observations  # a row, or a dict where the agent reads parts
        scaled: Any = self.statistics(read)
        return self.agent(scaled, memories, envs)


def reads_masks(agent: Adapter) -> bool:
    """Whether an agent reads masks, also behind frames and statistics."""
    inner = getattr(agent, "agent", None)
    return isinstance(agent, PredictsMasked) or (inner is not None and reads_masks(inner))
