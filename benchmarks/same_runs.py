"""Small seeded runs of a checkout's own scripts, one after the other, for ``benchmarks.same_numbers``."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

from benchmarks.child import ONE_THREAD

ABOUT, OUTPUT = "about.json", "output.txt"
RUN = "{run}"
"""In commands: the folder of the run."""
TERMINAL = {"COLUMNS": "200", "TERM": "dumb", "PYTHONUNBUFFERED": "1"}

SMALL = (
    *("collect.processes=1", "collect.envs_per_process=8", "collect.steps_per_batch=128", "total_frames=6000"),
    *("refresh_every_frames=2000", "eval_every_frames=3000", "eval_episodes=5", "mapping.horizon_steps=20"),
    *("agent.hidden=[16]", "log.capacity_frames=10000", "viewer=file"),
)
TINY = ("total_frames=3000", "refresh_every_frames=1000", "eval_every_frames=1500", "eval_episodes=3")
DQN = ("agent=dqn", "agent.learn_after_frames=1000")
FEW = (
    *("evaluate.episodes=6", "evaluate.calibration_episodes=4", "evaluate.changing_episodes=3", "evaluate.shuffles=3"),
    *("predictor.futures=2", "evaluate.resamples=40", "predictor.processes=1", "evaluate.horizons_steps=[20,40]"),
)
FEW_FIGURES = (
    *("figures.episodes=20", "figures.checked_episodes=8", "figures.prediction_episodes=3", "figures.clusterings=2"),
    *("figures.shuffles=2", "figures.resamples=20", "predictor.processes=1", "predictor.futures=2"),
)
Command = tuple[str, ...]


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes:
        commands: script and settings of each.
        copied: the name of an earlier run whose folder it works in a copy of.
    """

    commands: tuple[Command, ...]
    copied: str | None = None


def train(*settings: str) -> Run:
    """One training."""
    return Run((_trained(*settings),))


def explain(*settings: str) -> Run:
    """Something explained of the first run, in a copy of its folder."""
    return Run((("explain.py", f"run={RUN}", *settings),), copied=FIRST)


def _trained(*settings: str) -> Command:
    return "train.py", *SMALL, *settings, f"run_dir={RUN}"


FIRST = "ppo_lander"
CATALOGUE = {
    FIRST: train("mapping.spans_steps=[10]", "mapping.meaning=assumed"),
    "dqn_lander": train(*DQN),
    "ppo_cart_pole": train("env=cart_pole"),
    "ensemble_obedience": train("predictor=ensemble", "predictor.updates=20", "obedience.judge=mapping"),
    "flawed_paper_regression": train(
        *("instructor=flawed", "instructor.wrong=0.1", "instructor.late_steps=3", "instructor.present=0.7"),
        *("mapping=paper", "predictor=regression"),
    ),
    "dqn_when_stale": train(
        *DQN, "refresh_when_stale=0", "mapping.horizon_steps=null", "mapping.spans_steps=[10]", "predictor=regression"
    ),
    "lander_continuous": train("env=lander_continuous"),
    "reacher": train("env=reacher", "mapping.horizon_steps=10"),
    "two_processes": train("collect.processes=2", "collect.envs_per_process=4"),
    "resumed": Run((_trained("stop_after_frames=3000"), ("train.py", f"resume={RUN}", "stop_after_frames=null"))),
    "episode": explain("task=episode", "viewer=file", "seed=3", "context=left"),
    "evaluate": explain("task=evaluate", *FEW),
    "compare": explain("task=compare", *FEW, "compare.mappings=[paper_sign,lasso]"),
    "predictors": explain("task=predictors", *FEW, "evaluate.changing_episodes=0", "evaluate.stride_steps=20"),
    "figures": explain("task=figures", *FEW_FIGURES),
    "demo": Run((("explain.py", "run=demo", "seed=3", "viewer=file", f"output={RUN}/episode.rrd"),)),
    "sweep": Run(
        (
            ("train.py", "-m", "seed=0,1", "runs_at_once=1", *SMALL, *TINY, f"run_dir={RUN}"),
            ("explain.py", f"sweep={RUN}"),
        )
    ),
}
"""What is run, by name."""


def record(
    checkout: Path, folder: Path, only: Collection[str] = (), say: Callable[[str], object] = sys.stderr.write
) -> None:
    """Run a checkout's scripts.

    Args:
        checkout: a folder with ``train.py`` and ``explain.py``.
        folder: gets a folder for each run.
        only: names of runs; empty: all. Those that they work in a copy of are run as well if they are not there.
        say: takes a line for each run.

    Raises:
        ValueError: if a name is unknown, there are no scripts, or the folder holds one of the runs.
        RuntimeError: if a script failed.
    """
    checkout, folder = checkout.resolve(), folder.resolve()
    names = chosen(only, folder)
    if not (checkout / "train.py").is_file():
        raise ValueError(f"CHECKOUT={checkout}: allowed is a folder with train.py and explain.py")
    if there := [name for name in names if (folder / name).exists()]:
        raise ValueError(f"FOLDER={folder}: holds {', '.join(there)} already; allowed is a folder without")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ABOUT).write_text(json.dumps({"checkout": str(checkout), "folder": str(folder)}))
    for name in names:
        say(f"{name}\n")
        run_one(checkout, folder, name, CATALOGUE[name])


def chosen(only: Collection[str], folder: Path) -> list[str]:
    """The names of what is to be run, in the order of the catalogue."""
    if unknown := set(only) - set(CATALOGUE):
        raise ValueError(f"--only {' '.join(sorted(unknown))}: allowed are {', '.join(CATALOGUE)}")
    wanted = set(only or CATALOGUE)
    wanted |= {copied for name in wanted if (copied := CATALOGUE[name].copied) and not (folder / copied).exists()}
    return [name for name in CATALOGUE if name in wanted]


def run_one(checkout: Path, folder: Path, name: str, run: Run) -> None:
    """Run the commands of one run, and keep what they printed beside what they wrote."""
    if run.copied:
        shutil.copytree(folder / run.copied, folder / name)
        (folder / name / OUTPUT).unlink()
    said = "".join(
        call(checkout, [part.replace(RUN, str(folder / name)) for part in command]) for command in run.commands
    )
    (folder / name).mkdir(exist_ok=True)
    (folder / name / OUTPUT).write_text(said)


def call(checkout: Path, command: list[str]) -> str:
    """Run a script in the checkout, one thread a process; returns what it printed."""
    environment = os.environ | ONE_THREAD | TERMINAL | {"PYTHONPATH": str(checkout)}
    ended = subprocess.run(  # noqa: S603 - the checkout's own script
        [sys.executable, *command],
        cwd=checkout,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if ended.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {ended.returncode}:\n{ended.stdout[-3000:]}")
    return ended.stdout
