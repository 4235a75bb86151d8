"""Extra reward for following instructions, which fades out.

The paper proposes to learn faster from the learnt meaning of the instructor's words. Here the change of the state over
the last n steps is mapped to the instructor's scale and compared with the instruction at their beginning. The weight
falls to 0; from then on the optimal policy is that of the environment's own reward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from tensordict import TensorDictBase

from ibe_rl.config.settings import ObedienceConfig, TrainConfig
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.instructors import speaks
from ibe_rl.storage.log_columns import TOLD_COLUMN
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR, TEACHER, Delays

Judge = Callable[[Array], Array]
"""Changes ``(W, S)`` of the state over n steps to their meaning ``(W, d)`` on the instructor's scale."""


class InstructionReward:
    """Adds ``extra_reward`` to batches.

    Args:
        config: see ``ObedienceConfig``.
        horizon_steps: n; None until it has been found.
        judge: the current judge; None until there is one.
        delays: how late those who instruct are, as far as it has been found.
        gamma: the agent's discount, by which ``config.absorbing`` counts what comes after the end.
    """

    def __init__(
        self,
        config: ObedienceConfig,
        horizon_steps: Callable[[], int | None],
        judge: Callable[[], Judge | None],
        delays: Callable[[], Delays] = dict,
        gamma: float = 0.0,
    ):
        self._config, self._horizon_steps, self._judge, self._delays = config, horizon_steps, judge, delays
        self._after_end = gamma / (1 - gamma) if config.absorbing else 0.0
        self._before: dict[str, Array] | None = None

    def add(self, batch: TensorDictBase, frames: int) -> dict[str, float]:
        """Reward a batch ``[N, T]`` under ``("next", "extra_reward")``, in the environment's units.

        The agreement of n steps with the instruction at their beginning is ``1 - |meaning - instruction|``, from -1 to
        1. The last of them gets the current weight times it. An instruction that is d steps late is heard d steps
        after that beginning, and where d is n or more the reward comes then. In the environment that a person teaches
        d is theirs. Steps get 0 where nothing was said, or too early in their episode.

        With ``absorbing`` an episode that has terminated counts as standing still ever after, under its last
        instruction: its last step also gets that agreement for all steps to come, discounted (absorbing states,
        Kostrikov et al. 2019). Else the end would stop the reward of an agent that does as told, and pay it for putting
        the end off.

        Args:
            batch: row i of every batch continues the same environment.
            frames: seen before this batch.

        Returns:
            For metrics.csv: the mean agreement of the judged steps, and the mean extra reward of all steps; empty if
            this reward is off.
        """
        if self._config.judge == "none":
            return {}
        weight = self._config.weight * max(0.0, 1 - frames / self._config.until_frames)
        steps = self._horizon_steps()
        if steps is None:
            batch["next", "extra_reward"] = torch.zeros(*batch.shape, 1)
            return {"obeyed": float("nan"), "extra_reward": 0.0}
        instruction, delta, valid = self._windows(batch, steps, _late_steps(batch, self._delays()))
        judge = self._judge() if weight else None
        extra, mean = np.zeros(valid.shape), math.nan
        if judge is not None and valid.any():
            agreement = _agreement(judge(delta[valid]), instruction[valid])
            mean = float(agreement.mean())
            extra[valid] = weight * agreement
        if judge is not None and self._after_end:
            extra += weight * self._after_end * _still(judge, batch)
        batch["next", "extra_reward"] = torch.from_numpy(extra).float().unsqueeze(-1)
        return {"obeyed": mean, "extra_reward": float(extra.mean())}

    def state_dict(self) -> dict[str, Array]:
        """The newest steps, where the next windows begin, as arrays."""
        return dict(self._before or {})

    def load_state_dict(self, state: dict[str, Array]) -> None:
        """The inverse of ``state_dict``."""
        self._before = dict(state) or None

    def _windows(self, batch: TensorDictBase, horizon_steps: int, late_steps: Array) -> tuple[Array, Array, Array]:
        """What was said about the windows, changes over them, and which can be judged: ``(N, T, ...)``."""
        now = {
            "state": batch["state"].numpy(),
            "after": batch["next", "state"].numpy(),
            "instruction": batch["instruction"].numpy(),
            "given": batch["instruction_given"].numpy()[..., 0] > 0,
            "done": batch["next", "done"].numpy()[..., 0],
        }
        behind = np.maximum(horizon_steps - 1, late_steps)  # a window begins so many steps before its reward
        steps, back = now["done"].shape[1], int(behind.max())
        before = self._before
        # nothing is kept yet, n or a delay has changed, or an earlier version kept it
        if before is None or before.keys() != now.keys() or before["done"].shape[1] != back:
            before = {name: _none(column, back, name == "done") for name, column in now.items()}
        whole = {name: np.concatenate([before[name], column], axis=1) for name, column in now.items()}
        self._before = {name: column[:, steps:].copy() for name, column in whole.items()}
        begins = (back - behind)[:, None] + np.arange(steps)
        rows = np.arange(len(begins))[:, None]

        def later(name: str, by: int | Array) -> Array:
            return whole[name][rows, begins + by]

        ends = np.pad(whole["done"].cumsum(axis=1), ((0, 0), (1, 0)))
        unbroken = ends[:, back : back + steps] == ends[rows, begins]
        delta = later("after", horizon_steps - 1) - later("state", 0)
        heard = late_steps[:, None]
        return later("instruction", heard), delta, unbroken & later("given", heard)


