"""How fast is it in more than one process, over Ray, and what limits the next step? docs/SCALING.md.

python -m benchmarks.scaling                            five rounds of everything, side by side: half an hour
python -m benchmarks.scaling --report                   the tables only
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks import ours
from benchmarks.child import measure
from benchmarks.records import stamp
from benchmarks.scaling_report import write_report
from ibe_rl.storage.run_folder import write_json

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "scaling.json"
ROWS = 128
"""Environments in all, however many workers share them: every arm has the same batches to learn from."""
ALONE = "in the trainer"
COLLECT: dict[str, dict[str, Any]] = {
    ALONE: {"processes": 1},
    "1 process of its own": {"processes": 1, "overlap": True},
    "2 processes": {"processes": 2},
    "Ray, 1 worker": {"processes": 1, "engine": "ray"},
    "Ray, 2 workers": {"processes": 2, "engine": "ray"},
}
"""Collection alone, nobody learns."""
TRAIN: dict[str, dict[str, Any]] = {
    ALONE: {"processes": 1},
    "2 processes": {"processes": 2},
    "1 process, overlap": {"processes": 1, "overlap": True},
    "2 processes, overlap": {"processes": 2, "overlap": True},
    "Ray, 1 worker": {"processes": 1, "engine": "ray"},
    "Ray, 2 workers": {"processes": 2, "engine": "ray"},
    "Ray, 2 workers, overlap": {"processes": 2, "engine": "ray", "overlap": True},
}
"""All of train.py."""


def main(arguments: list[str] | None = None) -> None:
    """Measure all arms in turn, as often as asked, and write the tables after each round."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, help="of all arms, one after the other")
    parser.add_argument("--frames", type=int, default=200_000, help="of each training")
    parser.add_argument("--batches", type=int, default=10, help="of each collection that is timed")
    parser.add_argument("--report", action="store_true", help="measure nothing")
    parser.add_argument("--output", type=Path, help="a folder for all that is written, instead of the repository's")
    asked = parser.parse_args(arguments)
    results = asked.output / RESULTS.name if asked.output else RESULTS
    if asked.report:
        write_report(json.loads(results.read_text()), asked.output)
        return
    if find_spec("ray") is None:
        parser.error("Ray is not installed: pip install 'ibe_rl[ray]', or make soak")
    found: dict[str, Any] = {"about": stamp("scaling", [{}])[0], "rounds": []}
    found["about"]["versions"]["ray"] = version("ray")
    for number in range(asked.rounds):
        console.print(f"round {number + 1} of {asked.rounds}")
        found["rounds"].append(one_round(asked.batches, asked.frames))
        results.parent.mkdir(parents=True, exist_ok=True)
        write_json(results, found)
        write_report(found, asked.output)


def one_round(batches: int, frames: int) -> dict[str, Any]:
    """All arms once."""
    found: dict[str, Any] = {"collect": {}, "train": {}}
    found["inside"] = measure("stepping.inside", settings=sized(COLLECT[ALONE]), count=batches)
    for name, settings in COLLECT.items():
        found["collect"][name] = measure("stepping.collect", settings=sized(settings), count=batches)
        console.print(f"  collection, {name}: {found['collect'][name]:,.0f} frames/s")
    for name, settings in TRAIN.items():
        overrides = [f"collect.{key}={value}" for key, value in sized(settings).items()]
        run = ours.train(*overrides, "viewer=off", f"total_frames={frames}")
        busy = run.summary["wall_s"] - run.summary["time_s"]["setup"] - run.summary["time_s"]["eval"]
        shares = {part: run.summary["time_s"][part] / busy for part in ("collect", "learn", "log")}
        found["train"][name] = {"frames_per_s": run.frames_per_s(), "learning_s": learning(run), "shares": shares}
        console.print(f"  training, {name}: {run.frames_per_s():,.0f} frames/s")
    return found


def sized(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The same with as many environments in all as every other arm."""
    return {**settings, "envs_per_process": ROWS // int(settings["processes"])}


def learning(run: ours.TrainingRun) -> float:
    """Seconds a million frames in which the trainer does what no worker can take from it."""
    times = run.summary["time_s"]
    seconds = sum(times[name] for name in times if name not in ("setup", "collect", "eval"))
    return float(seconds / run.summary["frames"] * 1e6)


if __name__ == "__main__":
    try:
        main()
    except (RuntimeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
