"""Builds a run from its settings and closes its parts in order, however it ends."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from inspect import isclass
from pathlib import Path
from typing import Any

import torch
from threadpoolctl import threadpool_limits
from torchrl import timeit

from ibe_rl.agents import make_agent
from ibe_rl.collect.collector import Batches, apart, make_collector, timed
from ibe_rl.config.command_line import has_default_name, output_folder, run_name
from ibe_rl.config.kinds import make_several
from ibe_rl.config.saved import save_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.errors import CopyError
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_stand_in
from ibe_rl.predict import make_predictor
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.runtime.workers import preload_workers
from ibe_rl.storage.folder_lock import hold_folder
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import (
    METRICS,
    RECORDING,
    TRAJECTORIES,
    MetricsTable,
)
from ibe_rl.storage.whole_folder import begun_folder
from ibe_rl.training.check import check_columns, check_run
from ibe_rl.training.failure import nothing_lost, resumable
from ibe_rl.training.fitting_predictor import with_learned_predictor
from ibe_rl.training.instruction_reward import make_instruction_reward
from ibe_rl.training.listeners import LATER_COLUMNS, Checkpoints, Listeners, LiveView, Standardised, Table
from ibe_rl.training.mirroring import with_mirror
from ibe_rl.training.progress import TrainingProgress
from ibe_rl.training.resume import Resumption, clear_way, take_up
from ibe_rl.training.run import Run
from ibe_rl.training.state import State, must_fit
from ibe_rl.training.success_note import SuccessNote
from ibe_rl.types import ConfigError
from ibe_rl.view.address import choose_ports, page
from ibe_rl.view.recording_file import set_back
from ibe_rl.view.relay import serve_live, wants_browser
from ibe_rl.view.run_recorder import RunRecorder
from ibe_rl.vocabulary.listener import Listener, Metric
from ibe_rl.vocabulary.tracker import VocabularyTracker
from ibe_rl.vocabulary.words import save_words, take_up_words


@contextmanager
def build(
    cfg: TrainConfig,
    *,
    listeners: Sequence[Listener] = (),
    metrics: Sequence[Any] = (),
    resumption: Resumption | None = None,
) -> Iterator[Run]:
    """Build a run and close it in the end; settings that cannot work are refused before anything is created.

    Args:
        cfg: composed and checked; with ``resume`` the run continues from its checkpoint.
        listeners: objects to notify, beside those of the settings.
        metrics: objects that add columns at each refresh, beside those of the settings.
        resumption: with ``resume``, what a program changes (``ibe_rl.resume``); None: the command line counts.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    _refuse_classes(listeners=listeners, metrics=metrics)
    cfg, state = take_up(cfg, resumption) if cfg.resume else (cfg, None)
    env = make_env(cfg.env)
    cfg, notes = _checked(cfg, env, goes_on=bool(state))
    if apart(cfg.collect):
        preload_workers()
    for note in notes:
        print(f"note: {note}")  # noqa: T201 - for the user
    listeners = [*make_several("listener", cfg.listeners), *listeners, *make_several("logger", cfg.loggers)]
    metrics = _metrics(cfg, metrics)
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    teach = load_app("instructor=human") if cfg.instructor.kind == "human" else None
    page_port = teach.choose_port(cfg.instructor) if teach else None
    opened = nullcontext(Path(cfg.run_dir)) if state else begun_folder(output_folder(cfg.run_dir), has_default_name())
    with opened as folder, threadpool_limits(1), StopRequest() as stop, hold_folder(folder):
        if state:
            _restore_folder(cfg, folder, state)
        if has_default_name():
            cfg = replace(cfg, run_dir=str(folder))
        save_config(cfg, folder / ".hydra", goes_on=bool(state))
        with ExitStack() as owned:
            browser = wants_browser(cfg.viewer.open)
            live = serve_live(folder / RECORDING, ports, owned, print, browser) if ports else list
            classroom = None
            if teach:
                classroom = teach.open_classroom(cfg, env, page_port, folder, page(ports) if ports else None)
                owned.callback(classroom.close)
            yield _begin(cfg, folder, stop, owned, [LiveView(live), *listeners], metrics, classroom, state, notes)


def _checked(cfg: TrainConfig, env: Any, goes_on: bool) -> tuple[TrainConfig, list[str]]:
    """The settings, in a new run with what the environment decides; and notes for the user."""
    if not goes_on:
        cfg = with_mirror(cfg, task_of(env), env.action_space)
    try:
        return cfg, check_run(cfg, env)
    except CopyError as error:
        if goes_on:
            raise
        cfg, notes = with_learned_predictor(cfg, env, error)
        return cfg, [*notes, *check_run(cfg, env)]


def _metrics(cfg: TrainConfig, given: Sequence[Any]) -> list[Any]:
    """The metrics of the settings, and those that a program gives."""
    made = zip(cfg.metrics, make_several("metric", cfg.metrics), strict=True)
    named = [*made, *((type(one).__name__, one) for one in given)]
    check_columns(named)
    return [metric for _, metric in named]


def _refuse_classes(**given: Sequence[Any]) -> None:
    for key, objects in given.items():
        for one in objects:
            if isclass(one):
                raise ConfigError(f"{key}=[{one.__name__}]: a class; allowed are objects, {one.__name__}(...)")


def _restore_folder(cfg: TrainConfig, folder: Path, state: State) -> None:
    """Restore the folder to the time of the checkpoint."""
    print(clear_way(folder, state))  # noqa: T201 - for the user
    if state["recorder"] and cfg.viewer.mode != "off":
        with must_fit(folder):
            set_back(folder / RECORDING, state["recorder"]["recorder"]["bytes"])


