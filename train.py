"""Train an agent that explains itself in its instructor's words while it learns.

environment → batch → agent
                └───→ log → vocabulary → explanations → rerun

python train.py                                  with the defaults, served live
python train.py agent=dqn seed=3 viewer=file
python train.py -m seed=0,1,2                    three runs
python train.py resume=DIR                       resume a run that was stopped or killed
python train.py experiment=paper                 train, then the paper's experiments: figures/report.html
python train.py --cfg job                        every setting

The path of a transition from the engine to rerun, below ibe_rl/ (checked by tests/test_spine.py):

    envs/gate.py            step            the engine (envs/lander.py) advances, and what it gives is checked
    instructors/oracle.py   instruct        the expert gives an instruction
    envs/instructed_envs.py _step           many environments step as one, with the instruction in the observation
    collect/collector.py    __next__        their steps become a batch
    agents/ppo.py           update          the agent learns from it
    storage/log.py          add             its steps become logged episodes
    ibe/estimator.py        fit             state changes of the best episodes are clustered, each cluster expressed
    vocabulary/tracker.py   refresh         the new vocabulary is compared with the previous one
    collect/rollout.py      record_rollout  the greedy policy rolls out an episode
    predict/simulator.py    rollout         its future is simulated from moments of that episode
    explain/explainer.py    narrate         the vocabulary expresses these futures in words
    view/run_recorder.py    refreshed       rerun displays them
"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # first: the workers' imports take as long as those of this script
    from ibe_rl.runtime.workers import preload_workers

    preload_workers(sys.argv[1:])

from pathlib import Path
from typing import Any

from torchrl import timeit

from ibe_rl.collect.collector import steps_of
from ibe_rl.collect.rollout import EVALUATION_SEED, play, record_rollout
from ibe_rl.config.command_line import is_sweep, run_script
from ibe_rl.config.settings import ExplainConfig, TrainConfig
from ibe_rl.evaluation.runs import open_trained
from ibe_rl.explain.explainer import narrate
from ibe_rl.runtime.apps import load_app
from ibe_rl.training.build import build
from ibe_rl.training.progress import closing_table, how_to_open
from ibe_rl.training.refreshing import asking_of, judge_and_tell, learn, skip
from ibe_rl.training.run import Run
from ibe_rl.training.summary import evaluation_row, summarise, training_row

WATCH_SEED = EVALUATION_SEED + 50_000


def train(run: Run) -> dict[str, Any]:
    """Run the loop; returns the summary."""
    log, agent = run.log, run.agent
    for batch in run.batches:  # environment → batch
        with timeit("learn"):
            losses = run.reward.add(batch, log.frames)  # did it follow the instruction?
            losses |= agent.update(batch)  # batch → weights
        with timeit("log"):
            log.add(steps_of(batch), run.task.context)  # batch → episodes
        last, row = run.ends(), training_row(log, losses)
        if run.refresh_due(log.frames, last):
            row |= refresh_and_explain(run)  # episodes → vocabulary → words
        if run.evaluation_due(log.frames, last):
            row |= evaluate(run)
        run.tell.batch(log.frames, row)  # → table, rerun, terminal, page, checkpoints
        if last:
            break
    summary = summarise(run, row)
    run.tell.end(summary)
    return summary


def refresh_and_explain(run: Run) -> dict[str, float]:
    """Learn the vocabulary again, roll out one greedy episode and explain it step by step."""
    cfg, policy = run.cfg, run.agent.greedy
    if not run.last:
        run.collect_next()  # meanwhile, in the workers
    try:
        refresh = learn(run)  # episodes → vocabulary
    except OSError:
        raise  # of the disk, which everything else writes to as well
    except Exception as error:
        return skip(run, error)
    with timeit("explain"):
        rollout = record_rollout(run.env, policy, run.instructor, WATCH_SEED + run.counts.tried)
        explainer = run.vocabulary.explainer_state(cfg.predictor.futures, cfg.min_confidence, asking_of(cfg, run.task))
        said = narrate(rollout.moments, policy, run.predictor, explainer, cfg.explain_every_steps)
    return judge_and_tell(run, refresh, rollout, said, explainer)  # words → rerun


def evaluate(run: Run) -> dict[str, float]:
    """Roll out the greedy policy on held-out seeds."""
    with timeit("eval"):
        seeds = range(EVALUATION_SEED, EVALUATION_SEED + run.cfg.eval_episodes)
        row = evaluation_row(play(run.evaluation_envs, run.agent.greedy, run.instructor, seeds))
    success_rate, return_mean = row["eval/success_rate"], row["eval/return_mean"]
    run.counts.evaluated(run.log.frames, success_rate, return_mean)
    run.tell.evaluated(run.log.frames, success_rate, return_mean)
    return row


def main(cfg: TrainConfig) -> None:
    """Check the settings before anything is made, train, print how to view the run, report if asked to."""
    with build(cfg) as run:
        summary = train(run)
    closing_table(summary, run.notes)
    print(*how_to_open(run.folder, is_sweep()), sep="\n")
    cfg = run.cfg  # with resume, the run's own
    if cfg.report and not run.stop:
        settings = ExplainConfig(run=str(run.folder), task="figures", predictor=cfg.predictor, viewer=cfg.viewer)
        load_app("task=figures")(open_trained(settings.run), settings)
    if run.stop and is_sweep():
        raise KeyboardInterrupt  # ends the remaining runs too


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "train")
