"""Trainings of other environments than the lander: the cart-pole of docs/OWN_ENVIRONMENT.md and a few more.

python -m benchmarks.tutorial                   train and judge all of them: half an hour
python -m benchmarks.tutorial --missing         only what benchmarks/tutorial.json does not hold yet
python -m benchmarks.tutorial --report          the tables only, in docs/OWN_ENVIRONMENT.md and docs/QUALITY.md

The cart-pole's two files are those that the page shows. Several may go on at the same time with one file, with
--missing and other seeds or trainings.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks import ours
from benchmarks.child import run
from benchmarks.kept import add, forget, holds, kept
from benchmarks.pages import fill
from benchmarks.plan import ROOT
from benchmarks.run_arguments import with_output
from benchmarks.same_runs import FEW, SMALL
from benchmarks.truth_report import DOCS
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.metrics.verdict import UNKNOWN
from ibe_rl.storage.run_folder import METRICS, read_json

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "tutorial.json"
COMMAND = "benchmarks.tutorial"
SHOWN, FEW_TRAININGS = DOCS / "OWN_ENVIRONMENT.md", DOCS / "QUALITY.md"
CONFIGS = "my_configs"
PUSHING = '''import numpy as np


def with_the_swing(states):
    """States (..., 3) to instructions (..., 1): push the way it swings."""
    speed = states[..., 2:]
    return np.where(np.abs(speed) > 0.5, np.sign(speed), 0.0)
'''
PUSHED_PENDULUM = """defaults:
  - schema

id: Pendulum-v1
task:
  name: Pendulum
  rule: my_pushing:with_the_swing
  state_names: [cos, sin, angular_velocity]
  state_units: ["", "", rad/s]
  explained: [angular_velocity]
  explained_band: [0.5]
  phrases:
    - zero: coasting
      negative: pushed {degree}clockwise
      positive: pushed {degree}counter-clockwise
"""
JUDGED = ("evaluate.episodes=30", "evaluate.stride_steps=10", "evaluate.changing_episodes=0", "evaluate.shuffles=1")


@dataclass(frozen=True)
class Training:
    """One kind of training.

    Attributes:
        part: the table that it is in.
        settings: beside the defaults.
        seeds: it is trained with.
    """

    part: str
    settings: tuple[str, ...]
    seeds: tuple[int, ...] = (0,)


TRAININGS = {
    "the tutorial's": Training("tutorial", ("env=my_cart", "total_frames=200_000"), (0, 1, 2, 3, 4)),
    "1 a step": Training("tutorial", ("env=my_cart", "env.id=CartPole-v1", "total_frames=200_000"), (0, 1, 2, 3, 4)),
    "`env=reacher`": Training("few", ("env=reacher", "total_frames=150_000")),
    "`env=cart_pole`": Training("few", ("env=cart_pole", "total_frames=300_000")),
    "Pendulum-v1, pushed with the swing": Training("few", ("env=my_pendulum", "total_frames=150_000")),
}
Found = dict[str, dict[str, Any]]
"""Name of a training to seed to what was found."""


def main(arguments: list[str] | None = None) -> None:
    """Train and judge what is asked for, keeping what is found after each run, and write the tables."""
    parser = argparse.ArgumentParser(prog=f"python -m {COMMAND}", description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=list(TRAININGS), default=list(TRAININGS), help="these trainings")
    parser.add_argument("--seeds", type=int, nargs="+", help="instead of 0 to 4, and 0 for those with one training")
    parser.add_argument("--missing", action="store_true", help="only what was not trained yet")
    parser.add_argument("--report", action="store_true", help="train nothing")
    asked = with_output(parser, arguments)
    results = asked.output / RESULTS.name if asked.output else RESULTS
    names = [] if asked.report else asked.only
    if names and not asked.missing:
        forget(results, names)
    for name in names:
        for seed in asked.seeds or TRAININGS[name].seeds:
            measure(name, seed, asked.quick, results)
    write_tables(kept(results), asked.output)


def measure(name: str, seed: int, quick: bool, results: Path) -> None:
    """Train and judge one that is not among the results."""
    if holds(results, name, str(seed)):
        return
    found = train(TRAININGS[name].settings, seed, quick)
    add(results, found, name, str(seed))
    console.print(f"{name}, seed {seed}: {found['verdict']['text']}", markup=False)


def train(settings: tuple[str, ...], seed: int, quick: bool) -> dict[str, Any]:
    """One training and its evaluation, with the files of the page in the folder where it is started."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_files(place)
        made = place / "run"
        tiny, few = (SMALL, FEW) if quick else ((), JUDGED)
        for script, *how in (
            ("train.py", *settings, f"seed={seed}", *tiny, "viewer=off", f"run_dir={made}"),
            ("explain.py", f"run={made}", "task=evaluate", *few),
        ):
            run([sys.executable, str(ROOT / script), "--config-dir", CONFIGS, *how], place)
        return read(made)


