"""The runs behind the documents' tables, made anew: default trainings, what is measured of them, and the tables.

python -m benchmarks.documents                         ten trainings and all tables: hours; again: it goes on
python -m benchmarks.documents --only truth words      some of the steps
python -m benchmarks.documents --quick --output DIR    tiny, for nothing but to see that it works; without words
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from rich.console import Console

from benchmarks import instruction, tutorial
from benchmarks import robustness as flawed
from benchmarks.child import ONE_THREAD
from benchmarks.plan import ROOT
from benchmarks.run_arguments import with_output
from benchmarks.same_runs import DQN, SMALL
from ibe_rl.apps.sweep.board import Board, failures
from ibe_rl.apps.sweep.jobs import FAILED, RUN_FINISHED, Job, state_of
from ibe_rl.apps.sweep.processes import run_all
from ibe_rl.config.arguments import path_setting
from ibe_rl.config.settings import TrainConfig
from ibe_rl.runtime.console import PlainConsole

console = Console(highlight=False, soft_wrap=True)
FOLDER = ROOT / "runs" / "results"
SETTINGS = {"ppo": ("collect.processes=1", "collect.envs_per_process=128"), "dqn": ()}
"""Beside the defaults: as many environments as by default, in one process, so that two trainings fit side by side."""
QUICK = {agent: (*SMALL, "mapping.horizon_steps=60", *more) for agent, more in {"ppo": (), "dqn": DQN[1:]}.items()}
SEEDS = (5, 6, 7, 8, 9)
"""On 0 to 4 choices were made."""
FEWER = 3
"""So many PPO runs are corrupted, told in words and trained anew with flawed instructors."""


@dataclass(frozen=True)
class Asked:
    """What is asked for.

    Attributes:
        agents: that are trained, "ppo" or "dqn".
        seeds: of each of them.
        folder: of the runs.
        output: for all else that is written; None: where it is in the repository.
        quick: tiny.
        at_once: trainings side by side.
    """

    agents: tuple[str, ...]
    seeds: tuple[int, ...]
    folder: Path
    output: Path | None
    quick: bool
    at_once: int

    def runs(self) -> list[Path]:
        """The folders of all runs."""
        return [self.folder / f"{agent}{seed}" for agent, seed in product(self.agents, self.seeds)]

    def few(self) -> list[Path]:
        """The folders of the first PPO runs."""
        return [self.folder / f"ppo{seed}" for seed in self.seeds[:FEWER]]

    def options(self, *quick: str) -> list[str]:
        """For the other benchmarks: where they write to, and what makes them ``quick``."""
        return [*(["--output", str(self.output)] if self.output else []), *(quick if self.quick else [])]


def main(arguments: list[str] | None = None) -> None:
    """Do the steps that are asked for, in their order."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.documents", description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=list(STEPS), default=list(STEPS), help="these steps")
    parser.add_argument("--agents", nargs="+", choices=list(SETTINGS), default=list(SETTINGS))
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS, help="of the default trainings")
    parser.add_argument("--at-once", type=int, default=2, help="trainings side by side")
    parser.add_argument("--folder", type=Path, help="of the runs, instead of runs/results or OUTPUT/runs")
    given = with_output(parser, arguments)
    if given.at_once < 1:
        parser.error(f"--at-once={given.at_once}: allowed is at least 1")
    output = given.output.absolute() if given.output else None
    folder = (given.folder or (output / "runs" if output else FOLDER)).absolute()
    asked = Asked(tuple(given.agents), tuple(given.seeds), folder, output, given.quick, given.at_once)
    for name in (name for name in STEPS if name in given.only):
        title, step = STEPS[name]
        console.print(f"{name}: {title}")
        step(asked)


def train(asked: Asked) -> None:
    """Train what is not finished; what was begun is resumed.

    Raises:
        SystemExit: if a training failed or was stopped.
    """
    settings = QUICK if asked.quick else SETTINGS
    jobs = [
        Job(run.name, run, (f"agent={agent}", f"seed={seed}", *settings[agent]), TrainConfig.total_frames)
        for run, (agent, seed) in zip(asked.runs(), product(asked.agents, asked.seeds), strict=True)
    ]
    outcomes = run_all(jobs, training, asked.at_once, Board(PlainConsole()))
    if FAILED in {one.became for one in outcomes}:
        raise SystemExit("\n".join(failures(outcomes)))
    refuse_unfinished(asked.runs())


