"""Time to skill: our whole pipeline against Stable-Baselines3, seed by seed in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

from benchmarks import ours
from benchmarks.child import measure
from benchmarks.curves import Curve, Sides, load_seeds, to_records
from benchmarks.levels import Measured, Point, figure, plain, to_level
from benchmarks.plan import LEVELS, REWARDED, Plan
from benchmarks.records import Record, load, machine, replace_part, save, versions
from ibe_rl.config.settings import TrainConfig

ALGORITHMS = {"skill-ppo": "ppo", "skill-dqn": "dqn"}
UNITS = {"time": ("seconds", "s"), "frames": ("frames", "frames")}
"""What is counted to a level: its name in ``Point``, and its unit."""
Say = Callable[[str], None]
Figures = list[dict[str, Any]]


def run(plan: Plan, say: Say, part: str) -> Iterator[Figures]:
    """Train all sides with each seed; yields the figures so far after each seed."""
    algorithm = ALGORITHMS[part]
    vec_env, rates = choose_vec_env(plan, say) if algorithm == "ppo" else ("dummy", [])
    names, about = names_of(plan, algorithm, vec_env), setting_of(plan, algorithm)
    seeds = load_seeds(plan.curves, part, names, about) if plan.resume else {}
    for seed in plan.seeds:
        if seed in seeds:
            say(f"{algorithm}, seed {seed}: kept from the run before")
        else:
            seeds[seed] = train_seed(plan, say, algorithm, seed, vec_env)
            seeds = dict(sorted(seeds.items()))
            keep_curves(plan, part, to_records(part, names, seeds, about))
        yield rates + figures(algorithm, list(seeds.values()))


def choose_vec_env(plan: Plan, say: Say) -> tuple[str, Figures]:
    """The faster of Stable-Baselines3's two vector environments here, and both rates."""
    found: dict[str, list[float]] = {"dummy": [], "subproc": []}
    steps = plan.sizes.vec_env_steps
    asked = {"algorithm": "collect", "step": "lean", "frames": 16 * steps, "rollout_steps": steps}
    for _ in range(plan.repeats):
        for name, rates in found.items():
            rates.append(measure("sb3.rate", vec_env=name, **asked))
    figures = [figure(f"sb3_{name}_frames", "frames/s", other=plain(rates)) for name, rates in found.items()]
    fastest = max(zip(found, figures, strict=True), key=lambda pair: pair[1]["other"])[0]
    said = ", ".join(f"{name} {record['other']:,.0f}" for name, record in zip(found, figures, strict=True))
    say(f"frames a second of Stable-Baselines3 while it collects: {said}; it uses {fastest}")
    return fastest, figures


def names_of(plan: Plan, algorithm: str, vec_env: str) -> dict[str, str]:
    """How each side is called in the file of the curves and in the picture."""
    told = {"lean": "", "gymnasium": ", gymnasium's step"}
    steps = plan.sizes.skill_steps[algorithm]
    mine = {"ours": "ibe_rl", "rewarded": "ibe_rl, rewarded for following"}
    return {side: mine[side] for side in ours_of(plan, algorithm)} | {
        step: f"stable-baselines3 ({vec_env}{told[step]})" for step in steps
    }


def ours_of(plan: Plan, algorithm: str) -> dict[str, list[str]]:
    """Overrides of each run of train.py that a seed has, by its side."""
    overrides = train_overrides(plan, algorithm)
    rewarded = {"rewarded": [*overrides, REWARDED]} if algorithm in plan.sizes.rewarded else {}
    return {"ours": overrides, **rewarded}


def setting_of(plan: Plan, algorithm: str) -> Record:
    """How and where runs to skill are made; only runs with the same are put together."""
    return {
        "fresh_episodes": plan.sizes.fresh_episodes,
        "train": ours_of(plan, algorithm) | {"default_frames": TrainConfig.total_frames},
        "stable_baselines3": other_settings(plan, algorithm),
        "versions": versions(),
        "machine": machine(),
    }


def train_seed(plan: Plan, say: Say, algorithm: str, seed: int, vec_env: str) -> Sides:
    """One run of each side."""
    sides: Sides = {}
    for step in plan.sizes.skill_steps[algorithm]:
        said = f"Stable-Baselines3 ({vec_env}, {step} step), at most {plan.cap_seconds:,.0f} s"
        say(f"{algorithm}, seed {seed}: {said}")
        sides[step] = train_other(plan, algorithm, seed, vec_env, step)
        say(f"  {told(sides[step].points)}")
    for side, overrides in ours_of(plan, algorithm).items():
        say(f"{algorithm}, seed {seed}: train.py {' '.join(overrides)}")
        trained = ours.train(*overrides, f"seed={seed}", fresh_episodes=plan.sizes.fresh_episodes)
        sides[side] = Curve(trained.points, trained.summary["wall_s"], trained.fresh_success)
        say(f"  {told(trained.points)}; {trained.fresh_success:.1%} of {plan.sizes.fresh_episodes} fresh episodes")
    return sides


