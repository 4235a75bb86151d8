"""How wrong, late and absent may an instructor be? Vocabularies from corrupted instructions.

python -m benchmarks.robustness                         three runs, corrupted, and nine trained anew: an hour and more
python -m benchmarks.robustness --runs A B C            runs that are there already, corrupted only
python -m benchmarks.robustness --runs A B C --anew     the same, and three trained anew for each, as long as it
python -m benchmarks.robustness --missing ...           only what the file does not hold yet of these runs or seeds
python -m benchmarks.robustness --report                the report only

It is written after each curve and each training. With ``--missing`` what was stopped goes on from there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.child import run as run_command
from benchmarks.robustness_flaws import ANEW, CURVES
from benchmarks.robustness_report import write_report
from benchmarks.run_arguments import with_output
from benchmarks.which_training import training_of
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig, PredictorConfig, ViewerConfig
from ibe_rl.evaluation.moments import Moments, Plan
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.rollouts import Rollouts
from ibe_rl.evaluation.run_predictor import shared_predictor
from ibe_rl.evaluation.runs import TrainedRun, load_run
from ibe_rl.ibe import IBEConfig
from ibe_rl.ibe.delay import caught_up
from ibe_rl.ibe.find_delay import find_delay
from ibe_rl.instructors.flawed import FlawedConfig, corrupted
from ibe_rl.metrics.quality import motion_auc
from ibe_rl.storage.run_folder import REFRESHES, read_json, write_json
from ibe_rl.types import ConfigError, ExpressionMapping
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "robustness.json"
PARTS = ("curves", "predicted", "anew")
"""Of the file: losses after corruption, those predicted for trainings with flawed instructors, and those after them."""
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
    parser.add_argument(
        "--anew", action="store_true", help="with --runs: also train, by default settings and as long, with flaws"
    )
    parser.add_argument("--missing", action="store_true", help="only what was not measured of these runs or seeds")
    parser.add_argument("--report", action="store_true", help="train nothing")
    asked = with_output(parser, arguments)
    results = asked.output / RESULTS.name if asked.output else RESULTS
    if asked.report and not results.exists():
        parser.error(f"--report: allowed once something was measured ({results} is not there)")
    held = asked.report or ((asked.missing or asked.runs) and results.exists())
    found: dict[str, Any] = read_json(results) if held else {}
    if not asked.report:
        found = measure_all(found, asked, results)
    write_report(found, asked.output)


@dataclass(frozen=True)
class Size:
    """How much is done: draws of the flaws for each run, unseen episodes, other settings of the trainings."""

    corruptions: int
    episodes: int
    extra: Sequence[str] = ()


@dataclass(frozen=True)
class Source:
    """Whose log is corrupted.

    Attributes:
        name: which training, and how many episodes it is judged on; what is kept of it has this name.
        seed: of the training, or the place of the run among those that are asked for.
        folder: of the run; None: it is trained for this.
    """

    name: str
    seed: int
    folder: Path | None = None


def sources(asked: argparse.Namespace) -> list[Source]:
    """The runs that are asked for, or those of the seeds."""
    judged = f"{asked.episodes} episodes"
    if asked.runs:
        return [Source(f"{training_of(run)}, {judged}", place, run) for place, run in enumerate(asked.runs)]
    return [Source(f"seed {seed}, {judged}", seed) for seed in asked.seeds]


def measure_all(before: dict[str, Any], asked: argparse.Namespace, results: Path) -> dict[str, Any]:
    """Measure what is asked for, writing after each piece; ``before`` is what the file held."""
    size = Size(asked.corruptions, asked.episodes, QUICK if asked.quick else ())
    several = sources(asked)
    anew = asked.anew or not asked.runs
    found = kept(before, several if asked.missing else [])
    if not anew:
        found["anew"] = before.get("anew", [])
    results.parent.mkdir(parents=True, exist_ok=True)
    for source in several:
        for _ in measure(found, source, size, anew):
            write_json(results, found)
    write_json(results, found)  # without runs that are not asked for, also where nothing lacked
    return found


def kept(before: dict[str, Any], several: Sequence[Source]) -> dict[str, Any]:
    """What was measured of these before, with the seeds that they have now."""
    seeds = {one.name: one.seed for one in several}
    parts = {part: [one for one in before.get(part, ()) if one.get("run") in seeds] for part in PARTS}
    return parts | {"curves": [one | {"seed": seeds[one["run"]]} for one in parts["curves"]]}


def measure(found: dict[str, Any], source: Source, size: Size, anew: bool) -> Iterator[None]:
    """Add what ``found`` lacks of one run; pauses after each piece."""
    lacking = [curve for curve in CURVES if not is_complete(found["curves"], source, curve, size)]
    predicted = {one["name"] for one in found["predicted"] if one["run"] == source.name}
    unknown = [name for name in ANEW if anew and name not in predicted]
    if lacking or unknown:
        with opened(source, size) as (run, moments):
            for curve in lacking:
                others = [one for one in found["curves"] if (one["run"], one["curve"]) != (source.name, curve)]
                found["curves"] = [*others, *points_of(curve, run, moments, source, size)]
                yield
            for name in unknown:
                found["predicted"].append(predict(name, run, moments, source))
                yield
    trained_before = {(one["run"], one["name"]) for one in found["anew"] if "run" in one}
    for one in found["predicted"]:
        if anew and one["run"] == source.name and (one["run"], one["name"]) not in trained_before:
            found["anew"].append(train_anew(one, size))
            yield


def is_complete(records: Sequence[dict[str, Any]], source: Source, curve: str, size: Size) -> bool:
    """Whether all points and draws of a curve are there."""
    there = {(one["point"], one["draw"]) for one in records if (one["run"], one["curve"]) == (source.name, curve)}
    return there == set(product(CURVES[curve], range(size.corruptions)))


@contextmanager
def opened(source: Source, size: Size) -> Iterator[tuple[TrainedRun, Moments]]:
    """The run, trained if need be, and the moments that it is judged on."""
    if source.folder:
        run = load_run(source.folder)
        yield run, fly(run, size.episodes)
    else:
        with trained(source.seed, size) as both:
            yield both


def predict(name: str, run: TrainedRun, moments: Moments, source: Source) -> dict[str, Any]:
    """The loss after corrupting the log by the flaws of ``ANEW``, and what is trained to compare it with."""
    loss = losses(run, moments, ANEW[name][1], 0)["own"]
    frames = run.config.total_frames
    return {"run": source.name, "seed": run.config.seed, "frames": frames, "name": name, "corrupted": loss}


def train_anew(predicted: dict[str, Any], size: Size) -> dict[str, Any]:
    """The loss after training with such an instructor, as long and with the same seed, beside the predicted one."""
    name, seed, loss = (predicted[key] for key in ("name", "seed", "corrupted"))
    overrides, flaws = ANEW[name]
    with trained(seed, size, f"total_frames={predicted['frames']}", *overrides) as (run, moments):
        spoken = loss_of(run.mapping, moments, run)
        told = {"trained": spoken, "delay": delay_of(run), "late": flaws.late_steps}
    console.print(f"seed {seed}, trained with {name}: loss {spoken}, predicted {loss}")
    return predicted | told


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


def points_of(curve: str, run: TrainedRun, moments: Moments, source: Source, size: Size) -> Iterator[dict[str, Any]]:
    """The losses of vocabularies from ever more corrupted instructions."""
    about = {"run": source.name, "seed": source.seed, "curve": curve}
    for point, flaws in CURVES[curve].items():
        for draw in range(size.corruptions):
            found = losses(run, moments, flaws, draw)
            yield {**about, "point": point, "draw": draw, **found}
    console.print(f"{source.name}: {curve}, at the worst {found}")


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
