"""The training data of a vocabulary: the best episodes of the log, and the instructions in good and bad ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delay import caught_up
from ibe_rl.ibe.delta import Windows, cut_windows, top_episodes
from ibe_rl.ibe.horizon import find_horizon, instruction_lasts, leading_change
from ibe_rl.ibe.space import TooLittleDataError, rule_axes
from ibe_rl.instructors.taught import taught_rows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode
from ibe_rl.vocabulary.lateness import delays_of
from ibe_rl.vocabulary.persons import PersonsShare, persons_episodes
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR, TEACHER, Delays

OTHER_EPISODES = 300
"""Most episodes outside the best that are read, for comparison and for their instructions."""
HEARD_STATES = 5_000
AXIS_EPISODES, HEARD_AXIS_STATES = 100, 2_000
"""Episodes and states used to find the horizon."""


@dataclass(frozen=True)
class TrainingEpisodes:
    """Episodes of a log.

    Attributes:
        logged: episodes in the log.
        counted: those that the best were chosen from.
        best: the best of these, oldest first.
        heard: an unbiased sample of those counted, used for its instructions only.
        others: those of the sample that are not among the best.
        persons: what of it a person said; None where nobody teaches.
        delays: how late the instructions were, which are taken back by it.
    """

    logged: int
    counted: int
    best: Sequence[Episode]
    heard: Sequence[Episode]
    others: Sequence[Episode]
    persons: PersonsShare | None = None
    delays: Delays = field(default_factory=dict)


def read_training_episodes(
    log: TrajectoryLog, config: MappingConfig, seed: int, delays: Delays | None = None
) -> TrainingEpisodes:
    """Choose episodes of the log and read them, with what was said at the steps that it was about.

    What a person said counts first, however long ago: alone once it suffices, before that with a weight. ``delays``
    are how late everybody was; None: as the log tells.

    Raises:
        TooLittleDataError: if no recent episode has ended.
    """
    delays = delays_of(log, config) if delays is None else delays
    taught, late = taught_rows(log), delays.get(INSTRUCTOR)
    persons = persons_episodes(log, taught, config) if len(taught) else None
    if persons:
        persons = persons.caught_up(delays.get(TEACHER))
    if persons and persons.suffice:
        heard, rest, share = [*persons.rest, *persons.best], persons.rest, persons.share([])
        return TrainingEpisodes(len(log.index), len(taught), persons.best, heard, rest, share, delays)
    counted, is_best = _ranked(log, config)
    random = np.random.default_rng(seed)
    others = caught_up(log.read(random.permutation(counted[~is_best])[:OTHER_EPISODES]), late)
    best = caught_up(log.read(counted[is_best]), late)
    share = len(best) / max(1, np.sum(~is_best))
    some = random.permutation(len(best))[: max(1, round(share * len(others)))] if others else range(len(best))
    heard = [*others, *(best[row] for row in some)]
    if persons is None:
        return TrainingEpisodes(len(log.index), len(counted), best, heard, others, None, delays)
    share = persons.share(best)
    best = [*best, *share.weight * [*persons.best]]
    heard += share.weight * [*persons.rest, *persons.best]
    return TrainingEpisodes(len(log.index), len(counted), best, heard, others, share, delays)


def _ranked(log: TrajectoryLog, config: MappingConfig) -> tuple[Array, Array]:
    """Rows ``(C,)`` of the episodes that count, and which of them ``(C,)`` bool are the best."""
    index = log.index
    if not len(index):
        raise TooLittleDataError("no episode has ended yet")
    counted = _counted(index["frame"], log.frames, config.newest_frames)
    groups = log.context_names[counted] if config.top_within == "context" else None
    return counted, top_episodes(index["total_reward"][counted], config.top_fraction, groups)


def _counted(ended_at: Array, frames: int, newest_frames: int | None) -> Array:
    counted = np.flatnonzero(ended_at > (-1 if newest_frames is None else frames - newest_frames))
    if not len(counted):
        raise TooLittleDataError(f"no episode has ended in the newest {newest_frames:,} frames")
    return counted


def settled(config: MappingConfig, found_steps: int) -> MappingConfig:
    """The config with the found n and only shorter spans; unchanged where n is set."""
    if config.horizon_steps is not None:
        return config
    shorter = [steps for steps in config.spans_steps if steps < found_steps]
    return replace(config, horizon_steps=found_steps, spans_steps=shorter)


def horizon_line(steps: int) -> str:
    """One line for a user who did not set n."""
    next_steps = "next step" if steps == 1 else f"next {steps} steps"
    return f"explains the {next_steps}, as long as movements last here; mapping.horizon_steps sets it"


def find_steps(log: TrajectoryLog, config: MappingConfig, task: Task, seed: int, delays: Delays | None = None) -> int:
    """Find the horizon to explain in a log; ``horizon_steps`` itself where that is set.

    The duration of movements (``find_horizon``), at most that of an instruction (``instruction_lasts``). ``delays`` as
    in ``read_training_episodes``.

    Raises:
        TooLittleDataError: if no recent episode has ended.
    """
    if config.horizon_steps is not None:
        return config.horizon_steps
    counted, is_best = _ranked(log, config)
    random = np.random.default_rng(seed)
    best = log.read(random.permutation(counted[is_best])[:AXIS_EPISODES])
    late = (delays_of(log, config) if delays is None else delays).get(INSTRUCTOR)
    heard = caught_up(log.read(random.permutation(counted)[:AXIS_EPISODES]), late)
    states = [episode.states for episode in best]
    kept = np.array([not config.dimensions or name in config.dimensions for name in task.state_names])
    steps = find_horizon(states, _instruction_axes(heard, seed, kept, leading_change(states, kept)))
    return min(steps, instruction_lasts([episode.instructions for episode in best]) or steps)


def _instruction_axes(heard: Sequence[Episode], seed: int, kept: Array, otherwise: Array) -> Array:
    """The axes ``(S, d)`` of the instructions in the ``kept`` dimensions; ``otherwise`` if there are none."""
    try:
        states, instructions = (some[:HEARD_AXIS_STATES] for some in instructed_states(heard, seed))
        axes = rule_axes(states, instructions, seed) * kept[:, None] if len(states) else otherwise
    except TooLittleDataError:
        return otherwise
    reached = np.any(axes, axis=0)
    return axes[:, reached] if reached.any() else otherwise


def instructed_windows(episodes: Sequence[Episode], config: MappingConfig, horizon_steps: int) -> Windows | None:
    """Windows that begin with an instruction, without failed ends if these are dropped; None without episodes."""
    if not episodes:
        return None
    windows = cut_windows(episodes, horizon_steps, config.window_end)
    kept = np.asarray(windows.given)
    if config.failed_ends == "drop":
        failed = np.array([episode.terminated and not episode.success for episode in episodes])
        steps = np.array([len(episode) for episode in episodes])
        kept = kept & ~(failed[windows.episode] & (windows.step + horizon_steps >= steps[windows.episode]))
    return windows[kept]


def best_windows(best: Sequence[Episode], config: MappingConfig, horizon_steps: int) -> Windows:
    """The windows to learn a vocabulary from.

    Raises:
        TooLittleDataError: if there are none.
    """
    windows = instructed_windows(best, config, horizon_steps)
    if not windows:
        longest = max((len(episode) for episode in best), default=0)
        raise TooLittleDataError(
            f"the best {len(best)} episodes have no window of {horizon_steps} steps with an instruction "
            f"(the longest has {longest} steps)"
        )
    return windows


def instructed_states(heard: Sequence[Episode], seed: int) -> tuple[Array, Array]:
    """A sample of states ``(N, S)`` with an instruction, and these instructions ``(N, d)``."""
    given = np.concatenate([episode.given for episode in heard]).astype(bool)
    states = np.concatenate([episode.states[:-1] for episode in heard])[given]
    instructions = np.concatenate([episode.instructions for episode in heard])[given]
    rows = np.random.default_rng(seed).permutation(len(states))[:HEARD_STATES]
    return states[rows], instructions[rows]
