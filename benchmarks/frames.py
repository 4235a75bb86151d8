"""Frames a second: the whole pipeline and collection alone, against Stable-Baselines3 and gymnasium's own game."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks import ours
from benchmarks.child import measure
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say, choose_vec_env

STEPS = {"lean": "", "gymnasium": "_gymnasium_step"}
"""Steps of the environment in which Stable-Baselines3 is measured, and how their figures end."""
RATES = ("collect", "bare", *(f"sb3_{what}{end}" for what in ("whole", "collect") for end in STEPS.values()))
TIMES = ("setup", "collect", "learn", "log", "refresh", "explain", "stream", "eval", "checkpoint")


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Measure all of them in turn, as often as asked; yields the figures so far after each round."""
    sizes = plan.sizes
    vec_env, rates = choose_vec_env(plan, say)
    runs: list[ours.TrainingRun] = []
    found: dict[str, list[float]] = {name: [] for name in RATES}
    sb3 = {"vec_env": vec_env, "frames": sizes.learn_frames, "rollout_steps": sizes.rollout_steps}
    for repeat in range(plan.repeats):
        say(f"frames, round {repeat + 1} of {plan.repeats}")
        runs.append(ours.train("agent=ppo", *sizes.overrides, f"total_frames={sizes.short_frames}"))
        for step, end in STEPS.items():
            found[f"sb3_whole{end}"].append(measure("sb3.rate", algorithm="ppo", step=step, **sb3))
        found["collect"].append(measure("stepping.collect", settings=sizes.collect, count=sizes.collect_batches))
        for step, end in STEPS.items():
            found[f"sb3_collect{end}"].append(measure("sb3.rate", algorithm="collect", step=step, **sb3))
        found["bare"].append(measure("stepping.bare", seconds=sizes.bare_seconds))
        last = {name: round(values[-1]) for name, values in found.items()}
        say(f"  frames a second: whole {runs[-1].frames_per_s():,.0f}, {last}")
        yield rates + figures(runs, found)


def figures(runs: list[ours.TrainingRun], found: dict[str, list[float]]) -> Figures:
    """Each rate against its counterpart, and where the time of train.py goes."""
    whole = plain([run.frames_per_s() for run in runs])
    measured = {name: plain(values) for name, values in found.items()}
    pairs = {
        **{f"frames_whole_ppo{end}": (whole, measured[f"sb3_whole{end}"]) for end in STEPS.values()},
        "frames_whole_bare": (whole, measured["bare"]),
        **{f"frames_collect{end}": (measured["collect"], measured[f"sb3_collect{end}"]) for end in STEPS.values()},
        "frames_collect_bare": (measured["collect"], measured["bare"]),
    }
    rates = [figure(name, "frames/s", mine, other) for name, (mine, other) in pairs.items()]
    shares = [figure(f"time_share_{name}", "share", plain([run.share(name) for run in runs])) for name in TIMES]
    return rates + shares
