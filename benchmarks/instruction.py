"""Does instruction help to learn? Trainings with and without it, with the goal in sight and not, with extra reward.

python -m benchmarks.instruction                        train the first and the last part, three seeds each: 40 minutes
python -m benchmarks.instruction --parts flaws dqn      the others: a flawed instructor and bad advice, DQN; hours
python -m benchmarks.instruction --missing              only what benchmarks/instruction.json does not hold yet
python -m benchmarks.instruction --report               the report only
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks import ours
from benchmarks.instruction_report import write_report
from benchmarks.run_arguments import with_output
from ibe_rl.storage.run_folder import write_json

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "instruction.json"
HIDDEN = "agent.ignores=[goal_x]"
SIGHT = {
    "instructed, goal seen": (),
    "silent, goal seen": ("instructor=silent",),
    "instructed, goal hidden": (HIDDEN,),
    "silent, goal hidden": ("instructor=silent", HIDDEN),
}
"""Learning curves; no vocabulary is learnt."""
FLAWED = ("instructor=flawed", "instructor.late_steps=20", "instructor.wrong=0.1", "instructor.present=0.5")
WRONG = ("instructor=flawed", "instructor.wrong=1.0")
FLAWS = {
    f"{name}, goal {sight}": (*given, *hidden)
    for sight, hidden in (("seen", ()), ("hidden", (HIDDEN,)))
    for name, given in (("late 20, wrong .1, present .5", FLAWED), ("always wrong", WRONG))
}
"""The same curves with an instructor as people are, and the price of bad advice."""
REWARDS = {
    "nothing": (),
    **{
        f"{judge}, {weight:g}": (f"obedience.judge={judge}", f"obedience.weight={weight}")
        for judge in ("mapping", "oracle")
        for weight in (0.1, 0.5)
    },
}
"""Extra reward for having done what one was told; the vocabulary is learnt early, so that there is a judge."""
COMMON = ("total_frames=700_000", "keep_policy_every_frames=null", "viewer=off")
OFTEN = ("refresh_every_frames=50_000", "first_refresh_episodes=0", "eval_every_frames=25_000")
CURVE = ("refresh_every_frames=null", "eval_every_frames=50_000")
PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "sight": {name: (*given, *CURVE) for name, given in SIGHT.items()},
    "flaws": {name: (*given, *CURVE) for name, given in FLAWS.items()},
    "dqn": {name: ("agent=dqn", *given, *CURVE) for name, given in SIGHT.items()},
    "reward": {name: (*given, *OFTEN, "eval_episodes=50") for name, given in REWARDS.items()},
}
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
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=["sight", "reward"], help="tables")
    parser.add_argument("--missing", action="store_true", help="only what was not trained yet")
    parser.add_argument("--report", action="store_true", help="train nothing")
    asked = with_output(parser, arguments)
    results = asked.output / RESULTS.name if asked.output else RESULTS
    found = json.loads(results.read_text()) if results.exists() else {}
    if not asked.report:
        parts = {part: PARTS[part] for part in asked.parts}
        if not asked.missing:
            found = {part: arms for part, arms in found.items() if part not in parts}
        train_all(found, parts, asked.seeds, QUICK if asked.quick else (), results)
    write_report(found, asked.output)


def train_all(
    found: dict[str, Any],
    parts: dict[str, dict[str, tuple[str, ...]]],
    seeds: list[int],
    extra: tuple[str, ...],
    results: Path,
) -> None:
    """Fill in what ``found`` lacks: part to arm to seed to the evaluations of a run."""
    for seed in seeds:
        for part, arms in parts.items():
            for name, overrides in arms.items():
                runs = found.setdefault(part, {}).setdefault(name, {})
                if str(seed) not in runs:
                    runs[str(seed)] = train(seed, *COMMON, *overrides, *extra)
                    console.print(f"{part}: {name}, seed {seed}: {runs[str(seed)][-1]['success']:.0%} in the end")
                    results.parent.mkdir(parents=True, exist_ok=True)
                    write_json(results, found)


def train(seed: int, *overrides: str) -> list[dict[str, float]]:
    """The evaluations of one run."""
    return [asdict(point) for point in ours.train(f"seed={seed}", *overrides).points]


if __name__ == "__main__":
    main()
