"""Measure and report.

python -m benchmarks                             every part: hours
python -m benchmarks explanations refresh        two parts; the other parts' records stay
python -m benchmarks --quick                     tiny sizes: does everything still work?
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from benchmarks import explanations, faults, frames, overhead, refreshes, skill, sweep
from benchmarks.plan import Plan, make_plan
from benchmarks.records import Record, load, replace_part, save, stamp
from benchmarks.report import document, table
from benchmarks.skill import Figures, Say
from ibe_rl.storage.run_folder import write_atomically

PARTS: dict[str, Callable[[Plan, Say], Iterator[Figures]]] = {
    "skill-ppo": partial(skill.run, part="skill-ppo"),
    "skill-dqn": partial(skill.run, part="skill-dqn"),
    "frames": frames.run,
    "explanations": explanations.run,
    "refresh": refreshes.run,
    "overhead": overhead.run,
    "faults": faults.run,
    "sweep": sweep.run,
}
NEEDS = dict.fromkeys(("skill-ppo", "skill-dqn", "frames"), ("stable_baselines3",))
QUICK_OUTPUT = Path("runs/benchmarks-quick")
console = Console(highlight=False)


def main(arguments: list[str] | None = None) -> None:
    """Run the parts that were asked for, and keep what they found after each step."""
    parser = make_parser()
    asked = parser.parse_args(arguments)
    parts = asked.parts or list(PARTS)
    for refused in refusals(parts, asked.seeds, asked.repeats):
        parser.error(refused)
    output = asked.output or (QUICK_OUTPUT if asked.quick else None)
    plan = make_plan(tuple(asked.seeds), asked.repeats, asked.cap_seconds, asked.quick, output)
    start = time.perf_counter()
    for part in parts:
        for found in PARTS[part](plan, partial(say, start)):
            keep(plan, part, found)
    console.width = max(console.width, 110)
    console.print(table(load(plan.results)))
    say(start, f"written: {plan.results}, {plan.document}")


def make_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure ibe_rl and write the report.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; none: all of them")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2], help="of the runs to skill")
    parser.add_argument("--repeats", type=int, default=3, help="of everything else")
    parser.add_argument("--cap-seconds", type=float, default=900.0, help="of a run of Stable-Baselines3 to skill")
    parser.add_argument("--quick", action="store_true", help=f"tiny sizes, written to {QUICK_OUTPUT}")
    parser.add_argument("--output", type=Path, help="a folder for all that is written, instead of the repository's")
    return parser


def refusals(parts: list[str], seeds: list[int], repeats: int) -> Iterator[str]:
    """What cannot work, before anything is run: the key, the value and what is allowed."""
    for part in parts:
        if part not in PARTS:
            yield f"PART={part}: allowed is one of {', '.join(PARTS)}"
        for package in NEEDS.get(part, ()):
            if find_spec(package) is None:
                yield f"PART={part}: needs {package}, which is not installed; `make bench` installs it"
    if min(seeds) < 0:
        yield f"--seeds={min(seeds)}: allowed is at least 0"
    if repeats < 1:
        yield f"--repeats={repeats}: allowed is at least 1"


def keep(plan: Plan, part: str, found: Figures) -> None:
    """Write what a part has found so far in the place of its old records, and the document anew."""
    records: list[Record] = replace_part(load(plan.results), part, stamp(part, found), list(PARTS))
    save(plan.results, records)
    picture = plan.picture.relative_to(plan.document.parent).as_posix() if plan.picture.exists() else None
    text = document(records, picture)
    plan.document.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(plan.document, lambda stream: stream.write(text.encode()))


def say(start: float, text: str) -> None:
    """A progress line with the minutes since the start."""
    console.print(f"[{(time.perf_counter() - start) / 60:5.1f} min] {text}", markup=False, soft_wrap=True)


if __name__ == "__main__":
    try:
        main()
    except (RuntimeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
