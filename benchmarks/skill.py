"""Time to skill: our whole pipeline against Stable-Baselines3, seed by seed in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from benchmarks import ours
from benchmarks.child import measure
from benchmarks.levels import Measured, Point, figure, plain, to_level
from benchmarks.plan import Plan
from benchmarks.records import load, replace_part, save

LEVELS = {"83": 0.83, "95": 0.95}
ALGORITHMS = {"skill-ppo": "ppo", "skill-dqn": "dqn"}
Say = Callable[[str], None]
Figures = list[dict[str, Any]]


def run(plan: Plan, say: Say, part: str) -> Iterator[Figures]:
    """Train both sides with each seed; yields the figures so far after each seed."""
    algorithm = ALGORITHMS[part]
    vec_env, rates = choose_vec_env(plan, say) if algorithm == "ppo" else ("dummy", [])
    runs: list[ours.TrainingRun] = []
    others: list[list[Point]] = []
    for seed in plan.seeds:
        say(f"{algorithm}, seed {seed}: Stable-Baselines3 ({vec_env}), at most {plan.cap_seconds:,.0f} s")
        others.append(train_other(plan, algorithm, seed, vec_env))
        say(f"  {told(others[-1])}; now train.py")
        runs.append(train_ours(plan, algorithm, seed))
        say(f"  {told(runs[-1].points)}")
        keep_curves(plan, part, vec_env, [run.points for run in runs], others)
        yield rates + figures(algorithm, runs, others)


def choose_vec_env(plan: Plan, say: Say) -> tuple[str, Figures]:
    """The faster of Stable-Baselines3's two vector environments here, and both rates."""
    found: dict[str, list[float]] = {"dummy": [], "subproc": []}
    steps = plan.sizes.vec_env_steps
    for _ in range(plan.repeats):
        for name, rates in found.items():
            rates.append(measure("sb3.rate", algorithm="collect", vec_env=name, frames=16 * steps, rollout_steps=steps))
    figures = [figure(f"sb3_{name}_frames", "frames/s", other=plain(rates)) for name, rates in found.items()]
    fastest = max(zip(found, figures, strict=True), key=lambda pair: pair[1]["other"])[0]
    said = ", ".join(f"{name} {record['other']:,.0f}" for name, record in zip(found, figures, strict=True))
    say(f"frames a second of Stable-Baselines3 while it collects: {said}; it uses {fastest}")
    return fastest, figures


def train_other(plan: Plan, algorithm: str, seed: int, vec_env: str) -> list[Point]:
    """One run of Stable-Baselines3; its evaluations."""
    sizes = plan.sizes
    points = measure(
        "sb3.to_skill",
        algorithm=algorithm,
        seed=seed,
        vec_env=vec_env,
        evaluate_every=sizes.evaluate_every[algorithm],
        episodes=sizes.evaluation_episodes,
        levels=list(LEVELS.values()),
        cap_frames=sizes.cap_frames[algorithm],
        cap_seconds=plan.cap_seconds,
        rollout_steps=sizes.rollout_steps,
    )
    return [Point(**point) for point in points]


def train_ours(plan: Plan, algorithm: str, seed: int) -> ours.TrainingRun:
    """One run of train.py, always to its end: its learning rate falls to 0 over it."""
    every = plan.sizes.evaluate_every[algorithm]
    asked = (f"agent={algorithm}", f"seed={seed}", *plan.sizes.overrides, f"eval_every_frames={every}")
    return ours.train(*asked)


def told(points: list[Point]) -> str:
    """Where a run ended and when it reached each level, in words."""
    last = points[-1]
    times = [(name, to_level(points, level, "seconds")) for name, level in LEVELS.items()]
    reached = ", ".join(f"{name} % {f'at {time.value:.0f} s' if time.reached else 'never'}" for name, time in times)
    return f"{last.success:.0%} at {last.frames:,} frames, {last.seconds:.0f} s; {reached}"


def figures(algorithm: str, runs: list[ours.TrainingRun], others: list[list[Point]]) -> Figures:
    """Time and frames to each level of both sides, and how ours ended."""
    found = [
        figure(
            f"{name}_to_{label}_{algorithm}",
            {"seconds": "s", "frames": "frames"}[unit],
            [to_level(run.points, level, unit) for run in runs],
            [to_level(points, level, unit) for points in others],
        )
        for label, level in LEVELS.items()
        for name, unit in (("time", "seconds"), ("frames", "frames"))
    ]
    ends = {
        "final_success": ("share", [Measured(run.summary["success_rate"]) for run in runs]),
        "run_wall_s": ("s", [Measured(run.summary["wall_s"]) for run in runs]),
    }
    for name, (unit, values) in ends.items():
        found.append(figure(f"{name}_{algorithm}", unit, values))
        found.append(figure(f"{name}_{algorithm}_min", unit, values, what="min"))
    return found


def keep_curves(plan: Plan, part: str, vec_env: str, mine: list[list[Point]], others: list[list[Point]]) -> None:
    """Write the learning curves of all runs, and draw them."""
    sides = {"ibe_rl": mine, f"stable-baselines3 ({vec_env})": others}
    new = [
        {"part": part, "side": side, "seed": seed, **columns(points)}
        for side, runs in sides.items()
        for seed, points in zip(plan.seeds, runs, strict=False)
    ]
    curves = replace_part(load(plan.curves), part, new, list(ALGORITHMS))
    save(plan.curves, curves)
    measure("picture.draw", curves_file=str(plan.curves.resolve()), picture=str(plan.picture.resolve()))


def columns(points: list[Point]) -> dict[str, list[float]]:
    """A curve as three lists, seconds and success rounded to what a picture shows."""
    return {
        "frames": [point.frames for point in points],
        "seconds": [round(point.seconds, 1) for point in points],
        "success": [round(point.success, 3) for point in points],
    }
