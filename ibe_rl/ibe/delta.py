"""Episodes on arrays: windows of n steps, the best episodes, and the steps that meanings are inferred from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ibe_rl.types import Array, Episode, read_only


@dataclass(frozen=True)
class Windows:
    """``W`` changes of the state over ``horizon_steps`` steps.

    Attributes:
        delta: ``(W, S)`` s_{t+n} - s_t (the paper's equation 1), in the environment's observation units.
        instruction: ``(W, d)`` m*_t at the beginning of the window.
        given: ``(W,)`` bool, False where the instructor was silent.
        episode: ``(W,)`` index of the episode in the sequence the windows were cut from.
        step: ``(W,)`` t, the step at which the window begins.
        horizon_steps: n.
    """

    delta: Array
    instruction: Array
    given: Array
    episode: Array
    step: Array
    horizon_steps: int

    def __post_init__(self) -> None:
        count = len(self.delta)
        shapes = {"delta": (count, None), "instruction": (count, None)}
        for name in _COLUMNS:
            view = read_only(getattr(self, name), shapes.get(name, (count,)), f"Windows.{name}")
            object.__setattr__(self, name, view)

    def __len__(self) -> int:
        return len(self.delta)

    def __getitem__(self, rows: Array | slice) -> Windows:
        return replace(self, **{name: getattr(self, name)[rows] for name in _COLUMNS})


_COLUMNS = tuple(field.name for field in fields(Windows) if field.name != "horizon_steps")


def delta_states(states: Array, horizon_steps: int, end: str = "drop") -> Array:
    """Change of the state over the next n steps, from every step of one episode.

    Args:
        states: ``(T + 1, S)``.
        horizon_steps: n, at least 1.
        end: "drop" leaves out the windows that reach past the last state, "clamp" lets them end there.

    Returns:
        ``(max(T + 1 - n, 0), S)`` for "drop", ``(T, S)`` for "clamp"; row t begins at step t.

    Raises:
        ValueError: for another ``end`` or a horizon below 1.
    """
    if horizon_steps < 1:
        raise ValueError(f"horizon_steps={horizon_steps}: at least 1")
    if end == "drop":
        return states[horizon_steps:] - states[:-horizon_steps]
    if end == "clamp":
        last = len(states) - 1
        return states[np.minimum(np.arange(last) + horizon_steps, last)] - states[:-1]
    raise ValueError(f"end={end!r}: choose one of drop, clamp")


def cut_windows(episodes: Sequence[Episode], horizon_steps: int, end: str = "drop") -> Windows:
    """Cut whole episodes of one environment into windows, one beginning at each step.

    Raises:
        ValueError: without any episode, or as ``delta_states``.
    """
    if not episodes:
        raise ValueError("cut_windows needs at least one episode")
    deltas = [delta_states(episode.states, horizon_steps, end) for episode in episodes]
    counts = [len(delta) for delta in deltas]
    pairs = list(zip(episodes, counts, strict=True))
    return Windows(
        delta=np.concatenate(deltas),
        instruction=np.concatenate([episode.instructions[:count] for episode, count in pairs]),
        given=np.concatenate([episode.given[:count] for episode, count in pairs]).astype(bool),
        episode=np.repeat(np.arange(len(episodes)), counts),
        step=np.concatenate([np.arange(count) for count in counts]),
        horizon_steps=horizon_steps,
    )


def top_episodes(total_rewards: Array, fraction: float, contexts: Array | None = None) -> Array:
    """Find the best episodes (the paper's "top x").

    Args:
        total_rewards: ``(E,)``.
        fraction: x, the share to keep, in (0, 1]; rounded up to whole episodes.
        contexts: ``(E,)`` names; given, the share is taken within each of them, else over all.

    Returns:
        ``(E,)`` bool.

    Raises:
        ValueError: for a fraction outside (0, 1].
    """
    if not 0 < fraction <= 1:
        raise ValueError(f"top_fraction={fraction}: above 0 and at most 1")
    groups = np.zeros(len(total_rewards)) if contexts is None else np.asarray(contexts)
    best = np.zeros(len(total_rewards), dtype=bool)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        ranked = rows[np.argsort(-np.asarray(total_rewards)[rows], kind="stable")]
        best[ranked[: int(np.ceil(round(fraction * len(rows), 9)))]] = True
    return best


@dataclass(frozen=True)
class LoggedSteps:
    """All ``N`` steps of ``E`` episodes, good and bad; each is the beginning of a window of ``horizon_steps``.

    Attributes:
        states: ``(N, S)`` at the step.
        next_states: ``(N, S)`` one step later.
        delta: ``(N, S)`` change of the state over the window, which ends with the episode at the latest.
        instruction: ``(N, d)``, 0 in silence.
        given: ``(N,)`` bool, False in silence.
        complete: ``(N,)`` bool, whether the episode lasts to the end of the window.
        step: ``(N,)`` t.
        episode: ``(N,)`` index of the episode.
        window_return: ``(N,)`` sum of the rewards in the window.
        returns: ``(E,)`` total rewards.
        contexts: ``(E,)`` names.
        horizon_steps: n.
    """

    states: Array
    next_states: Array
    delta: Array
    instruction: Array
    given: Array
    complete: Array
    step: Array
    episode: Array
    window_return: Array
    returns: Array
    contexts: Array
    horizon_steps: int

    @classmethod
    def of(cls, episodes: Sequence[Episode], horizon_steps: int) -> LoggedSteps:
        """Join the steps of whole episodes of one environment; raises as ``cut_windows``."""
        windows = cut_windows(episodes, horizon_steps, "clamp")
        counts = [len(one) for one in episodes]
        reward_sums = [np.concatenate([[0.0], np.cumsum(one.rewards, dtype=float)]) for one in episodes]
        return cls(
            states=np.concatenate([one.states[:-1] for one in episodes]).astype(float),
            next_states=np.concatenate([one.states[1:] for one in episodes]).astype(float),
            delta=windows.delta.astype(float),
            instruction=windows.instruction.astype(float) * windows.given[:, None],
            given=windows.given,
            complete=windows.step + horizon_steps <= np.repeat(counts, counts),
            step=windows.step,
            episode=windows.episode,
            window_return=np.concatenate([delta_states(each, horizon_steps, "clamp") for each in reward_sums]),
            returns=np.array([one.total_reward for one in episodes]),
            contexts=np.array([one.context for one in episodes]),
            horizon_steps=horizon_steps,
        )

    def __len__(self) -> int:
        return len(self.states)

    @property
    def episode_count(self) -> int:
        """``E``."""
        return len(self.returns)

    def signs(self, number: int) -> Array:
        """Sign ``(N,)`` of one number of the instruction: -1, 0 or 1."""
        return np.sign(self.instruction[:, number])

    def last_heard(self, number: int) -> Array:
        """Last step ``(N,)`` of each window at which the instructor is heard; its first step if never again.

        Silence means 0 if the instructor never says 0.
        """
        heard = self.given | (not (self.signs(number)[self.given] == 0).any())
        rows = np.arange(len(self))
        ends = np.searchsorted(self.episode, self.episode, side="right") - 1
        newest = np.maximum.accumulate(np.where(heard, rows, 0))
        return np.maximum(newest[np.minimum(rows + self.horizon_steps, ends)], rows)

    def onsets(self, number: int) -> Array:
        """Steps ``(M,)`` with another sign than the step before, among pairs that both carry an instruction."""
        signs = self.signs(number)
        same = (np.diff(self.episode) == 0) & self.given[1:] & self.given[:-1]
        return np.flatnonzero(same & (np.diff(signs) != 0)) + 1
