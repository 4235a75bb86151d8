"""Tables and figures of ``benchmarks.instruction``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.levels import Measured, Point, highest, lowest, median, to_level
from benchmarks.pages import fill
from benchmarks.truth import interquartile
from benchmarks.truth_report import BLUE, DOCS, GREEN, GREY, ORANGE, PINK
from ibe_rl.apps.sweep.intervals import interquartile_ratio
from ibe_rl.types import Array

PAGE = DOCS / "INSTRUCTION.md"
COMMAND = "benchmarks.instruction"
LEVEL = 0.83
TITLES = {
    "sight": "with and without instruction",
    "flaws": "with an instructor's flaws",
    "dqn": "DQN with and without instruction",
    "reward": "extra reward for having done what it was told, judged by",
}
COLOURS = (BLUE, GREY, ORANGE, PINK, GREEN)
Runs = dict[str, list[dict[str, float]]]
"""Seed to the evaluations of its run."""


def write_report(found: dict[str, Any], output: Path | None = None) -> None:
    """Draw the curves and put the tables into docs/INSTRUCTION.md, or all into ``output``."""
    pictures = output or DOCS / "img"
    for part, arms in found.items():
        draw(arms, TITLES[part], pictures / f"instruction_{part}.png")
    page = output / PAGE.name if output else PAGE
    fill(page, {part: table(arms, baselines(part, found)) for part, arms in found.items()}, COMMAND)


def baselines(part: str, found: dict[str, dict[str, Runs]]) -> dict[str, Runs]:
    """What each arm of a part is compared with: runs without instruction and the same goal, or without extra reward."""
    silent = found.get("dqn" if part == "dqn" else "sight", {})
    names = {name: "nothing" if part == "reward" else f"silent, {name.rpartition(', ')[2]}" for name in found[part]}
    others = silent | found[part]
    return {name: others[other] for name, other in names.items() if other in others and other != name}


def points(run: Sequence[dict[str, float]]) -> list[Point]:
    """A run's evaluations."""
    return [Point(int(one["frames"]), one["seconds"], one["success"]) for one in run]


def success(runs: Runs) -> tuple[Array, Array]:
    """Frames ``(E,)`` of the evaluations and success ``(runs, E)``."""
    every = [points(run) for run in runs.values()]
    return np.array([point.frames for point in every[0]]), np.array([[p.success for p in run] for run in every])


def table(arms: dict[str, Runs], others: dict[str, Runs]) -> list[str]:
    """Success in the middle and in the end, frames to skill, and these relative to those of ``others``."""
    lines = [
        f"| | success half way | at the end | mean of the curve | frames to {LEVEL:.0%} | runs that get there "
        "| frames, relative |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, runs in arms.items():
        _, curves = success(runs)
        columns = np.stack([curves[:, curves.shape[1] // 2 - 1], curves[:, -1], curves.mean(axis=1)], axis=1)
        told = [f"{one['value']:.2f} [{one['low']:.2f}, {one['high']:.2f}]" for one in interquartile(columns)]
        relative = relative_frames(runs, others[name]) if name in others else "-"
        lines.append(f"| {name} | {' | '.join([*told, *_frames_to_skill(runs), relative])} |")
    return lines


def relative_frames(runs: Runs, others: Runs) -> str:
    """Frames to skill over those of other runs: the ratio of interquartile means with its interval over both.

    A run that did not get there counts as long as it lasted: "<" if some of the others did not, ">" if some of these
    did not, "?" if some of both did not, which alone is told if none of both did.
    """
    one, other = ([to_level(points(run), LEVEL, "frames") for run in each.values()] for each in (runs, others))
    if not any(single.reached for single in (*one, *other)):
        return "?"
    ratio = interquartile_ratio(*(np.array([single.value for single in each]) for each in (one, other)))
    endless = tuple(not all(single.reached for single in each) for each in (one, other))
    sign = {(False, False): "", (False, True): "<", (True, False): ">", (True, True): "?"}[endless]
    return f"{sign}{ratio['value']:.2f} [{ratio['low']:.2f}, {ratio['high']:.2f}]"


def _frames_to_skill(runs: Runs) -> list[str]:
    """Median, least and most, and how many get there; one that does not counts as longer than it lasted."""
    each = [to_level(points(run), LEVEL, "frames") for run in runs.values()]
    told = f"**{_told(median(each))}** ({_told(lowest(each))} to {_told(highest(each))})"
    return [told, f"{sum(one.reached for one in each)} of {len(each)}"]


def _told(one: Measured) -> str:
    return f"{'' if one.reached else '>'}{one.value:,.0f}"


def draw(arms: dict[str, Runs], title: str, picture: Path) -> None:
    """One line an arm with its interval."""
    figure = Figure(figsize=(8, 4), layout="constrained")
    panel = figure.subplots()
    for (name, runs), (colour, line) in zip(arms.items(), looks(arms), strict=True):
        _curve(panel, *success(runs), name, colour, line)
    panel.axhline(LEVEL, color="#999999", linewidth=0.7, linestyle=":")
    panel.set(title=title, xlabel="frames", ylabel="success on unseen episodes", ylim=(-0.02, 1.02))
    panel.legend(framealpha=0.9, fontsize=9)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=130, metadata={"Software": None})


def looks(names: Iterable[str]) -> list[tuple[str, str]]:
    """Colour and line of each arm; dashed where it is another one with the goal hidden, or not absorbing."""
    solid = {name: name.replace(", goal hidden", ", goal seen").removesuffix(", not absorbing") for name in names}
    colours = dict(zip(dict.fromkeys(solid.values()), COLOURS, strict=False))
    return [(colours[other], "-" if name == other else "--") for name, other in solid.items()]


def _curve(panel: Axes, frames: Array, curves: Array, name: str, colour: str, line: str) -> None:
    means = interquartile(curves)
    low, middle, high = ([one[key] for one in means] for key in ("low", "value", "high"))
    panel.plot(frames, middle, color=colour, linestyle=line, label=name)
    panel.fill_between(frames, low, high, color=colour, alpha=0.12, linewidth=0)
