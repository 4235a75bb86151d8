"""Runs the cases, each in a process of its own."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import torch
from threadpoolctl import threadpool_limits

from benchmarks.meaning.judge import Verdict, judge
from benchmarks.meaning.learning import learn
from benchmarks.meaning.situations import situations
from ibe_rl.ibe import TooLittleDataError

PROCESSES = 2
Case = tuple[str, int]
"""Name of a situation, and seed."""


def run_all(cases: Sequence[Case], cache: Path | None) -> list[Verdict]:
    """Judge several cases, two at once; see ``judged``."""
    with ProcessPoolExecutor(min(PROCESSES, len(cases)), get_context("spawn")) as pool:
        return list(pool.map(partial(judged, cache=cache), cases))


def judged(case: Case, cache: Path | None = None) -> Verdict:
    """Play the episodes of a situation, learn the vocabulary, judge it; ``cache`` as in ``Situation.make``."""
    name, seed = case
    torch.set_num_threads(1)
    with threadpool_limits(1):
        situation = situations()[name]
        trial = situation.make(seed, cache)
        try:
            return judge(learn(trial, seed), trial, situation.truth)
        except TooLittleDataError as error:
            return Verdict("silent", float("nan"), 0.0, str(error))
