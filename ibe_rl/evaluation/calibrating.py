"""How sure an agent that was trained elsewhere can be, from a few episodes that its vocabulary was not learnt from."""

from __future__ import annotations

from ibe_rl.config.settings import ExplainConfig
from ibe_rl.envs.snapshots import make_copy
from ibe_rl.evaluation.moments import Plan, gather
from ibe_rl.evaluation.rollouts import seeds_for
from ibe_rl.evaluation.run_predictor import predictor_of, with_processes
from ibe_rl.evaluation.runs import TrainedRun
from ibe_rl.evaluation.verbalise import calibrate, speak
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics import Calibration
from ibe_rl.predict import is_learnt
from ibe_rl.types import ConfigError

EPISODES, STRIDE_STEPS = 12, 12
"""A few hundred moments."""


def first_calibration(run: TrainedRun, cfg: ExplainConfig) -> Calibration | None:
    """The calibration that stands until ``task=evaluate``, which takes more episodes.

    Args:
        run: with its policy and its vocabulary.
        cfg: how it is explained.

    Returns:
        None where the future cannot be predicted exactly, or nothing was ever said.
    """
    if is_learnt(cfg.predictor) or not _can_be_copied(run):
        return None
    plan = Plan(STRIDE_STEPS, cfg.predictor.futures, (run.horizon_steps,))
    instructor = make_instructor(stand_in(run.config.instructor), run.task)
    seeds = seeds_for("held_out", cfg.evaluate.seed, EPISODES)
    with predictor_of(run, with_processes(cfg.predictor, 1), cfg.evaluate.seed) as predictor:
        about = run.task, run.policy, instructor, predictor, seeds, plan
        moments = gather(run.make_env, *about, "how sure it can be").judged()
    return calibrate(speak(run.mapping, moments, run.horizon_steps, run.task.phrases)) if len(moments) else None


def _can_be_copied(run: TrainedRun) -> bool:
    try:
        make_copy(run.config.env)
    except ConfigError:
        return False
    return True
