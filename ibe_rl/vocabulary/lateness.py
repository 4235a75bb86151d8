"""How late those are who instruct a run, as the log tells at each refresh; their instructions are taken back by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delay import Delay, find_delay
from ibe_rl.instructors.taught import taught_episodes, taught_rows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Episode
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR, TEACHER, Delays

NEWEST_EPISODES = 400
SAME_STEPS = 3
"""A delay found anew that differs by no more leaves the earlier one as it is, within the new interval."""


def delays_of(log: TrajectoryLog, config: MappingConfig, last: Delays | None = None) -> dict[str, Delay]:
    """How late everybody is in the newest episodes of the log.

    Args:
        log: of the run.
        config: ``delay_steps`` may set it.
        last: what was found before; it changes only as far as the log says so.
    """
    if config.delay_steps is not None:
        return {who: Delay(config.delay_steps, config.delay_steps, config.delay_steps) for who in (TEACHER, INSTRUCTOR)}
    heard = {who: [one for one in said if np.any(one.given)] for who, said in _heard(log, config).items()}
    return {who: _changed((last or {}).get(who), find_delay(said)) for who, said in heard.items() if said}


def _heard(log: TrajectoryLog, config: MappingConfig) -> dict[str, Sequence[Episode]]:
    """The newest episodes of each of those who instruct."""
    taught = taught_rows(log)
    counted = np.ones(len(log.index), bool)
    if config.newest_frames is not None:
        counted = log.index["frame"] > log.frames - config.newest_frames
    counted[taught] = False
    heard: dict[str, Sequence[Episode]] = {INSTRUCTOR: log.read(np.flatnonzero(counted)[-NEWEST_EPISODES:])}
    if len(taught):
        heard[TEACHER], _ = taught_episodes(log, taught[-NEWEST_EPISODES:].tolist())
    return heard


def _changed(last: Delay | None, found: Delay) -> Delay:
    """The delay from now on: it does not jump to and fro, and it stays while the log does not tell."""
    if last is None or not last.known:
        return found
    if not found.known:
        return last
    near = abs(found.steps - last.steps) <= SAME_STEPS
    if not found.steps or not (near or (found.low <= last.high and last.low <= found.high)):
        return found
    steps = last.steps if near else round((last.steps + found.steps) / 2)
    return replace(found, steps=min(max(steps, found.low), found.high) if steps else 0)


def in_words(who: str, delay: Delay) -> str:
    """How late somebody is, in one sentence to a person or about an instructor."""
    you, are = ("you", "are") if who == TEACHER else ("the instructor", "is")
    if not delay.known:
        return f"how late {you} {are} cannot be told"
    if not delay.steps:
        return f"{you} {are} not late"
    steps = "step" if delay.steps == 1 else "steps"
    between = "" if delay.low == delay.high else f" ({delay.low} to {delay.high})"
    return f"{you} {are} about {delay.steps} {steps} behind{between}"


def lateness_lines(delays: Delays) -> list[str]:
    """A sentence for each of those who instruct."""
    return [in_words(who, delay) for who, delay in delays.items()]
