"""How wrong, late and absent may an instructor be? Vocabularies from corrupted instructions.

python -m benchmarks.robustness                         three runs, corrupted, and six trained anew: an hour
python -m benchmarks.robustness --runs A B C            runs that are there already, corrupted only
python -m benchmarks.robustness --report                the report only
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.child import run as run_command
from benchmarks.robustness_report import write_report
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig, PredictorConfig, ViewerConfig
from ibe_rl.evaluation.moments import Moments, Plan
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.rollouts import Rollouts
from ibe_rl.evaluation.run_predictor import shared_predictor
from ibe_rl.evaluation.runs import TrainedRun, load_run
from ibe_rl.ibe import IBEConfig
from ibe_rl.ibe.delay import caught_up, find_delay
from ibe_rl.instructors.flawed import FlawedConfig, corrupted
from ibe_rl.metrics.quality import motion_auc
from ibe_rl.storage.run_folder import REFRESHES, read_json, write_json
from ibe_rl.types import ConfigError, ExpressionMapping
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "robustness.json"
CURVES: dict[str, dict[str, FlawedConfig]] = {
    "wrong, drawn at every step": {
        f"{p:g}": FlawedConfig(wrong=p, spell_steps=1) for p in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    },
    "wrong, for 25 steps at a time": {f"{p:g}": FlawedConfig(wrong=p) for p in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)},
    "late by so many steps": {f"{d}": FlawedConfig(late_steps=d) for d in (0, 10, 25, 50, 75, 100)},
    "late, and a fifth wrong": {f"{d}": FlawedConfig(late_steps=d, wrong=0.2 * (d > 0)) for d in (0, 10, 25, 50, 75)},
    "late, a fifth wrong, half absent": {
        "0": FlawedConfig(),
        "25": FlawedConfig(late_steps=25, wrong=0.2, present=0.5),
    },
    "key kept down so many steps too long": {f"{d}": FlawedConfig(lasting_steps=d) for d in (0, 10, 25, 50)},
    "the same, and late by 25": {f"{d}": FlawedConfig(lasting_steps=d, late_steps=25 * (d > 0)) for d in (0, 10, 25)},
    "present so much of the time": {f"{p:g}": FlawedConfig(present=p) for p in (1.0, 0.75, 0.5, 0.25, 0.1, 0.05)},
}
"""What is corrupted and how much, the first without any flaw."""
ANEW = {
    "wrong 0.2": (("instructor=flawed", "instructor.wrong=0.2"), FlawedConfig(wrong=0.2)),
    "late 25, present 0.5": (
        ("instructor=flawed", "instructor.late_steps=25", "instructor.present=0.5"),
        FlawedConfig(late_steps=25, present=0.5),
    ),
    "late 25, wrong 0.2, present 0.5": (
        ("instructor=flawed", "instructor.late_steps=25", "instructor.wrong=0.2", "instructor.present=0.5"),
        FlawedConfig(late_steps=25, wrong=0.2, present=0.5),
    ),
}
"""Trained with such an instructor from the beginning."""
PAPER = IBEConfig(delay_steps=0)
COMMON = ("viewer=off", "total_frames=1_000_000", "keep_policy_every_frames=null", "eval_every_frames=500_000")
QUICK = (
    *(
        "collect.processes=1",
        "collect.envs_per_process=16",
        "total_frames=6000",
        "eval_episodes=2",
        "log.capacity_frames=20000",
    ),
    *("mapping.horizon_steps=20", "mapping.spans_steps=[10]", "agent.hidden=[8]", "refresh_every_frames=3000"),
)


def main(arguments: list[str] | None = None) -> None:
    """Train, corrupt, fit again and judge; write the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness", description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--corruptions", type=int, default=3, help="draws of the flaws for each run")
    parser.add_argument("--episodes", type=int, default=100, help="unseen ones that each run is judged on")
    parser.add_argument("--runs", type=Path, nargs="+", help="folders, corrupted instead of runs of the seeds")
    parser.add_argument("--report", action="store_true", help="train nothing")
    parser.add_argument("--quick", action="store_true", help="tiny trainings: does everything still work?")
    parser.add_argument("--output", type=Path, help="a folder for all that is written, instead of the repository's")
    asked = parser.parse_args(arguments)
    if asked.quick and not asked.output:
        parser.error("--quick: allowed with --output=FOLDER, its figures mean nothing")
    results = asked.output / RESULTS.name if asked.output else RESULTS
    found: dict[str, Any] = json.loads(results.read_text()) if asked.report else {"curves": [], "anew": []}
    if not asked.report:
        size = Size(asked.corruptions, asked.episodes, QUICK if asked.quick else ())
        if asked.runs and results.exists():
            found["anew"] = json.loads(results.read_text())["anew"]
        for seed in range(len(asked.runs)) if asked.runs else asked.seeds:
            measure(found, seed, size, asked.runs[seed] if asked.runs else None)
            results.parent.mkdir(parents=True, exist_ok=True)
            write_json(results, found)
    write_report(found, asked.output)


