"""Train an agent that explains itself while it learns, in the words it was taught with.

environment → batch → agent
                └───→ log → vocabulary → explanations → rerun

python train.py                                  with the defaults, served live
python train.py agent=dqn seed=3 viewer=file
python train.py -m seed=0,1,2                    three runs
python train.py experiment=paper                 train, then the paper's experiments: figures/report.html
python train.py --cfg job                        every setting
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl import timeit

from ibe_rl.agent import Agent, check_agent, make_agent
from ibe_rl.checkpoint import BETWEEN, save_latest, save_policy
from ibe_rl.classroom import Classroom, NoClassroom, choose_port, open_classroom
from ibe_rl.collect import EVALUATION_SEED, Every, batches, check_collect, make_collector, steps_of
from ibe_rl.command_line import installed, is_sweep, output_folder, run_name, run_script, save_config
from ibe_rl.config import ExplainConfig, TrainConfig
from ibe_rl.data import Instructor, Predictor, Task
from ibe_rl.development import FIGURES, Development, check_development, figures
from ibe_rl.env.make import make_gym, task_of
from ibe_rl.explainer import explain, hold
from ibe_rl.ibe import TooLittleDataError
from ibe_rl.instruct import check_instructor, make_instructor, stand_in
from ibe_rl.log import TrajectoryLog
from ibe_rl.metrics import happened
from ibe_rl.obedience import Obedience, check_obedience, make_obedience
from ibe_rl.paper.experiments import reproduce
from ibe_rl.paper.lab import check_report
from ibe_rl.play import play, watch
from ibe_rl.predict import make_simulator
from ibe_rl.progress import TrainingProgress, closing_table, recent_mean
from ibe_rl.run_folder import (
    CHECKPOINTS,
    METRICS,
    RECORDING,
    REFRESHES,
    SUMMARY,
    TRAJECTORIES,
    MetricsTable,
    create_run_folder,
    write_json,
)
from ibe_rl.serve.relay import Ports, Relay, choose_ports, invitation, page
from ibe_rl.signals import StopRequest
from ibe_rl.stream import NoRecorder, RunRecorder

LATER_COLUMNS = (
    "eval/return_mean",
    "eval/success_rate",
    *FIGURES,
    "ibe/skipped",
)
"""Columns of metrics.csv that only some rows fill."""
WATCH_SEED = EVALUATION_SEED + 50_000
TIMES = ("setup", "collect", "learn", "log", "refresh", "explain", "stream", "eval", "checkpoint")
News = Callable[[], list[str]]
NOBODY = NoClassroom()
PACKAGES = ("ibe_rl", "torch", "torchrl", "tensordict", "gymnasium", "scikit-learn", "rerun-sdk")


def train(
    cfg: TrainConfig,
    folder: Path,
    stop: StopRequest,
    owned: ExitStack,
    live: News = list,
    classroom: Classroom | NoClassroom = NOBODY,
) -> dict[str, Any]:
    """Run the loop; returns the summary.

    Args:
        cfg: the composed and checked config.
        folder: of the run, empty.
        stop: becomes true when the run shall end early.
        owned: closes what has been opened, in any case.
        live: what there is to say of the live view, each line once.
        classroom: where a person teaches, if one does.
    """
    start = time.perf_counter()
    timeit.erase()
    with timeit("setup"):
        parts = build(cfg, folder, owned, classroom)
        lesson = parts.classroom.open_lesson
        collector = make_collector(parts.agent, cfg.env, cfg.collect, parts.task, cfg.instructor, cfg.seed, lesson)
        owned.callback(collector.shutdown)
        owned.callback(parts.classroom.farewell)
        ahead = cfg.collect.overlap, cfg.collect.ahead_batches
        source = owned.enter_context(closing(batches(collector, parts.agent, *ahead)))
        owned.callback(parts.classroom.hurry)
        stop.when_asked(parts.classroom.hurry)
    agent, log = parts.agent, parts.log
    refresh_due, evaluation_due = Every(cfg.refresh_every_frames), Every(cfg.eval_every_frames)
    keeping_due = Every(cfg.keep_policy_every_frames)
    last = False

    for batch in timed("collect", source):  # environment → batch
        with timeit("learn"):
            losses = parts.obedience.add(batch, log.frames)  # did it do what it was told?
            losses |= agent.update(batch)  # batch → learner
        with timeit("log"):
            log.add(steps_of(batch), parts.task.context)  # batch → episodes
        last = bool(stop) or log.frames >= min(cfg.total_frames, cfg.stop_after_frames or cfg.total_frames)
        if stop:
            parts.progress.say("stopping in order, with a last refresh and evaluation; Ctrl-C again ends at once")
        row = training_row(log, losses)
        if refresh_due(log.frames, last):
            row |= refresh_and_explain(cfg, parts)  # episodes → vocabulary → words → rerun
        keep = keeping_due(log.frames)
        if evaluation_due(log.frames, last):
            row |= evaluate(cfg, parts)
        elif keep:
            with timeit("checkpoint"):
                save_policy(folder / CHECKPOINTS, log.frames, agent.greedy.state_dict(), BETWEEN)
        with timeit("stream"):
            parts.table.write(row | times())
            parts.recorder.batch(log.frames, row)
            parts.progress.batch(log.frames, log.frames / (time.perf_counter() - start), row)
            parts.classroom.batch(row, agent.greedy)
            parts.progress.say_all(parts.recorder.news() + live())
        if last:
            break
    with timeit("stream"):
        parts.recorder.close()
        parts.progress.say_all(parts.recorder.news())
    return summarise(cfg, parts, row, time.perf_counter() - start, stopped=bool(stop))


@dataclass
class Parts:
    """What the loop works with; none of the parts knows another."""

    task: Task
    agent: Agent
    instructor: Instructor
    predictor: Predictor
    log: TrajectoryLog
    recorder: RunRecorder | NoRecorder
    watched_env: gymnasium.Env[Any, Any]
    evaluation_envs: list[gymnasium.Env[Any, Any]]
    classroom: Classroom | NoClassroom
    progress: TrainingProgress
    table: MetricsTable
    folder: Path
    development: Development
    obedience: Obedience
    refreshes: int = 0
    kept: int = 0
    skipped: int = 0


def build(cfg: TrainConfig, folder: Path, owned: ExitStack, classroom: Classroom | NoClassroom) -> Parts:
    """Make the parts from their settings."""
    torch.set_num_threads(1)
    torch.manual_seed(cfg.seed)
    make_one = partial(make_gym, cfg.env.id, cfg.env.kwargs)
    env = make_one()
    task = task_of(env)
    development = Development(cfg.mapping, task, cfg.seed, cfg.refresh_when_stale)
    max_mb, record = cfg.viewer.max_recording_mb, cfg.viewer.mode != "off"
    recorder = RunRecorder(folder / RECORDING, task, run_name(folder), max_mb) if record else NoRecorder()
    owned.callback(recorder.close)
    return Parts(
        task=task,
        agent=make_agent(cfg.agent, task.observation_size, env.action_space, cfg.total_frames, task.state_names),
        instructor=make_instructor(stand_in(cfg.instructor), task, cfg.seed),
        predictor=owned.enter_context(closing(make_simulator(cfg.predictor, make_one, task.rule, cfg.seed))),
        log=TrajectoryLog(folder / TRAJECTORIES, cfg.log.capacity_frames, task.contexts),
        recorder=recorder,
        watched_env=env,
        evaluation_envs=[make_one() for _ in range(min(cfg.eval_episodes, 100))],
        classroom=classroom,
        progress=owned.enter_context(TrainingProgress(cfg.total_frames)),
        table=owned.enter_context(MetricsTable(folder / METRICS, LATER_COLUMNS)),
        folder=folder,
        development=development,
        obedience=make_obedience(cfg, task, development),
    )


def timed(name: str, endless: Iterator[TensorDictBase]) -> Iterator[TensorDictBase]:
    """Count the time spent waiting for each batch under ``name``."""
    while True:
        with timeit(name):
            batch = next(endless)
        yield batch


def times() -> dict[str, float]:
    """Seconds spent so far, one ``time/`` column each."""
    seconds = timeit.todict(percall=False)
    return {f"time/{name}": seconds.get(name, 0.0) for name in TIMES}


def training_row(log: TrajectoryLog, losses: dict[str, float]) -> dict[str, float]:
    """The columns that every row of metrics.csv has; means are over the newest 100 episodes."""
    index = log.index
    means = {
        "train/return_mean": recent_mean(index["total_reward"], 100),
        "train/success_rate": recent_mean(index["success"], 100),
        "train/episode_steps": recent_mean(index["steps"], 100),
    }
    return {"frames": log.frames} | means | {f"train/{name}": loss for name, loss in losses.items()}


def refresh_and_explain(cfg: TrainConfig, parts: Parts) -> dict[str, float]:
    """Learn the vocabulary anew, fly one greedy episode and explain it step by step."""
    frames, policy = parts.log.frames, parts.agent.greedy
    try:
        with timeit("refresh"):
            refresh = parts.development.refresh(parts.log, policy)
            parts.development.save(parts.folder / REFRESHES, refresh)
    except TooLittleDataError as reason:
        parts.skipped += 1
        parts.recorder.skipped(frames, str(reason))
        parts.progress.skipped(frames, str(reason))
        return {"ibe/skipped": parts.skipped}
    parts.refreshes += refresh.taken
    parts.kept += not refresh.taken
    with timeit("explain"):
        watched = watch(parts.watched_env, policy, parts.instructor, WATCH_SEED + parts.refreshes + parts.kept)
        voice, every = parts.development.voice(cfg.predictor.futures, cfg.min_confidence), cfg.explain_every_steps
        said = hold(explain(watched.moments[::every], policy, parts.predictor, voice), every, len(watched.moments))
        row = figures(refresh) | parts.development.judge(refresh, watched.episode, said, every)
    with timeit("stream"):
        parts.recorder.refresh(refresh)
        real = happened(watched.episode, voice.horizon_steps, voice.mapping, voice.words)
        parts.recorder.watched(frames, watched, said, real)
        parts.classroom.refresh(frames, voice)
        parts.progress.refreshed(parts.refreshes, refresh, said[-1].said, row["ibe/came_true"])
    return row


def evaluate(cfg: TrainConfig, parts: Parts) -> dict[str, float]:
    """Fly the greedy policy on seeds that are never trained on, and keep its weights."""
    with timeit("eval"):
        seeds = range(EVALUATION_SEED, EVALUATION_SEED + cfg.eval_episodes)
        episodes = play(parts.evaluation_envs, parts.agent.greedy, parts.instructor, seeds)
    with timeit("checkpoint"):
        save_policy(parts.folder / CHECKPOINTS, parts.log.frames, parts.agent.greedy.state_dict())
        save_latest(parts.folder / CHECKPOINTS, {"agent": parts.agent.state_dict(), "frames": parts.log.frames})
        parts.log.flush()
    success = float(np.mean([episode.success for episode in episodes]))
    return {"eval/return_mean": float(np.mean([e.total_reward for e in episodes])), "eval/success_rate": success}


def summarise(cfg: TrainConfig, parts: Parts, row: dict[str, float], wall_s: float, stopped: bool) -> dict[str, Any]:
    """What summary.json holds."""
    return {
        "frames": parts.log.frames,
        "wall_s": wall_s,
        "frames_per_s": parts.log.frames / wall_s,
        "episodes": parts.log.episodes_ended,
        "success_rate": row["eval/success_rate"],
        "return_mean": row["eval/return_mean"],
        "evaluation_episodes": cfg.eval_episodes,
        "refreshes": parts.refreshes,
        "refreshes_kept": parts.kept,
        "refreshes_skipped": parts.skipped,
        "stopped_early": stopped,
        "time_s": {name.removeprefix("time/"): seconds for name, seconds in times().items()},
        "seed": cfg.seed,
        "agent": cfg.agent.kind,
        "mapping": cfg.mapping.kind,
        "versions": {name: version(name) for name in PACKAGES},
    }


def main(cfg: TrainConfig) -> None:
    """Refuse what cannot work before anything is made, train, say how to look at it again, report if that is wanted."""
    env = make_gym(cfg.env.id, cfg.env.kwargs)
    check_collect(cfg.collect)
    check_agent(cfg.agent, task_of(env).state_names)
    check_instructor(cfg.instructor, cfg.collect, task_of(env))
    check_development(cfg, task_of(env))
    check_obedience(cfg, task_of(env))
    check_report(cfg, task_of(env))
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    lesson_port = choose_port(cfg.instructor)
    folder = create_run_folder(output_folder(cfg.run_dir))
    save_config(cfg, folder / ".hydra")
    with StopRequest() as stop:
        with ExitStack() as owned:
            live = serve(folder / RECORDING, ports, owned) if ports else list
            classroom = open_classroom(cfg, env, lesson_port, folder, page(ports) if ports else None)
            owned.callback(classroom.close)
            summary = train(cfg, folder, stop, owned, live, classroom)
            write_json(folder / SUMMARY, summary)
        closing_table(summary)
        say_how_to_open(folder)
    if cfg.report and not stop:
        reproduce(ExplainConfig(run=str(folder), task="figures", predictor=cfg.predictor, viewer=cfg.viewer))
    if stop and is_sweep():
        raise KeyboardInterrupt  # the runs that were to follow are not wanted either


def serve(recording: Path, ports: Ports, owned: ExitStack) -> News:
    """Start the process that serves the recording while it grows; without it training goes on all the same."""
    try:
        relay = owned.enter_context(Relay(recording, ports))
    except RuntimeError as reason:
        print(f"warning: no live view, the recording is written all the same: {reason}")
        return list
    print(invitation(ports))
    return relay.news


def say_how_to_open(folder: Path) -> None:
    """Print how to look at the run again."""
    print(f"the run is in {folder}")
    print(f"  look at it again:     {installed('python')} -m ibe_rl.viewer {folder}")
    if is_sweep():
        print(f"  beside the others:    {installed('python')} -m ibe_rl.viewer {folder.parent}")
    print(f"  one episode in words: {installed('python')} explain.py run={folder}")


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "train")
