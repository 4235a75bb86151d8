"""The learning curves as a picture."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.plan import LEVELS
from benchmarks.records import Record, load
from benchmarks.skill import ALGORITHMS

OURS, OURS_REWARDED, LEAN, GYMNASIUM = "#6d5bd0", "#c2458a", "#d9822b", "#3b8f5a"
"""Colours of our sides, and of Stable-Baselines3 by its environment's step."""


def draw(curves_file: str, picture: str) -> None:
    """Draw success over seconds, one line a run, one panel an algorithm."""
    curves = load(Path(curves_file))
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    panels = figure.subplots(1, len(ALGORITHMS), sharey=True)
    for panel, (part, algorithm) in zip(panels, ALGORITHMS.items(), strict=True):
        draw_panel(panel, algorithm, [curve for curve in curves if curve["part"] == part])
    panels[0].set_ylabel("success on 100 unseen episodes")
    # One entry a side, though each of its runs is a line.
    lines = {line.get_label(): line for panel in panels for line in panel.get_legend_handles_labels()[0]}
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=2, frameon=False)
    Path(picture).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=150, metadata={"Software": None})


def draw_panel(panel: Axes, algorithm: str, curves: list[Record]) -> None:
    """One algorithm: ours against theirs."""
    for level in LEVELS.values():
        panel.axhline(level, color="#999999", linewidth=0.7, linestyle=":")
    for curve in curves:
        side = curve["side"]
        panel.plot(curve["seconds"], curve["success"], color=colour(side), linewidth=1.0, label=side)
    panel.set(title=algorithm.upper(), xlabel="seconds without evaluations", xscale="log", ylim=(-0.02, 1.02))


def colour(side: str) -> str:
    """Of a side, by its name in the file."""
    if side.startswith("ibe_rl"):
        return OURS_REWARDED if "rewarded" in side else OURS
    return GYMNASIUM if "gymnasium" in side else LEAN