@dataclass(frozen=True)
class Size:
    """How much is done: draws of the flaws for each run, unseen episodes, other settings of the trainings."""

    corruptions: int
    episodes: int
    extra: Sequence[str] = ()


def measure(found: dict[str, Any], seed: int, size: Size, folder: Path | None = None) -> None:
    """Add what one seed shows, or the run in ``folder``."""
    if folder:
        run = load_run(folder)
        found["curves"] += [*curves(run, fly(run, size.episodes), seed, size)]
        return
    with trained(seed, size) as (run, moments):
        found["curves"] += [*curves(run, moments, seed, size)]
        expected = {name: losses(run, moments, flaws, 0) for name, (_, flaws) in ANEW.items()}
    for name, (overrides, flaws) in ANEW.items():
        with trained(seed, size, *overrides) as (run, moments):
            spoken = loss_of(run.mapping, moments, run)
            told = {"delay": delay_of(run), "late": flaws.late_steps}
            one = {"seed": seed, "name": name, "trained": spoken, "corrupted": expected[name]["own"]}
            found["anew"].append(one | told)
            console.print(f"seed {seed}, trained with {name}: loss {spoken}, predicted {expected[name]['own']}")


@contextmanager
def trained(seed: int, size: Size, *overrides: str) -> Iterator[tuple[TrainedRun, Moments]]:
    """A training whose folder goes away again, and the moments that it is judged on."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        console.print(f"seed {seed}: training {' '.join(overrides) or 'with the oracle'}")
        command = [sys.executable, "train.py", f"seed={seed}", *COMMON, *overrides, *size.extra, f"run_dir={path}"]
        run_command(command)
        run = load_run(path)
        yield run, fly(run, size.episodes)


def fly(run: TrainedRun, episodes: int) -> Moments:
    """Unseen greedy episodes of a run, with one future each; those with an instruction and those without."""
    config = EvaluateConfig(episodes=episodes)
    cfg = ExplainConfig(predictor=PredictorConfig(), viewer=ViewerConfig(), evaluate=config)
    plan = Plan(config.stride_steps, 1, (run.horizon_steps,))
    with shared_predictor(run, cfg) as predictor:
        moments = Rollouts(run, cfg, predictor).gather("judged", episodes, plan, "futures")
    return moments[moments.regular]


def curves(run: TrainedRun, moments: Moments, seed: int, size: Size) -> Iterator[dict[str, Any]]:
    """The losses of vocabularies from ever more corrupted instructions."""
    for curve, points in CURVES.items():
        for point, flaws in points.items():
            for draw in range(size.corruptions):
                found = losses(run, moments, flaws, draw)
                yield {"seed": seed, "curve": curve, "point": point, "draw": draw, **found}
        console.print(f"seed {seed}: {curve}, at the worst {found}")


def losses(run: TrainedRun, moments: Moments, flaws: FlawedConfig, draw: int) -> dict[str, Any]:
    """``vocabulary_loss`` of what is learnt from the log if its instructor had had flaws; None if nothing can be.

    Ours takes the instructions back by the delay that it finds; that is ``delay``, beside ``late``, the true one.
    """
    refits, values = Refits(run, draw), run.task.instruction_values
    found: dict[str, Any] = {"late": flaws.late_steps}
    for name, config in {"own": run.config.mapping, "paper": PAPER}.items():
        lessons = refits.lessons(replace(config, delay_steps=0))  # before anything is taken back
        best, heard = (corrupted(part, values, flaws, 7 * draw + 1) for part in (lessons.best, lessons.heard))
        if config.delay_steps is None:
            delay = find_delay(heard)
            found["delay"] = asdict(delay)
            best, heard = caught_up(best, delay), caught_up(heard, delay)
        try:
            mapping = refits.fit(config, run.horizon_steps, replace(lessons, best=best, heard=heard))
        except ConfigError:  # too little is left to learn from
            found[name] = None
        else:
            found[name] = loss_of(mapping, moments, run)
    return found


def delay_of(run: TrainedRun) -> dict[str, Any] | None:
    """The delay that the last refresh of a training found."""
    newest = max((run.folder / REFRESHES).glob("*.json"))
    found: dict[str, Any] = read_json(newest)["delays"]
    return found.get(INSTRUCTOR)


def loss_of(mapping: ExpressionMapping, moments: Moments, run: TrainedRun) -> float | None:
    """By how much the words tell less than the predicted change itself."""
    task, at = run.task, moments.at(run.horizon_steps)
    change, predicted = moments.realised[:, at, task.explained[0]], moments.predicted[:, 0, at]
    ceiling = motion_auc(predicted[:, task.explained[0]], change, task.explained_band[0])
    loss = ceiling - motion_auc(mapping.express(predicted)[:, 0], change, task.explained_band[0])
    return None if np.isnan(loss) else round(float(loss), 5)


if __name__ == "__main__":
    main()
