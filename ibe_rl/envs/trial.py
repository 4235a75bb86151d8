"""A trial before training: a short episode in each way that the run will play it, and all functions of its task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs.errors import CopyError
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.envs.masks import sampled_action
from ibe_rl.envs.snapshots import step_games, stoppable
from ibe_rl.envs.wrappers import drawn, task_of
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError

TRIAL_STEPS = 60
"""Most steps of an episode of the trial."""
FIRST_STATES = 10
"""Episodes whose first state the rule is asked for."""
FARTHER_OUT = (1, 3, 10)
"""Factors by which states are moved from their mean before a rule counts as constant."""
FOLD = 1_000
"""Ratio of the numbers of a state from which learning is in doubt."""
NOTED_SHARE, REFUSED_SHARE = 1e-3, 0.05
"""Deviations of a roll-out, in ranges of the state, that are noted and that are refused."""


@dataclass(frozen=True)
class Played:
    """A short episode: ``T`` actions, ``(T + 1, S)`` states, and the snapshot at step ``cut`` if one was asked for."""

    actions: Sequence[Any]
    states: Array
    rewards: Sequence[float]
    cut: int = 0
    snapshot: Any = None


def try_out(config: EnvConfig, simulated: bool) -> list[str]:
    """Try an environment and the functions of its task.

    Args:
        config: of the environment.
        simulated: whether copies of it are stepped to predict in.

    Returns:
        Notes for the user on what may work, but not well.

    Raises:
        ConfigError: naming what cannot be used, and what is allowed.
    """
    env = make_env(config)
    task = task_of(env)
    first, other = play_briefly(env, seed=0), play_briefly(env, seed=1)
    for played in (first, other):
        _call(task, played.states)
    for part in ("background", "figure"):
        drawn(env, part)
    states = np.array([*first.states, *other.states, *(env.reset(seed=seed)[0] for seed in range(FIRST_STATES))])
    notes = [_not_repeated(config, first), _unequal(task, states), *_constant(task, states)]
    if simulated:
        notes.append(_try_copy(config, task))
    return [note for note in notes if note]


def play_briefly(
    env: gymnasium.Env[Any, Any], seed: int, actions: Sequence[Any] | None = None, snapshot_of: Any = None
) -> Played:
    """Play the beginning of an episode.

    Args:
        env: is reset.
        seed: of the episode and of random actions.
        actions: to play; None: random ones.
        snapshot_of: what to snapshot in the middle, of ``env``.
    """
    env.action_space.seed(seed)
    states, rewards, done = [env.reset(seed=seed)[0]], list[float](), False
    snapshot, cut, played = None, 0, list[Any]()
    for step in range(TRIAL_STEPS if actions is None else len(actions)):
        if snapshot_of is not None and step <= TRIAL_STEPS // 3:
            snapshot, cut = snapshot_of.snapshot(), step
        action = sampled_action(env.action_space, env) if actions is None else actions[step]
        played.append(action)
        state, reward, terminated, truncated, _ = env.step(_plain(action))
        states.append(state)
        rewards.append(float(reward))
        done = terminated or truncated
        if done:
            break
    return Played(played, np.array(states), rewards, cut, snapshot)


def _plain(action: Any) -> Any:
    return int(action) if isinstance(action, np.integer) else action


def _call(task: Task, states: Array) -> None:
    """Call all functions of states with those of an episode."""
    task.context(states[0])
    optional: Sequence[Callable[[Array], Any] | None] = (
        *(task.motion, task.goal_offset),
        *(task.scene_path, task.first_contact),
    )
    for function in optional:
        if function is not None:
            function(states)
    together = task.rule(states)
    for row in (0, len(states) // 2, len(states) - 1):
        alone = task.rule(states[[row]])[0]
        if not np.allclose(alone, together[row]):
            raise ConfigError(
                f"{getattr(task.rule, 'label', 'task.rule')}: for the state {states[row].tolist()} it returned "
                f"{alone.tolist()}, but {together[row].tolist()} together with other states; allowed is a rule that "
                "reads each state alone"
            )


def _not_repeated(config: EnvConfig, first: Played) -> str:
    again = play_briefly(make_env(config), 0, first.actions)
    if np.array_equal(again.states, first.states) and again.rewards == first.rewards:
        return ""
    return f"{config.id} ignores the seed: two episodes with the same seed and actions differ, runs cannot be repeated"


def _unequal(task: Task, states: Array) -> str:
    """A note if some numbers are much larger than others; those that are always 0 do not count."""
    largest = np.abs(states).max(axis=0)
    seen = np.flatnonzero(largest)
    if not len(seen) or largest[seen].max() < FOLD * largest[seen].min():
        return ""
    high, low = seen[largest[seen].argmax()], seen[largest[seen].argmin()]
    return (
        f"the numbers of a state differ {largest[high] / largest[low]:,.0f}-fold: {task.state_names[high]} reaches "
        f"{largest[high]:.3g}, {task.state_names[low]} {largest[low]:.3g}"
    )


def _constant(task: Task, states: Array) -> list[str]:
    """Notes on numbers of the rule that never change, here nor in states farther out."""
    mean = states.mean(axis=0)
    farther = np.concatenate([(mean + factor * (states - mean)).astype(states.dtype) for factor in FARTHER_OUT])
    said = task.rule(farther)
    return [
        f"the rule says {said[0, number]:g} of {name} in all {len(states)} states tried: unless it says something else "
        "later on, its words cannot be learnt"
        for number, name in enumerate(task.number_names)
        if np.all(said[:, number] == said[0, number])
    ]


def _try_copy(config: EnvConfig, task: Task) -> str:
    """Take up a copy of an environment in the middle of an episode.

    Returns:
        A note if it goes on a little differently; empty if it does not.

    Raises:
        CopyError: if it cannot be copied, or goes on quite differently.
    """
    env, copy = make_env(config), make_snapshot_env(config)
    played = play_briefly(env, 0, snapshot_of=stoppable(env))
    copy.reset(seed=1)
    copy.restore(played.snapshot)
    rolled = []
    for action in played.actions[played.cut :]:
        state, *_ = step_games([copy], [_plain(action)])
        rolled.append(state[0])
    off = np.abs(np.array(rolled) - played.states[played.cut + 1 :]).max(axis=0)
    share = off / np.maximum(np.ptp(played.states, axis=0), np.finfo(np.float32).tiny)
    share[off == 0] = 0.0
    worst = int(share.argmax())
    if share[worst] <= NOTED_SHARE:
        return ""
    found = f"{len(rolled)} steps after a snapshot its {task.state_names[worst]} is off by {off[worst]:.3g}"
    if share[worst] > REFUSED_SHARE:
        raise CopyError(config.id, f"{found}, so it cannot be rolled out")
    return f"{config.id} cannot be copied exactly: {found}"
