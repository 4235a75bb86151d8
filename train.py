"""Train an agent that explains itself while it learns, in the words it was taught with.

environment → batch → agent
                └───→ log → vocabulary → explanations → rerun

python train.py                                  with the defaults, served live
python train.py agent=dqn seed=3 viewer=file
python train.py -m seed=0,1,2                    three runs
python train.py resume=DIR                       go on with a run that was stopped or killed
python train.py experiment=paper                 train, then the paper's experiments: figures/report.html
python train.py --cfg job                        every setting
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from importlib.metadata import version
from pathlib import Path
from traceback import format_exception
from typing import Any

import numpy as np
from torchrl import timeit

from ibe_rl.apps.paper.experiments import reproduce
from ibe_rl.apps.teach import Classroom, NoClassroom, choose_port, open_classroom
from ibe_rl.collect.collector import EVALUATION_SEED, Every, Rarer, batches, make_collector, refresh_interval, steps_of
from ibe_rl.collect.rollout import play, watch
from ibe_rl.config.command_line import is_sweep, output_folder, run_script, save_config
from ibe_rl.config.settings import ExplainConfig, TrainConfig
from ibe_rl.envs.make import make_game, task_of
from ibe_rl.explain.explainer import explain, hold
from ibe_rl.ibe import TooLittleDataError
from ibe_rl.metrics import outcomes
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.storage.checkpoint import BETWEEN, save_policy
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import (
    CHECKPOINTS,
    RECORDING,
    REFRESHES,
    SUMMARY,
    create_run_folder,
    hold_folder,
    write_atomically,
    write_json,
)
from ibe_rl.training.failure import nothing_lost
from ibe_rl.training.parts import (
    NOBODY,
    Parts,
    ask_otherwise,
    begin,
    build,
    check_parts,
    resumable,
    save_state,
    timed,
    times,
    whole_state,
)
from ibe_rl.training.progress import closing_table, how_to_open, recent_mean
from ibe_rl.training.resume import State, clear_way, must_fit, take_up
from ibe_rl.view.recording_file import set_back
from ibe_rl.view.relay import News, choose_ports, page, serve_live
from ibe_rl.vocabulary.rule_reads import check_dimensions, lead_on
from ibe_rl.vocabulary.tracker import figures

WATCH_SEED = EVALUATION_SEED + 50_000
PACKAGES = ("ibe_rl", "torch", "torchrl", "tensordict", "gymnasium", "scikit-learn", "rerun-sdk")


def train(
    cfg: TrainConfig,
    folder: Path,
    stop: StopRequest,
    owned: ExitStack,
    live: News = list,
    classroom: Classroom | NoClassroom = NOBODY,
    state: State | None = None,
) -> dict[str, Any]:
    """Run the loop; returns the summary.

    Args:
        cfg: the composed and checked config.
        folder: of the run.
        stop: becomes true when the run shall end early.
        owned: closes what has been opened, in any case.
        live: what there is to say of the live view, each line once.
        classroom: where a person teaches, if one does.
        state: that the run goes on from; None: it begins.
    """
    start = time.perf_counter()
    timeit.erase()
    with timeit("setup"):
        parts = build(cfg, folder, owned, classroom, state)
        owned.enter_context(nothing_lost(folder, parts.log.flush, lambda: parts.log.frames))
        start -= parts.counts.wall_s
        made_from = cfg.env, cfg.collect, parts.task, cfg.instructor, cfg.seed
        collector = make_collector(parts.agent, *made_from, parts.classroom.open_lesson, parts.under_way)
        owned.callback(collector.shutdown)
        owned.callback(parts.classroom.farewell)
        patience_s = None if parts.classroom.open_lesson else cfg.collect.timeout_s  # a person may pause the game
        ahead = cfg.collect.overlap, cfg.collect.ahead_batches, patience_s
        source = owned.enter_context(closing(batches(collector, parts.agent, *ahead)))
        owned.callback(parts.classroom.hurry)
        stop.when_asked(parts.classroom.hurry)
        begin(parts, state)
    owned.enter_context(resumable(parts, lambda: time.perf_counter() - start))
    agent, log = parts.agent, parts.log
    often = refresh_interval(cfg), cfg.eval_every_frames, cfg.checkpoint_every_frames
    refresh_due, evaluation_due, checkpoint_due = map(Every, often, 3 * [log.frames])
    keeping_due = Rarer(cfg.keep_policy_every_frames, log.frames)
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
        refreshed, evaluated = refresh_due(log.frames, last), evaluation_due(log.frames, last)
        if refreshed:
            row |= refresh_and_explain(cfg, parts)  # episodes → vocabulary → words → rerun
        keep = keeping_due(log.frames)
        if evaluated:
            row |= evaluate(cfg, parts)
        elif keep:
            with timeit("checkpoint"):
                save_policy(folder / CHECKPOINTS, log.frames, agent.greedy.state_dict(), BETWEEN)
        with timeit("stream"):
            parts.table.write(row | {f"time/{name}": seconds for name, seconds in times(parts.counts).items()})
            parts.recorder.batch(log.frames, row)
            parts.progress.batch(log.frames, log.frames / (time.perf_counter() - start), row)
            parts.classroom.batch(row, agent.greedy)
            parts.progress.say_all(parts.recorder.news() + live())
        if last:
            break
        if checkpoint_due(log.frames) or refreshed or evaluated:
            with timeit("checkpoint"):
                save_state(parts, whole_state(parts, time.perf_counter() - start))  # to resume from
    return finish(cfg, parts, row, lambda: time.perf_counter() - start, stopped=bool(stop))


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
        with parts.development.all_or_nothing():
            with timeit("refresh"):
                horizon_steps = parts.development.settle(parts.log)
            with timeit("explain"):
                parts.foresee()
                reactions = ask_otherwise(cfg, parts, horizon_steps)
            with timeit("refresh"):
                refresh = parts.development.refresh(parts.log, policy, reactions)
                parts.development.save(parts.folder / REFRESHES, refresh)
    except OSError:
        raise  # the disk's, which everything else writes to as well
    except Exception as error:
        return skip(cfg, parts, error)
    counts = parts.counts
    counts.refreshes += refresh.taken
    counts.kept += not refresh.taken
    with timeit("explain"):
        watched = watch(parts.watched_env, policy, parts.instructor, WATCH_SEED + counts.refreshes + counts.kept)
        voice, every = parts.development.voice(cfg.predictor.futures, cfg.min_confidence), cfg.explain_every_steps
        said = hold(explain(watched.moments[::every], policy, parts.predictor, voice), every, len(watched.moments))
        row = figures(refresh) | parts.development.judge(refresh, watched.episode, said, every)
    with timeit("stream"):
        parts.recorder.refresh(refresh)
        real = outcomes(watched.episode, voice.horizon_steps, voice.mapping, voice.words)
        parts.recorder.watched(frames, watched, said, real)
        parts.classroom.refresh(frames, voice)
        parts.progress.horizon(refresh)
        parts.progress.refreshed(counts.refreshes, refresh, said[-1].said, row["ibe/came_true"], parts.task)
    return row


def skip(cfg: TrainConfig, parts: Parts, error: Exception) -> dict[str, float]:
    """Go on with the vocabulary before, whatever was wrong with a new one."""
    frames, reason = parts.log.frames, str(error)
    if not isinstance(error, TooLittleDataError):
        path = parts.folder / REFRESHES / f"failed_{frames:012d}.txt"
        write_atomically(path, lambda stream: stream.write("".join(format_exception(error)).encode()))
        reason = f"it failed ({type(error).__name__}: {' '.join(reason.split())[:200]}), the details are in {path}"
    parts.counts.skipped += 1
    if parts.development.mapping is None and cfg.instructor.kind != "silent":
        reason += lead_on(cfg.mapping, parts.counts.skipped)
    parts.recorder.skipped(frames, reason)
    parts.progress.skipped(frames, reason)
    return {"ibe/skipped": parts.counts.skipped}


def evaluate(cfg: TrainConfig, parts: Parts) -> dict[str, float]:
    """Fly the greedy policy on seeds that are never trained on, and keep its weights."""
    with timeit("eval"):
        seeds = range(EVALUATION_SEED, EVALUATION_SEED + cfg.eval_episodes)
        episodes = play(parts.evaluation_envs, parts.agent.greedy, parts.instructor, seeds)
    with timeit("checkpoint"):
        save_policy(parts.folder / CHECKPOINTS, parts.log.frames, parts.agent.greedy.state_dict())
    success, total = (float(np.mean(of)) for of in zip(*((e.success, e.total_reward) for e in episodes), strict=True))
    best = parts.counts
    if (success, total) > (best.best_success, best.best_return):
        best.best_success, best.best_return, best.best_frames = success, total, parts.log.frames
    return {"eval/return_mean": total, "eval/success_rate": success}


def finish(
    cfg: TrainConfig, parts: Parts, row: dict[str, float], wall_s: Callable[[], float], stopped: bool
) -> dict[str, Any]:
    """Close the recording and write the summary; the last state follows: killed before, the run is not at its end."""
    state = whole_state(parts, wall_s())
    with timeit("stream"):
        parts.recorder.close()
        parts.progress.say_all(parts.recorder.news())
    summary = summarise(cfg, parts, row, wall_s(), stopped)
    write_json(parts.folder / SUMMARY, summary)
    save_state(parts, state)
    return summary


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
        "horizon_steps": parts.development.horizon_steps,
        "refreshes": parts.counts.refreshes,
        "refreshes_kept": parts.counts.kept,
        "refreshes_skipped": parts.counts.skipped,
        "stopped_early": stopped,
        "meaning": [one.to_dict() for one in parts.development.mapping.meanings] if parts.development.mapping else [],
        "notes": list(parts.development.notes),
        "time_s": dict(times(parts.counts)),
        "seed": cfg.seed,
        "agent": cfg.agent.kind,
        "mapping": cfg.mapping.kind,
        "versions": {name: version(name) for name in PACKAGES},
    }


def main(cfg: TrainConfig) -> None:
    """Refuse what cannot work before anything is made, train, say how to look at it again, report if that is wanted."""
    cfg, state = take_up(cfg) if cfg.resume else (cfg, None)
    env = make_game(cfg.env)
    check_parts(cfg, task_of(env), env.action_space)
    for note in check_dimensions(cfg.mapping, task_of(env), env):
        print(note)
    if not task_of(env).judges_success:
        print(f"note: nobody says whether an episode of {cfg.env.id} ended well, so that none counts as a success")
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    lesson_port = choose_port(cfg.instructor)
    folder = Path(cfg.run_dir) if state else create_run_folder(output_folder(cfg.run_dir))
    with StopRequest() as stop, hold_folder(folder):
        if state:
            print(clear_way(folder, state))
            if state["recorder"] and cfg.viewer.mode != "off":
                with must_fit(folder):
                    set_back(folder / RECORDING, state["recorder"]["recorder"]["bytes"])
        save_config(cfg, folder / ".hydra", goes_on=bool(state))
        with ExitStack() as owned:
            live = serve_live(folder / RECORDING, ports, owned, print) if ports else list
            classroom = open_classroom(cfg, env, lesson_port, folder, page(ports) if ports else None)
            owned.callback(classroom.close)
            summary = train(cfg, folder, stop, owned, live, classroom, state)
        closing_table(summary)
        print(*how_to_open(folder, is_sweep()), sep="\n")
    if cfg.report and not stop:
        reproduce(ExplainConfig(run=str(folder), task="figures", predictor=cfg.predictor, viewer=cfg.viewer))
    if stop and is_sweep():
        raise KeyboardInterrupt  # the runs that were to follow are not wanted either


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "train")
