"""Start the runs of a sweep and report their outcomes; hydra's launcher calls this."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from ibe_rl.apps.ray.workers import check_address, check_installed
from ibe_rl.apps.sweep.board import Board, failures, outcomes_table, viewer_command
from ibe_rl.apps.sweep.jobs import DONE, DONE_BEFORE, FAILED, Job, key_of, plan
from ibe_rl.apps.sweep.processes import run_all
from ibe_rl.config.arguments import path_setting, quoted
from ibe_rl.config.command_line import command_on
from ibe_rl.config.kinds import check_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.instructors import is_live
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.runtime.installation import started_again
from ibe_rl.runtime.operating_system import usable_cores
from ibe_rl.runtime.printed import for_shell
from ibe_rl.types import ConfigError

VIEWER = ("viewer", "viewer.mode")
OUTCOMES_WIDTH = 100
"""Least columns of the table of outcomes."""
OF_THE_SWEEP = ("run_dir", "runs_at_once", "runs_on")
"""Settings that are not passed on to the runs."""


def launch(
    sweep: Path, asked: Sequence[Sequence[str]], settings: Sequence[TrainConfig], flags: Sequence[str], first: int = 0
) -> None:
    """Run the jobs that are not finished yet, each in its folder below ``sweep``.

    Args:
        sweep: the folder of the sweep.
        asked: the overrides of each run.
        settings: the config of each run.
        flags: flags of hydra, passed on to each run.
        first: number of the first run.

    Raises:
        ConfigError: before any start, if the settings of a run are refused.
        KeyboardInterrupt: if it was stopped; the runs can be resumed.
        SystemExit: with 1 if a run failed.
    """
    for overrides, cfg in zip(asked, settings, strict=True):
        refuse(overrides, cfg, sweep)
    console = PlainConsole(soft_wrap=True)
    recorded = any(cfg.viewer.mode == "live" for cfg in settings)
    extra = ["viewer=file"] if recorded else []
    jobs = plan(sweep, asked, [cfg.total_frames for cfg in settings], first)
    at_once = how_many(settings)
    console.print(f"{len(jobs)} runs, {at_once} at once, each in a folder of its own below {sweep}")
    if recorded:
        console.print(f"  they are recorded, not served; to watch them: {viewer_command(sweep)}")
    front = elsewhere(settings)
    outcomes = run_all(
        jobs, lambda job, goes_on: [*front, *command(job, goes_on, flags, extra)], at_once, Board(console)
    )
    console.width = max(console.width, OUTCOMES_WIDTH)
    console.print(outcomes_table(outcomes))
    for line in [*failures(outcomes), *sweep_hints(sweep)]:
        console.print(line)
    became = {outcome.became for outcome in outcomes}
    if not became <= {DONE, DONE_BEFORE, FAILED}:
        console.print(f"stopped; the same command with {for_shell(path_setting('run_dir', sweep))} resumes it")
        raise KeyboardInterrupt
    if FAILED in became:
        console.print(f"the same command with {for_shell(path_setting('run_dir', sweep))} repeats the failed runs")
        sys.exit(1)


def refuse(overrides: Sequence[str], cfg: TrainConfig, sweep: Path) -> None:
    """Refuse settings that cannot work, alone or among several runs at once.

    Raises:
        ConfigError: naming the setting.
    """
    check_config(cfg)
    if cfg.resume:
        raise ConfigError(
            f"resume={cfg.resume} in a sweep: allowed is the command that made the sweep once more, with run_dir=DIR, "
            f"the folder of the sweep (now {sweep}): it goes on with all its runs"
        )
    if cfg.viewer.mode == "live" and any(key_of(one) in VIEWER for one in overrides):
        raise ConfigError(
            f"viewer=live in a sweep: allowed is file or off; `{viewer_command(sweep)}` shows all of its runs"
        )
    if cfg.runs_on is not None:
        check_installed(f"runs_on={cfg.runs_on}", "null")
        check_address("runs_on", cfg.runs_on)
        if cfg.runs_at_once is None:
            raise ConfigError(f"runs_on={cfg.runs_on}: allowed only with runs_at_once, as many as the cluster takes")
    if is_live(cfg.instructor):
        raise ConfigError("instructor=human in a sweep: a person teaches one run; allowed is hydra/launcher=basic")


def how_many(settings: Sequence[TrainConfig]) -> int:
    """Number of runs at once: as set, or as many as have a core for each process."""
    for cfg in settings:
        if cfg.runs_at_once is not None:
            return cfg.runs_at_once
    return max(1, min(usable_cores() // processors(settings), len(settings)))


def processors(settings: Sequence[TrainConfig]) -> int:
    """Number of cores that a run can use."""
    return max(cfg.collect.processes + cfg.collect.overlap for cfg in settings)


def elsewhere(settings: Sequence[TrainConfig]) -> list[str]:
    """Prefix of a command that runs on a cluster; empty to run here."""
    on = settings[0].runs_on
    return [sys.executable, "-m", "ibe_rl.apps.ray.run", on, str(processors(settings))] if on else []


def command(job: Job, goes_on: bool, flags: Sequence[str], extra: Sequence[str]) -> list[str]:
    """The command that starts a run, or resumes it with its own settings."""
    given = [one for one in job.overrides if key_of(one) not in OF_THE_SWEEP]
    asked = [f"resume={quoted(str(job.folder))}"] if goes_on else [*given, *extra, f"run_dir={quoted(str(job.folder))}"]
    single = ["hydra.mode=RUN", f"hydra.job.name={quoted(job.name)}"]
    return [*started_again("train"), *flags, *asked, *single]


def sweep_hints(sweep: Path) -> list[str]:
    """Commands that show the runs together."""
    return [
        f"the runs are in {sweep}",
        f"  look at all of them:   {viewer_command(sweep)}",
        f"  a report of the sweep: {command_on(sweep, 'explain', 'sweep')}",
    ]