def training(job: Job, goes_on: bool) -> list[str]:
    """The command of a training, begun or resumed."""
    how = [path_setting("resume", job.folder)] if goes_on else [*job.overrides, path_setting("run_dir", job.folder)]
    return [sys.executable, str(ROOT / "train.py"), *how, "viewer=off"]


def refuse_unfinished(runs: Iterable[Path]) -> None:
    """See that all runs are finished.

    Raises:
        SystemExit: naming the first that is not.
    """
    for run in runs:
        if state_of(run) != RUN_FINISHED:
            raise SystemExit(f"{run}: not a finished run; allowed is one that was trained to its end (--only train)")


def with_all_runs(name: str) -> Callable[[Asked], None]:
    """The step that calls a benchmark with all runs; those of truth and paper leave out what was measured."""

    def step(asked: Asked) -> None:
        refuse_unfinished(asked.runs())
        call("-m", f"benchmarks.{name}", *map(str, asked.runs()), *asked.options("--quick"))

    return step


def robustness(asked: Asked) -> None:
    """Corrupt the logs of a few runs, and train such runs anew with flawed instructors."""
    refuse_unfinished(asked.few())
    runs = ("--missing", "--anew", "--runs", *map(str, asked.few()))
    few = ("--quick", "--corruptions", "1", "--episodes", "3")
    beside_the_runs(asked, "robustness", flawed.RESULTS, runs, few)


def words(asked: Asked) -> None:
    """Tell the logs of a few runs in words."""
    refuse_unfinished(asked.few())
    if asked.quick:
        console.print("  left out: the log of a tiny run is too short to learn flawed words from")
        return
    call("-m", "benchmarks.words", "--missing", *map(str, asked.few()), *asked.options())


def instructed(asked: Asked) -> None:
    """Train with and without instruction, PPO and DQN, with the seeds of that benchmark."""
    beside_the_runs(asked, "instruction", instruction.RESULTS, ("--missing",), ("--quick", "--seeds", "0"))


def elsewhere(asked: Asked) -> None:
    """Train in other environments, with the seeds of that benchmark."""
    quick = ("--quick", "--seeds", "0", "--only", *list(tutorial.TRAININGS)[:1])
    beside_the_runs(asked, "tutorial", tutorial.RESULTS, ("--missing",), quick)


def beside_the_runs(asked: Asked, name: str, results: Path, options: Sequence[str], quick: Sequence[str]) -> None:
    """Call a benchmark that goes on from its file, kept beside the runs: the repository's own holds older trainings."""
    module = ("-m", f"benchmarks.{name}")
    if asked.output:
        call(*module, *options, *asked.options(*quick))
        return
    made = asked.folder / name
    call(*module, *options, "--output", str(made))
    shutil.copy(made / results.name, results)
    call(*module, "--report")


def call(*command: str) -> None:
    """Run a Python program of the repository, one thread a process.

    Raises:
        SystemExit: if it failed.
    """
    environment = os.environ | ONE_THREAD
    ended = subprocess.run([sys.executable, *command], cwd=ROOT, env=environment)  # noqa: S603 - our own
    if ended.returncode:
        raise SystemExit(f"{shlex.join(command)} ended with {ended.returncode}; the same command goes on from there")


STEPS: dict[str, tuple[str, Callable[[Asked], None]]] = {
    "train": ("default trainings that are not finished yet", train),
    "truth": ("are the words true? docs/QUALITY.md", with_all_runs("truth")),
    "why": ("what makes words lose the motion, docs/QUALITY.md", with_all_runs("why")),
    "robustness": ("flawed instructors: logs corrupted, and trainings, docs/INSTRUCTION.md", robustness),
    "words": ("words of one's own, docs/WORDS.md", words),
    "instruction": ("with and without instruction, docs/INSTRUCTION.md", instructed),
    "elsewhere": ("other environments, docs/OWN_ENVIRONMENT.md and docs/QUALITY.md", elsewhere),
    "paper": ("the paper's experiments, docs/PAPER.md", with_all_runs("paper")),
}
"""Name to what it says and does."""


if __name__ == "__main__":
    main()
