"""Why a vocabulary loses the motion: real flights of finished runs, put into the words of many variants.

python -m benchmarks.why RUN [RUN...]                     writes benchmarks/why.json, docs/img/quality_why_*.png
                                                          and the table of docs/QUALITY.md: two minutes a run
python -m benchmarks.why RUN --quick --output FOLDER      few flights, one seed: does everything still work?

No predictor takes part: what really happened is put into words, so 1 - motion_auc is what the vocabulary loses.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from threadpoolctl import threadpool_limits

from benchmarks.pages import fill
from benchmarks.run_arguments import with_output
from benchmarks.truth_report import DOCS
from benchmarks.why_facts import facts
from benchmarks.why_figures import draw
from benchmarks.why_report import markdown, summarise
from benchmarks.why_variants import School, Variant, variants
from ibe_rl.agents import make_agent
from ibe_rl.collect.rollout import play
from ibe_rl.config.limits import check
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.ibe import IBEConfig, TooLittleDataError, Windows, cut_windows
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.metrics.quality import motion_scores
from ibe_rl.storage.checkpoint import load, policies
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import CHECKPOINTS, CONFIG, TRAJECTORIES, write_json
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode

FIRST_SEED = 900_000
"""Of the flights; trainings begin theirs at 0."""
EVERY_STEPS = 4
ENVS = 32
SCORES = ("motion_auc", "motion_auc_disobeyed", "motion_spearman")
RESULTS = Path(__file__).parent / "why.json"
PAGE = DOCS / "QUALITY.md"


@dataclass(frozen=True)
class Flown:
    """What is known of a finished run.

    Attributes:
        name: of its folder.
        log: of its training.
        base: the paper's settings, with the run's horizon.
        task: the environment's own.
        success: share of the flights.
        windows: of the flights, to their ends, every few steps.
        short: ``(W,)`` bool, True where the end of the flight cut the window short.
        context: ``(W,)`` the flight's.
    """

    name: str
    log: TrajectoryLog
    base: IBEConfig
    task: Task
    success: float
    windows: Windows
    short: Array
    context: Array


def main(arguments: list[str] | None = None) -> None:
    """Measure, write, draw."""
    parser = make_parser()
    asked = with_output(parser, arguments)
    for name in ("episodes", "seeds", "resamples"):
        if getattr(asked, name) < 1:
            parser.error(f"--{name}={getattr(asked, name)}: allowed is at least 1")
    if asked.quick:
        asked.episodes, asked.seeds, asked.resamples = 10, 1, 20
    console = Console(highlight=False, width=120)
    written = write_report(measure_all(asked, console), asked.output)
    console.print(f"written: {', '.join(map(str, written))}", markup=False)


def measure_all(asked: argparse.Namespace, console: Console) -> dict[str, Any]:
    """All runs, one after the other, and the table of all."""
    start = time.perf_counter()
    runs: list[dict[str, Any]] = []
    rows: list[dict[str, dict[str, Array]]] = []
    for folder in asked.runs:
        run, scores = measure(fly(folder, asked.episodes), asked.seeds, asked.resamples)
        runs, rows = [*runs, run], [*rows, scores]
        done = f"{run['name']}: success {run['success']:.2f}, paper {run['paper']['motion_auc']:.3f}"
        console.print(f"[{time.perf_counter() - start:4.0f} s] {done}", markup=False)
    protocol = {name: getattr(asked, name) for name in ("episodes", "seeds", "resamples")}
    protocol |= {"first_seed": FIRST_SEED, "every_steps": EVERY_STEPS}
    return {"protocol": protocol, "runs": runs, "table": summarise(runs, rows)}


def write_report(found: dict[str, Any], output: Path | None) -> list[Path]:
    """Write the numbers, the pictures and the table, into the repository or into ``output``; returns the files."""
    results = output / RESULTS.name if output else RESULTS
    results.parent.mkdir(parents=True, exist_ok=True)
    write_json(results, found)
    pictures = draw(found, output or DOCS / "img")
    page = output / PAGE.name if output else PAGE
    fill(page, {"why": markdown(found)}, "benchmarks.why")
    return [results, page, *pictures]


def make_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.why", description="What makes words lose the motion.")
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="folder of a finished run, with its log")
    parser.add_argument("--episodes", type=int, default=100, help="flown with each run's policy")
    parser.add_argument("--seeds", type=int, default=5, help="clusterings of each variant")
    parser.add_argument("--resamples", type=int, default=300, help="of the flights, for the intervals")
    return parser


def fly(folder: Path, episodes: int) -> Flown:
    """Open a run, whatever version of the vocabulary it left, and fly its last policy.

    Raises:
        ConfigError: if the folder is not that of a run, or the run has no policy.
        ValueError: if it has no log.
    """
    config: TrainConfig = load_config(folder / CONFIG, TrainConfig)
    check(config)
    kept = policies(folder / CHECKPOINTS)
    if not kept:
        raise ConfigError(f"RUN={folder}: it has no policy yet; allowed is a finished run")
    log = TrajectoryLog.open(folder / TRAJECTORIES)
    envs = [make_env(config.env) for _ in range(ENVS)]
    task = task_of(envs[0])
    agent = make_agent(config.agent, task.observation_size, envs[0].action_space, config.total_frames, task.state_names)
    agent.greedy.load_state_dict(load(list(kept.values())[-1]))
    instructor = make_instructor(stand_in(config.instructor, folder), task)
    flights = play(envs, agent.greedy, instructor, range(FIRST_SEED, FIRST_SEED + episodes))
    base = IBEConfig(horizon_steps=config.mapping.horizon_steps)
    return landed(folder.resolve().name, log, base, task, flights)


def landed(name: str, log: TrajectoryLog, base: IBEConfig, task: Task, flights: Sequence[Episode]) -> Flown:
    """Cut the flights into windows."""
    windows = cut_windows(flights, base.horizon_steps, "clamp")
    windows = windows[windows.given & (windows.step % EVERY_STEPS == 0)]
    steps = np.array([len(flight) for flight in flights])
    short = windows.step + base.horizon_steps > steps[windows.episode]
    success = float(np.mean([flight.success for flight in flights]))
    context = np.array([flight.context for flight in flights])[windows.episode]
    return Flown(name, log, base, task, success, windows, short, context)


def measure(flown: Flown, seeds: int, resamples: int) -> tuple[dict[str, Any], dict[str, dict[str, Array]]]:
    """Score every variant on the flights.

    Returns:
        What goes into the JSON; and variant to score to ``(resamples + 1,)``, the mean over the clusterings.
    """
    school = School(flown.log, flown.base, flown.task)
    constant = np.ptp(school.windows(school.base).delta, axis=0) == 0
    names = [name for name, still in zip(flown.task.state_names, constant, strict=True) if still]
    weights = episode_weights(flown.windows.episode, resamples)
    single, rows = {}, {}
    for variant in variants(flown.task, names):
        scores = [score(school, variant, flown, seed, weights) for seed in range(seeds)]
        key = f"{variant.group}: {variant.name}"
        rows[key] = {name: np.mean([each[name] for each in scores], axis=0) for name in SCORES}
        values = {name: [rounded(each[name][0]) for each in scores] for name in SCORES}
        single[key] = {"group": variant.group, "name": variant.name, "by_hand": variant.by_hand, **values}
    x, task = flown.task.explained[0], flown.task
    about = {"name": flown.name, "success": flown.success, "moments": len(flown.windows)}
    about |= {"explained": task.state_names[x], "unit": task.state_units[x], "band": task.explained_band[0]}
    about |= {"horizon_steps": flown.base.horizon_steps, "instruction_values": list(task.instruction_values)}
    paper = {name: rounded(values[name][0]) for name, values in [(n, rows[next(iter(rows))]) for n in SCORES]}
    return about | {"paper": paper, "variants": single, "facts": facts(flown, school, seeds)}, rows


def score(school: School, variant: Variant, flown: Flown, seed: int, weights: Array) -> dict[str, Array]:
    """One clustering of a variant on every resample ``(R,)``; not a number if the log is too small for it."""
    try:
        said = school.learn(variant, seed).express(flown.windows.delta)[:, 0]
    except TooLittleDataError:
        return {name: np.full(len(weights), np.nan) for name in SCORES}
    change, told = flown.windows.delta[:, flown.task.explained[0]], flown.windows.instruction[:, 0]
    return motion_scores(said, change, told, flown.task.explained_band[0], weights)


def rounded(value: float) -> float | None:
    """Four digits, None for what is not a number."""
    return None if np.isnan(value) else round(float(value), 4)


if __name__ == "__main__":
    try:
        with threadpool_limits(1):
            main()
    except (ConfigError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
