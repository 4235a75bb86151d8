"""Does instruction help to learn? Trainings with and without it, with the goal in sight and not, with extra reward.

python -m benchmarks.instruction                        train all of it: hours
python -m benchmarks.instruction --parts reward         some of the tables
python -m benchmarks.instruction --missing              only what benchmarks/instruction.json does not hold yet
python -m benchmarks.instruction --report               the report only

Several may go on at the same time with one file, with --missing and other seeds or parts.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks import ours
from benchmarks.instruction_report import write_report
from benchmarks.kept import add, forget, holds, kept
from benchmarks.plan import REWARDED
from benchmarks.run_arguments import with_output

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "instruction.json"
HIDDEN = "agent.ignores=[goal_x]"
FOLLOWING = (REWARDED, "obedience.weight=0.5")
SILENT = ("instructor=silent",)
FLAWED = ("instructor=flawed", "instructor.late_steps=20", "instructor.wrong=0.1", "instructor.present=0.5")
WRONG = ("instructor=flawed", "instructor.wrong=1.0")
CURVE = ("eval_every_frames=50_000", "refresh_every_frames=null")
JUDGED = ("eval_every_frames=50_000", "refresh_every_frames=50_000", *FOLLOWING)
OFTEN = ("eval_every_frames=25_000", "refresh_every_frames=50_000", "first_refresh_episodes=0", "eval_episodes=50")
"""Without extra reward no vocabulary is learnt; for comparing judges it is learnt late."""


def seen_and_hidden(**arms: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Each arm with the goal in the agent's observation and without it."""
    sights = {"seen": (), "hidden": (HIDDEN,)}
    return {
        f"{name.replace('_', ' ')}, goal {sight}": (*arms[name], *sights[sight]) for sight in sights for name in arms
    }


SIGHT = seen_and_hidden(rewarded=JUDGED, instructed=CURVE, silent=(*SILENT, *CURVE))
"""Rewarded: instructed, and paid for following as the learnt vocabulary understands it."""
REWARDS = {
    "nothing": (),
    **{
        f"{judge}, {weight:g}{'' if absorbing else ', not absorbing'}": (
            *(f"obedience.judge={judge}", f"obedience.weight={weight}"),
            *(() if absorbing else ("obedience.absorbing=false",)),
        )
        for absorbing in (True, False)
        for judge in ("mapping", "oracle")
        for weight in (0.1, 0.5)
    },
}
"""Extra reward for having done what one was told, by judge and weight."""
COMMON = ("total_frames=700_000", "keep_policy_every_frames=null", "viewer=off")
PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "sight": SIGHT,
    "flaws": seen_and_hidden(flawed=(*FLAWED, *JUDGED), always_wrong=(*WRONG, *JUDGED)),
    "dqn": {name: ("agent=dqn", *given) for name, given in SIGHT.items()},
    "reward": {name: (*given, *OFTEN) for name, given in REWARDS.items()},
}
SEEDS: dict[str, tuple[int, ...]] = dict.fromkeys(PARTS, tuple(range(10))) | {"reward": (5, 6, 7)}
QUICK = (
    *(
        "collect.processes=1",
        "collect.envs_per_process=8",
        "total_frames=2000",
        "eval_every_frames=1000",
        "eval_episodes=2",
    ),
    *("log.capacity_frames=10000", "agent.hidden=[8]", "mapping.horizon_steps=20", "mapping.spans_steps=[10]"),
)


def main(arguments: list[str] | None = None) -> None:
    """Train what is asked for, keeping what is found after each run, and write the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.instruction", description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", help="instead of 0 to 9, and 5 to 7 for reward")
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS), help="tables")
    parser.add_argument("--missing", action="store_true", help="only what was not trained yet")
    parser.add_argument("--report", action="store_true", help="train nothing")
    asked = with_output(parser, arguments)
    results = asked.output / RESULTS.name if asked.output else RESULTS
    if not asked.report:
        if not asked.missing:
            forget(results, asked.parts)
        for part in asked.parts:
            train_part(part, asked.seeds or SEEDS[part], QUICK if asked.quick else (), results)
    write_report(in_order(kept(results)), asked.output)


def train_part(part: str, seeds: Sequence[int], extra: tuple[str, ...], results: Path) -> None:
    """Train the runs of a part that are not among the results."""
    for seed, (name, overrides) in product(map(str, seeds), PARTS[part].items()):
        if holds(results, part, name, seed):
            continue
        run = train(f"seed={seed}", *COMMON, *overrides, *extra)
        add(results, run, part, name, seed)
        console.print(f"{part}: {name}, seed {seed}: {run[-1]['success']:.0%} in the end")


def in_order(found: dict[str, Any]) -> dict[str, Any]:
    """The parts, arms and seeds that there are, in the order of ``PARTS``, whoever came first."""
    parts = {part: [name for name in arms if name in found.get(part, {})] for part, arms in PARTS.items()}
    return {
        part: {name: dict(sorted(found[part][name].items(), key=lambda seed: int(seed[0]))) for name in names}
        for part, names in parts.items()
        if names
    }


def train(*overrides: str) -> list[dict[str, float]]:
    """The evaluations of one run."""
    return [asdict(point) for point in ours.train(*overrides).points]


if __name__ == "__main__":
    main()
