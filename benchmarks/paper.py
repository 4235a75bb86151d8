"""The paper's experiments over several trainings: in how many of them its claims hold.

python -m benchmarks.paper RUN RUN ...                  task=figures of runs that lack it, minutes each; the table
python -m benchmarks.paper --report RUN RUN ...         the table only
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.child import run as run_command
from benchmarks.paper_report import insert_table
from benchmarks.run_arguments import finished_runs
from benchmarks.same_runs import FEW_FIGURES
from ibe_rl.apps.paper.answers import SURE
from ibe_rl.apps.paper.names import CUT_NAMES, DEFAULT, NO_WORDS, PAPERS, SIGNS_KEPT, STRAIGHT
from ibe_rl.config.arguments import path_setting
from ibe_rl.storage.run_folder import EVALUATION, SUMMARY, read_json, write_json

console = Console(highlight=False, soft_wrap=True)
RESULTS = Path(__file__).parent / "paper.json"
HOLDS = ("yes", "open", "no")
SIDES = ("left", "right")


def main(arguments: list[str] | None = None) -> None:
    """Do the experiments with the runs that lack them, count, and write the table."""
    asked = finished_runs("benchmarks.paper", __doc__.splitlines()[0], arguments)
    if not asked.report:
        for run in asked.runs:
            experiment(run, FEW_FIGURES if asked.quick else ())
    found = {"runs": [read(run) for run in asked.runs]}
    (asked.output or RESULTS.parent).mkdir(parents=True, exist_ok=True)
    write_json(asked.output / RESULTS.name if asked.output else RESULTS, found)
    insert_table(found["runs"], asked.output)


def is_done(run: Path) -> bool:
    """Whether the experiments were done since the run was trained."""
    made = run / EVALUATION / RESULTS.name
    return made.is_file() and made.stat().st_mtime >= (run / SUMMARY).stat().st_mtime


def experiment(run: Path, extra: Sequence[str] = ()) -> None:
    """Let explain.py do the experiments with a run, with other settings if need be, unless that has been done."""
    if is_done(run):
        console.print(f"{run.name}: done before")
        return
    console.print(f"{run.name}: task=figures")
    run_command(
        [sys.executable, "explain.py", path_setting("run", run.absolute()), "task=figures", "viewer=off", *extra]
    )


def read(run: Path) -> dict[str, Any]:
    """What the table counts of one run.

    Raises:
        SystemExit: if the run has no experiments since it was trained, or their file is damaged.
    """
    path = run / EVALUATION / RESULTS.name
    if not is_done(run):
        state = "older than the training" if path.is_file() else "not there"
        raise SystemExit(f"{path}: {state}; allowed is what explain.py run={run} task=figures writes")
    try:
        return {"run": run.name, **extract(read_json(path))}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, StopIteration) as error:
        why = f"{type(error).__name__}: {error}"
        again = f"allowed is what explain.py run={run} task=figures writes; to have it made again: rm {path}"
        raise SystemExit(f"{path}: damaged ({why}); {again}") from None


def extract(found: dict[str, Any]) -> dict[str, Any]:
    """From what paper.json holds to what the table counts, by the names of the agents."""
    return {
        "agent": str(found["protocol"]["agent"]),
        "near": {one["name"]: bool(one["near"]) for one in found["agents"]},
        "claims": {one["agent"]: _claims(one["told"]) for one in found["preliminary"]},
        "skew": {one["agent"]: _skews(one["vocabularies"]) for one in found["expressions"]},
        "missed": {one["agent"]: _missed(one["rates"]) for one in found["straight"]},
        "foretold": {
            one["agent"]: {cut: _foretold(one["cuts"][cut]) for cut in CUT_NAMES} for one in found["prediction"]
        },
    }


def _claims(told: dict[str, Any]) -> dict[str, dict[str, str | None]]:
    """Instruction to whether the best episodes follow it more, over all and within the same context."""
    claims = {value: one["claim"] for value, one in told.items()}
    return {
        str(float(value)): {over: _holds(claim[over]) for over in ("all", "within")} for value, claim in claims.items()
    }


def _holds(claim: dict[str, Any] | None) -> str | None:
    """None where it was not instructed so in both groups.

    Raises:
        ValueError: if it is said in another way.
    """
    if claim is None:
        return None
    if claim["holds"] not in HOLDS:
        raise ValueError(f"holds={claim['holds']}, not one of {', '.join(HOLDS)}")
    return str(claim["holds"])


def _skews(vocabularies: dict[str, Any]) -> dict[str, float]:
    return {name: float(vocabularies[name]["skew"]) for name in (PAPERS, DEFAULT)}


def _missed(rates: dict[str, Any]) -> dict[str, float] | None:
    """The share of small movements to a side that are called straight or the other way; None where there are none."""
    found = {}
    for name in (PAPERS, SIGNS_KEPT, DEFAULT):
        parts = [rates[name][f"{kind}_{side}"]["value"] for kind in ("straight", "wrong") for side in SIDES]
        if None in parts:
            return None
        found[name] = sum(parts) / len(SIDES)
    return found


def _foretold(cut: dict[str, Any]) -> dict[str, Any]:
    """Mean errors of observers, and whether a vocabulary is significantly better or worse than no explanation."""
    errors = {name: float(cut["error"][name]["value"]) for name in (NO_WORDS, STRAIGHT, PAPERS, DEFAULT)}
    return {"error": errors, **{name: _verdict(cut["tests"], name) for name in (PAPERS, DEFAULT)}}


def _verdict(tests: list[dict[str, Any]], name: str) -> str:
    """Yes if the vocabulary helps, no if it misleads."""
    test = next(each for each in tests if (each["explainer"], each["minus"]) == (name, NO_WORDS))
    if not test["p_corrected"] < SURE:
        return "open"
    return "yes" if test["difference"]["value"] < 0 else "no"


if __name__ == "__main__":
    main()