def _late_steps(batch: TensorDictBase, delays: Delays) -> Array:
    """How late each row is instructed, ``(N,)`` steps: by the person where they teach, else by whoever instructs."""
    late = {who: found.steps for who, found in delays.items()}
    told = batch.get(TOLD_COLUMN, None)
    taught = np.zeros(len(batch), bool) if told is None else told.numpy()[..., 0].any(axis=1)
    return np.where(taught, late.get(TEACHER, 0), late.get(INSTRUCTOR, 0))


def _agreement(meaning: Array, instruction: Array) -> Array:
    """From -1 to 1, ``(W,)``, of ``(W, d)`` each; of several numbers the worst counts."""
    agreement: Array = 1 - np.abs(meaning - instruction).max(axis=-1)
    return agreement


def _still(judge: Judge, batch: TensorDictBase) -> Array:
    """Agreement ``(N, T)`` of standing still with the last instruction of episodes that terminate; 0 elsewhere."""
    ends = (batch["next", "terminated"] & (batch["instruction_given"] > 0)).numpy()[..., 0]
    state = batch["state"].numpy()
    found = np.zeros(ends.shape)
    found[ends] = _agreement(judge(np.zeros((1, state.shape[-1]), state.dtype)), batch["instruction"].numpy()[ends])
    return found


def _none(like: Array, steps: int, value: bool) -> Array:
    """Padding before the first step, which is done: no window begins there."""
    return np.full((len(like), steps, *like.shape[2:]), value, like.dtype)


def make_instruction_reward(
    cfg: TrainConfig,
    task: Task,
    horizons_steps: Callable[[], Sequence[int]],
    mapping_of: Callable[[int], ClusterMapping | None],
    delays: Callable[[], Delays] = dict,
) -> InstructionReward:
    """Make the reward of ``cfg``; it judges over the shortest span that a vocabulary is learnt for.

    Args:
        cfg: of the run.
        task: of the environment.
        horizons_steps: all horizons explained, n first; empty until n has been found.
        mapping_of: the vocabulary of a horizon, None before the first refresh.
        delays: how late those who instruct are.
    """

    def shortest() -> int | None:
        return min(horizons_steps(), default=None)

    def oracle() -> Judge:
        horizons = horizons_steps()
        return meant(task, min(horizons), horizons[0])

    def learnt() -> Judge | None:
        mapping = mapping_of(min(horizons_steps()))
        if mapping is None or not all(one.known for one in mapping.meanings):
            return None
        return mapping.express

    judge = oracle if cfg.obedience.judge == "oracle" else learnt
    return InstructionReward(cfg.obedience, shortest, judge, delays, cfg.agent.gamma)


def meant(task: Task, horizon_steps: int, full_horizon_steps: int) -> Judge:
    """What changes mean to the instructor: the direction of each explained dimension.

    Args:
        task: of the environment.
        horizon_steps: of the changes.
        full_horizon_steps: what the task's band is declared for; over fewer steps it is narrower.
    """
    bands = [band * horizon_steps / full_horizon_steps for band in task.explained_band]

    def judge(delta: Array) -> Array:
        change = delta[:, task.explained]
        return np.where(np.abs(change) > np.array(bands, delta.dtype), np.sign(change), 0.0)

    return judge


def check_instruction_reward(cfg: TrainConfig) -> None:
    """Refuse an extra reward that could never be judged.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    asked = f"obedience.judge={cfg.obedience.judge}"
    if cfg.obedience.judge == "none":
        return
    if cfg.obedience.absorbing and cfg.agent.gamma == 1:
        raise ConfigError(
            f"agent.gamma=1 with {asked} and obedience.absorbing=true: allowed is less than 1, as what comes after the "
            "end counts discounted"
        )
    if not speaks(cfg.instructor):
        raise ConfigError(f"{asked} with instructor=silent: allowed is none, where nothing is said")
    if cfg.obedience.judge == "mapping" and cfg.refresh_every_frames is None:
        raise ConfigError(f"{asked} with refresh_every_frames=null: allowed is none or oracle, without a vocabulary")
    if cfg.mapping.horizon_steps is None and cfg.refresh_every_frames is None:
        raise ConfigError(
            f"{asked} with refresh_every_frames=null and mapping.horizon_steps=null, which no refresh finds: "
            "allowed is a number of steps"
        )
