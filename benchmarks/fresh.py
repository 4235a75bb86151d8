"""Success of a finished run on episodes that the training has not seen; runs in a child process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from ibe_rl.collect.rollout import JUDGING_SEED, play
from ibe_rl.evaluation.runs import load_run
from ibe_rl.instructors import make_instructor

AT_ONCE = 100


def success(folder: str, episodes: int) -> float:
    """The share of ``episodes`` in which the last evaluated policy of the run in ``folder`` succeeds.

    The episodes of a training's own evaluations are the same for all runs, and on the lander easier than most.
    """
    torch.set_num_threads(1)
    run = load_run(Path(folder))
    instructor = make_instructor(run.config.instructor, run.task)
    envs = [run.make_env() for _ in range(min(AT_ONCE, episodes))]
    flown = play(envs, run.policy, instructor, range(JUDGING_SEED, JUDGING_SEED + episodes))
    return float(np.mean([episode.success for episode in flown]))