def _begin(
    cfg: TrainConfig,
    folder: Path,
    stop: StopRequest,
    owned: ExitStack,
    listeners: Sequence[Listener],
    metrics: Sequence[Metric],
    classroom: Any,
    state: State | None,
    notes: list[str],
) -> Run:
    """Make all parts and notify the listeners of the start."""
    timeit.erase()
    started_s = time.perf_counter()
    with timeit("setup"):
        run = make_parts(cfg, folder, owned, stop, state)
        run.started_s, run.metrics, run.notes = started_s, list(metrics), notes
        take_up_words(folder, run.task)
        if run.task.words is not None:
            save_words(folder, run.task.words)
        owned.enter_context(nothing_lost(folder, run.log.flush, lambda: run.log.frames))
        progress = owned.enter_context(TrainingProgress(cfg.total_frames))
        columns = [*LATER_COLUMNS, *(name for metric in run.metrics for name in metric.columns)]
        table = owned.enter_context(MetricsTable(folder / METRICS, columns, _kept_frames(state)))
        optional = [one for one in (run.recorder, progress, classroom) if one is not None]
        checkpoints = Checkpoints(folder, cfg.checkpoint_every_frames, cfg.keep_policy_every_frames)
        run.say = progress.say
        run.tell = Listeners(
            [Table(table), Standardised(), *optional, *listeners, SuccessNote(), checkpoints], progress.say
        )
        owned.callback(run.tell.close)
        _collect(run, owned, classroom)
        run.tell.begin(run)
        if state:
            with must_fit(folder):
                run.random.load_state_dict(state["random"])  # last: making the parts draws numbers
    owned.enter_context(resumable(run))
    gc.freeze()  # all of this lives as long as the run: looking through it took .3 s at each refresh
    owned.callback(gc.unfreeze)
    return run


def _kept_frames(state: State | None) -> int | None:
    return (state["frames"] or None) if state else None  # at 0 frames the table may not exist yet


def _collect(run: Run, owned: ExitStack, classroom: Any) -> None:
    """Start the collector; a human instructor may pause it."""
    cfg = run.cfg
    lesson = classroom.open_lesson if classroom else None
    collector = make_collector(
        run.agent,
        env=cfg.env,
        collect=cfg.collect,
        task=run.task,
        instructor=cfg.instructor,
        seed=cfg.seed,
        lesson=lesson,
        partial_episodes=run.partial_episodes,
    )
    owned.callback(collector.shutdown)
    if classroom:
        owned.callback(classroom.farewell)
    source = Batches(
        collector,
        run.agent,
        overlap=cfg.collect.overlap,
        ahead_batches=cfg.collect.ahead_batches,
        timeout_s=None if lesson else cfg.collect.timeout_s,
    )
    owned.enter_context(closing(source))
    run.batches = timed("collect", _once_taught(run, classroom, source) if classroom else source)
    run.collect_next = source.collect_next
    if classroom:
        owned.callback(classroom.hurry)
        run.stop.when_asked(classroom.hurry)


def _once_taught(run: Run, classroom: Any, source: Iterable[Any]) -> Iterator[Any]:
    """The same batches, once the teacher is there."""
    classroom.wait_for_teacher(lambda: bool(run.stop), run.say)
    yield from source


def make_parts(cfg: TrainConfig, folder: Path, owned: ExitStack, stop: StopRequest, state: State | None = None) -> Run:
    """Make the parts that neither collect nor listen.

    Args:
        cfg: of the run.
        folder: of the run.
        owned: closes what is opened here.
        stop: true once the run should end early.
        state: to resume from; the caller restores the RNG state.

    Raises:
        ConfigError: if the state does not fit the settings or the folder.
    """
    torch.set_num_threads(1)
    torch.manual_seed(cfg.seed)
    env = make_env(cfg.env)
    task = task_of(env)
    vocabulary = VocabularyTracker(cfg.mapping, task, cfg.seed, cfg.refresh_when_stale)
    recorder = _recorder(cfg, folder, task, owned, state)
    log = TrajectoryLog(folder / TRAJECTORIES, cfg.log.capacity_frames, task.contexts)
    snapshots = partial(make_snapshot_env, cfg.env)
    predictor = make_predictor(cfg.predictor, snapshots, task.rule, cfg.seed, env, lambda: vocabulary.horizons_steps)
    run = Run(
        cfg=cfg,
        folder=folder,
        stop=stop,
        task=task,
        agent=make_agent(
            cfg.agent,
            task.observation_size,
            env.action_space,
            cfg.total_frames,
            task.state_names,
            task.parts,
            task.mirror,
        ),
        reward=make_instruction_reward(
            cfg, task, lambda: vocabulary.horizons_steps, vocabulary.mapping_of, lambda: vocabulary.delays
        ),
        log=log,
        vocabulary=vocabulary,
        predictor=owned.enter_context(closing(predictor)),
        instructor=make_stand_in(cfg.instructor, task, cfg.seed, log),
        env=env,
        evaluation_envs=[make_env(cfg.env) for _ in range(min(cfg.eval_episodes, 100))],
        recorder=recorder,
    )
    if state:
        run.load_state_dict(state)
    return run


def _recorder(cfg: TrainConfig, folder: Path, task: Any, owned: ExitStack, state: State | None) -> RunRecorder | None:
    if cfg.viewer.mode == "off":
        return None
    name, max_mb = run_name(folder), cfg.viewer.max_recording_mb
    with must_fit(folder) if state else nullcontext():
        recorder = RunRecorder(folder / RECORDING, task, name, max_mb, state and state["recorder"])
    owned.callback(recorder.close)
    return recorder