def train_other(plan: Plan, algorithm: str, seed: int, vec_env: str, step: str) -> Curve:
    """One run of Stable-Baselines3."""
    asked = other_settings(plan, algorithm)
    points = measure("sb3.to_skill", algorithm=algorithm, seed=seed, vec_env=vec_env, step=step, **asked)
    return Curve([Point(**point) for point in points])


def other_settings(plan: Plan, algorithm: str) -> dict[str, Any]:
    """Arguments of ``sb3.to_skill`` that are the same for all of its runs."""
    sizes = plan.sizes
    return {
        "evaluate_every": sizes.evaluate_every[algorithm],
        "episodes": sizes.evaluation_episodes,
        "levels": list(LEVELS.values()),
        "cap_frames": sizes.cap_frames[algorithm],
        "cap_seconds": plan.cap_seconds,
        "rollout_steps": sizes.rollout_steps,
    }


def train_overrides(plan: Plan, algorithm: str) -> list[str]:
    """Of each run of train.py, which always goes on to its end: its learning rate falls to 0 over it."""
    sizes = plan.sizes
    every = f"eval_every_frames={sizes.evaluate_every[algorithm]}"
    return [f"agent={algorithm}", *sizes.skill_overrides[algorithm], *sizes.overrides, every]


def told(points: list[Point]) -> str:
    """Where a run ended and when it reached each level, in words."""
    last = points[-1]
    times = [(name, to_level(points, level, "seconds")) for name, level in LEVELS.items()]
    reached = ", ".join(f"{name} % {f'at {time.value:.0f} s' if time.reached else 'never'}" for name, time in times)
    return f"{last.success:.0%} at {last.frames:,} frames, {last.seconds:.0f} s; {reached}"


def figures(algorithm: str, seeds: Sequence[Sides]) -> Figures:
    """What each level took, and how ours ended: medians and the worst."""
    found: Figures = []
    for label in LEVELS:
        for name in UNITS:
            found += level_figures(f"{name}_to_{label}_{algorithm}", name, seeds, label)
        if "gymnasium" in seeds[0]:
            found += level_figures(f"time_to_{label}_{algorithm}_gymnasium_step", "time", seeds, label, "gymnasium")
    wall = [Measured(sides["ours"].wall_s) for sides in seeds]
    found += [
        *end_figures(f"final_success_{algorithm}", seeds, "ours"),
        figure(f"run_wall_s_{algorithm}", "s", wall),
        figure(f"run_wall_s_{algorithm}_min", "s", wall, what="min"),
        figure(f"run_wall_s_{algorithm}_max", "s", wall, what="max"),
    ]
    return found + (rewarded_figures(algorithm, seeds) if "rewarded" in seeds[0] else [])


def rewarded_figures(algorithm: str, seeds: Sequence[Sides]) -> Figures:
    """The same of our runs that are rewarded for following the instruction."""
    found: Figures = []
    for label, name in product(LEVELS, UNITS):
        found += level_figures(f"{name}_to_{label}_{algorithm}_rewarded", name, seeds, label, mine="rewarded")
    return [*found, *end_figures(f"final_success_{algorithm}_rewarded", seeds, "rewarded")]


def end_figures(name: str, seeds: Sequence[Sides], side: str) -> Figures:
    """Success of one of our sides at its end, on fresh episodes: the median seed and the worst."""
    final = [Measured(sides[side].fresh_success) for sides in seeds]
    return [figure(name, "share", final), figure(f"{name}_min", "share", final, what="min")]


def level_figures(
    name: str, counted: str, seeds: Sequence[Sides], label: str, other: str = "lean", mine: str = "ours"
) -> Figures:
    """What a level took, one of our sides against one of Stable-Baselines3: the median seed and the worst of each."""
    attribute, unit = UNITS[counted]
    took, theirs = (
        [to_level(sides[side].points, LEVELS[label], attribute) for sides in seeds] for side in (mine, other)
    )
    return [figure(name, unit, took, theirs), figure(f"{name}_max", unit, took, theirs, what="max")]


def keep_curves(plan: Plan, part: str, new: list[Record]) -> None:
    """Write the learning curves of all runs of a part, and draw them."""
    save(plan.curves, replace_part(load(plan.curves), part, new, list(ALGORITHMS)))
    measure("picture.draw", curves_file=str(plan.curves.resolve()), picture=str(plan.picture.resolve()))