def write_files(place: Path) -> None:
    """The two files that the page shows, and those of the pendulum."""
    page = SHOWN.read_text()
    files = {
        "my_rules.py": _first_block("python", page),
        f"{CONFIGS}/env/my_cart.yaml": _first_block("yaml", page),
        "my_pushing.py": PUSHING,
        f"{CONFIGS}/env/my_pendulum.yaml": PUSHED_PENDULUM,
    }
    for name, text in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text)


def _first_block(language: str, page: str) -> str:
    """The first code block in a language.

    Raises:
        ValueError: if there is none.
    """
    block = re.search(rf"^```{language}\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    if block is None:
        raise ValueError(f"{SHOWN}: has no block of {language}; allowed is a page that shows the environment's files")
    return block[1]


def read(folder: Path) -> dict[str, Any]:
    """What a run shows: how true its words were at each refresh, of several numbers the worst, and at the end."""
    refreshes = [read_json(path) for path in sorted((folder / "refreshes").glob("*.json"))]
    with (folder / METRICS).open() as stream:
        points = ours.read_points(list(csv.DictReader(stream)))
    return {
        "refreshes": [truth_at(refresh) for refresh in refreshes],
        "horizon_steps": refreshes[-1]["horizon_steps"],
        "success": points[-1].success,
        "verdict": read_json(folder / "evaluation" / "quality.json")["verdict"],
    }


def truth_at(refresh: dict[str, Any]) -> float | None:
    """The ``motion_auc`` at a refresh; None where the agent cannot tell what a word means."""
    aucs = [scores["motion_auc"] for scores in refresh["scores_of_numbers"]]
    known = all(one.known for one in ClusterMapping.from_dict(refresh["mapping"]).meanings)
    return min(aucs) if known and None not in aucs else None


def write_tables(found: Found, output: Path | None) -> None:
    """Fill the tables of both pages, or put them into ``output``."""
    for page, part in ((SHOWN, "tutorial"), (FEW_TRAININGS, "few")):
        lines = table({name: found[name] for name, one in TRAININGS.items() if name in found and one.part == part})
        fill(output / page.name if output else page, {part: lines}, COMMAND)


def table(found: Found) -> list[str]:
    """A row for each training."""
    lines = [
        "| training | seed | `motion_auc` at the refreshes | horizon | success | `motion_auc` at the end | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, runs in found.items():
        for seed, one in sorted(runs.items(), key=lambda run: int(run[0])):
            aucs = " ".join(map(_told, one["refreshes"]))
            ended = f"{one['horizon_steps']} | {one['success']:.2f} | {_judged(one['verdict'])}"
            lines.append(f"| {name} | {seed} | {aucs} | {ended} |")
    return lines


def _told(auc: float | None) -> str:
    return "-" if auc is None else f"{auc:.2f}"


def _judged(verdict: dict[str, Any]) -> str:
    """The AUC with its interval, and what it is called."""
    if verdict["level"] == UNKNOWN:
        return f"- | {UNKNOWN}"
    auc = verdict["motion_auc"]
    return f"{auc['value']:.2f} [{auc['low']:.2f}, {auc['high']:.2f}] | {verdict['level']}"


if __name__ == "__main__":
    main()
