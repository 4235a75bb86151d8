"""What the kinds of predictor cost, and what they are worth for a policy that the log does not know.

python -m benchmarks.foreseeing RUN              explanations a second, over the same moments and in one process
python -m benchmarks.foreseeing RUN 250000       what was learnt at the end, for the policy of that frame (minutes)

RUN is a finished run with its log. Seconds are of the processor, so that what else the machine does counts as little
as it can.
"""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.explaining import watched_moments
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig, PredictorConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.evaluation.baselines import fit_state_regressors
from ibe_rl.evaluation.predictors import Age, judge_age
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.runs import kept_policies, kept_refreshes, load_run
from ibe_rl.evaluation.tables import console, predictors_table
from ibe_rl.evaluation.trained_run import TrainedRun, open_log
from ibe_rl.ibe import phrases_of
from ibe_rl.predict import KeptPredictor, make_predictor
from ibe_rl.predict.ensemble import EnsembleConfig
from ibe_rl.predict.regression import RegressionConfig
from ibe_rl.storage.checkpoint import BETWEEN, EVALUATED
from ibe_rl.types import Moment

KINDS: dict[str, PredictorConfig] = {
    "simulator": PredictorConfig(),
    "ensemble": EnsembleConfig(),
    "regression": RegressionConfig(),
}
ROUNDS = 3


def rates(run: str, moments: int, exact_moments: int) -> dict[str, float]:
    """Explanations a second of each kind, the best of a few rounds in turn, and seconds of learning.

    Args:
        run: folder of a run with its log.
        moments: how many are explained by what was learnt; more of them fill whole blocks.
        exact_moments: how many of them in copies of the environment.
    """
    torch.set_num_threads(1)
    opened = load_run(Path(run))
    chosen = watched_moments(opened, moments)
    found = {}
    made = {kind: _made(opened, config) for kind, config in KINDS.items()}
    for kind, (_, seconds) in made.items():
        found[f"{kind}_learns_s"] = seconds
    for _ in range(ROUNDS):
        for kind, (predictor, _) in made.items():
            these = chosen[:: max(1, moments // exact_moments)] if kind == "simulator" else chosen
            rate = len(these) / _seconds(opened, predictor, these)
            found[kind] = max(rate, found.get(kind, 0.0))
    return found


def _made(run: TrainedRun, config: PredictorConfig) -> tuple[KeptPredictor, float]:
    copy = partial(make_snapshot_env, run.config.env)
    predictor = make_predictor(config, copy, run.task.rule, 0, run.make_env(), lambda: [run.horizon_steps])
    start = time.process_time()
    predictor.learn(open_log(run.folder))
    return predictor, time.process_time() - start


def _seconds(run: TrainedRun, predictor: KeptPredictor, moments: list[Moment]) -> float:
    """Of predicting all moments together and putting the changes into words."""
    start = time.process_time()
    say(run, predictor, moments)
    return time.process_time() - start


def say(run: TrainedRun, predictor: KeptPredictor, moments: list[Moment]) -> Any:
    """Phrases ``(N,)`` of one future of each moment."""
    predicted = predictor.rollout(moments, run.policy, run.horizon_steps)
    change = np.ascontiguousarray(predicted.paths[:, -1]) - predicted.paths[:, 0]
    return phrases_of(run.mapping.express(change), run.task.phrases)


def for_another_policy(run: TrainedRun, frame: int, config: EvaluateConfig) -> list[dict[str, Any]]:
    """Rows of ``task=predictors``: predictors as of the end of the training, the policy as of a frame before."""
    torch.set_num_threads(1)
    kept = kept_policies(run, EVALUATED, BETWEEN)
    at = min(kept, key=lambda one: abs(one - frame))
    newest = list(kept_refreshes(run).values())[-1]
    age = Age(newest, at, kept[at], config.episodes, config.calibration_episodes)
    lessons = Refits(run, config.seed).lessons(run.config.mapping)
    regressors = fit_state_regressors(lessons.heard, run.horizon_steps, run.task, config.seed)
    return judge_age(run, age, KINDS, regressors, ExplainConfig(predictor=PredictorConfig(), evaluate=config))


def main(arguments: list[str]) -> None:
    """Measure and print."""
    run = arguments[0]
    if len(arguments) > 1:
        config = EvaluateConfig(episodes=40, calibration_episodes=12, stride_steps=8, resamples=200)
        rows = for_another_policy(load_run(Path(run)), int(arguments[1]), config)
        title = f"{Path(run).name}, learnt by frame {rows[0]['frame']:,}, policy of frame {rows[0]['policy_frame']:,}"
        console().print(predictors_table(rows, title))
        return
    found = rates(run, 10_240, 600)
    for kind in KINDS:
        learns, ratio = found[f"{kind}_learns_s"], found[kind] / found["simulator"]
        sys.stdout.write(f"{kind}: {found[kind]:,.0f} explanations/s, {ratio:.0f} x; learns in {learns:.1f} s\n")


if __name__ == "__main__":
    main(sys.argv[1:])
