"""Measure and report.

python -m benchmarks                             every part: hours
python -m benchmarks explanations refresh        two parts; the other parts' records stay
python -m benchmarks --short                     the first figures of each kind: under ten minutes
python -m benchmarks --quick                     tiny sizes: does everything still work?
python -m benchmarks skill-ppo --resume          go on where a run was stopped: only with the seeds that are missing
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from benchmarks import explanations, faults, frames, overhead, refreshes, skill, starting, sweep
from benchmarks.how import HOW
from benchmarks.plan import FORMS, Form, Plan, make_plan
from benchmarks.records import Record, load, replace_part, save, stamp
from benchmarks.report import document, table
from benchmarks.skill import Figures, Say
from ibe_rl.storage.run_folder import write_atomically

PARTS: dict[str, Callable[[Plan, Say], Iterator[Figures]]] = {
    "skill-ppo": partial(skill.run, part="skill-ppo"),
    "skill-dqn": partial(skill.run, part="skill-dqn"),
    "frames": frames.run,
    "explanations": explanations.run,
    "setup": starting.run,
    "refresh": refreshes.run,
    "overhead": overhead.run,
    "faults": faults.run,
    "sweep": sweep.run,
}
NEEDS = dict.fromkeys(("skill-ppo", "skill-dqn", "frames"), ("stable_baselines3",))
ASKED = ("parts", "seeds", "repeats", "cap_seconds", "output")
"""What the command line may change of a form."""
console = Console(highlight=False)


def main(arguments: list[str] | None = None) -> None:
    """Run the parts that were asked for, and keep what they found after each step."""
    parser = make_parser()
    asked = parser.parse_args(arguments)
    form = as_asked(asked)
    for refused in refusals(form):
        parser.error(refused)
    plan, start = make_plan(form, asked.resume), time.perf_counter()
    for part in form.parts:
        for found in PARTS[part](plan, partial(say, start)):
            keep(plan, part, found)
    console.width = max(console.width, 110)
    console.print(table(load(plan.results)))
    say(start, f"written: {plan.results}, {plan.document}")


def make_parser() -> argparse.ArgumentParser:
    """The command line; what is not given is the form's."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure ibe_rl and write the report.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; none: all of them")
    parser.add_argument("--seeds", type=int, nargs="+", help="of the runs to skill")
    parser.add_argument("--repeats", type=int, help="of everything else")
    parser.add_argument("--cap-seconds", type=float, help="of a run of Stable-Baselines3 to skill")
    parser.add_argument("--resume", action="store_true", help="run to skill only with the seeds that are missing")
    parser.add_argument("--output", type=Path, help="a folder for all that is written, instead of the usual one")
    forms = parser.add_mutually_exclusive_group()
    for name, said in {"short": "ten minutes", "quick": "tiny sizes"}.items():
        output = f"{said}, written to {FORMS[name].output}"
        forms.add_argument(f"--{name}", dest="form", action="store_const", const=name, default="full", help=output)
    return parser


def as_asked(asked: argparse.Namespace) -> Form:
    """The form, with what the command line says of it."""
    given = {name: value for name, value in vars(asked).items() if name in ASKED and value not in (None, [])}
    lists = {name: tuple(value) for name, value in given.items() if isinstance(value, list)}
    form = replace(FORMS[asked.form], **given | lists)
    return replace(form, parts=form.parts or tuple(PARTS))


def refusals(form: Form) -> Iterator[str]:
    """What cannot work, before anything is run: the key, the value and what is allowed."""
    for part in form.parts:
        if part not in PARTS:
            yield f"PART={part}: allowed is one of {', '.join(PARTS)}"
        for package in NEEDS.get(part, ()):
            if find_spec(package) is None:
                yield f"PART={part}: needs {package}, which is not installed; `make bench` installs it"
    if min(form.seeds) < 0:
        yield f"--seeds={min(form.seeds)}: allowed is at least 0"
    if form.repeats < 1:
        yield f"--repeats={form.repeats}: allowed is at least 1"


def keep(plan: Plan, part: str, found: Figures) -> None:
    """Write what a part has found so far in the place of its old records, and the document anew.

    How a figure was measured is kept with it, so that one of an older way is not described by today's.
    """
    told = [figure | {"how": HOW[figure["name"]]} for figure in found]
    records: list[Record] = replace_part(load(plan.results), part, stamp(part, told), list(PARTS))
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
