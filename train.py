"""Train an agent that explains itself while it learns, in the words it was taught with.

environment → batch → agent
                └───→ log → vocabulary → explanations → rerun

python train.py                                  with the defaults, served live
python train.py agent=dqn seed=3 viewer=file
python train.py -m seed=0,1,2                    three runs
python train.py resume=DIR                       go on with a run that was stopped or killed
python train.py experiment=paper                 train, then the paper's experiments: figures/report.html
python train.py --cfg job                        every setting

The way of a transition from the engine to rerun, below ibe_rl/ (tests/test_spine.py follows it):

    envs/lander.py          step            the engine moves
    instructors/oracle.py   instruct        the expert says what to do next
    envs/make.py            _step           many environments become one, with the instruction in the observation
    collect/collector.py    batches         their steps become a batch
    agents/ppo.py           update          the agent learns from it
    storage/log.py          add             its steps become logged episodes
    ibe/estimator.py        fit             state changes of the best episodes are clustered, each gets an expression
    vocabulary/tracker.py   refresh         the new vocabulary is held against the one before
    collect/rollout.py      record_rollout  the greedy policy plays an episode
    predict/simulator.py    rollout         and is followed into its future from moments of it
    explain/explainer.py    explain         the vocabulary puts these futures into words
    view/run_recorder.py    refreshed       rerun shows them
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from torchrl import timeit

from ibe_rl.collect.collector import steps_of
from ibe_rl.collect.rollout import EVALUATION_SEED, play, record_rollout
from ibe_rl.config.command_line import is_sweep, run_script
from ibe_rl.config.settings import ExplainConfig, TrainConfig
from ibe_rl.evaluation.runs import open_run
from ibe_rl.explain.explainer import explain, hold
from ibe_rl.runtime.apps import load_app
from ibe_rl.training.build import build
from ibe_rl.training.progress import closing_table, how_to_open
from ibe_rl.training.refreshing import judge_and_tell, learn, skip
from ibe_rl.training.run import Run
from ibe_rl.training.summary import evaluation_row, summarise, training_row

WATCH_SEED = EVALUATION_SEED + 50_000


def train(run: Run) -> dict[str, Any]:
    """Run the loop; returns the summary."""
    log, agent = run.log, run.agent
    for batch in run.batches:  # environment → batch
        with timeit("learn"):
            losses = run.reward.add(batch, log.frames)  # did it do what it was told?
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
    """Learn the vocabulary anew, roll out one greedy episode and explain it step by step."""
    cfg, policy = run.cfg, run.agent.greedy
    try:
        refresh = learn(run)  # episodes → vocabulary
    except OSError:
        raise  # the disk's, which everything else writes to as well
    except Exception as error:
        return skip(run, error)
    with timeit("explain"):
        rollout = record_rollout(run.env, policy, run.instructor, WATCH_SEED + run.counts.tried)
        voice, every = run.vocabulary.voice(cfg.predictor.futures, cfg.min_confidence), cfg.explain_every_steps
        said = hold(explain(rollout.moments[::every], policy, run.predictor, voice), every, len(rollout.moments))
    return judge_and_tell(run, refresh, rollout, said, voice)  # words → rerun


def evaluate(run: Run) -> dict[str, float]:
    """Roll out the greedy policy on seeds that are never trained on."""
    with timeit("eval"):
        seeds = range(EVALUATION_SEED, EVALUATION_SEED + run.cfg.eval_episodes)
        row = evaluation_row(play(run.evaluation_envs, run.agent.greedy, run.instructor, seeds))
    success_rate, return_mean = row["eval/success_rate"], row["eval/return_mean"]
    run.counts.evaluated(run.log.frames, success_rate, return_mean)
    run.tell.evaluated(run.log.frames, success_rate, return_mean)
    return row


def main(cfg: TrainConfig) -> None:
    """Refuse what cannot work before anything is made, train, say how to look at it again, report if that is wanted."""
    with build(cfg) as run:
        summary = train(run)
    closing_table(summary)
    print(*how_to_open(run.folder, is_sweep()), sep="\n")
    cfg = run.cfg  # with resume those of the run
    if cfg.report and not run.stop:
        settings = ExplainConfig(run=str(run.folder), task="figures", predictor=cfg.predictor, viewer=cfg.viewer)
        load_app("task=figures")(open_run(settings.run), settings)
    if run.stop and is_sweep():
        raise KeyboardInterrupt  # the runs that were to follow are not wanted either


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "train")
