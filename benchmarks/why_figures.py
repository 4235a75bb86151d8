"""The pictures of docs/QUALITY.md, from benchmarks/why.json alone.

python -m benchmarks.why_figures [JSON] [FOLDER]      draws them anew without measuring
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.why_report import flies
from benchmarks.why_variants import OURS, PAPER

BLUE, ORANGE, GREY, DARK = "#0072b2", "#d55e00", "#8a8a8a", "#333333"  # Okabe and Ito's, told apart by everybody
COLOURS = {PAPER: ORANGE, OURS: BLUE}
SIZE = {"width": 9.0, "dpi": 200}
LETTERS = {"font.size": 10, "axes.titlesize": 11, "axes.spines.top": False, "axes.spines.right": False}
BOX = ("whislo", "q1", "med", "q3", "whishi")


def draw(found: dict[str, Any], folder: Path) -> list[Path]:
    """Draw all pictures into ``folder``; returns the files."""
    from matplotlib import rc_context  # the pictures' own letters, nobody else's

    folder.mkdir(parents=True, exist_ok=True)
    flying = [run for run in found["runs"] if flies(run)] or found["runs"]
    with rc_context(LETTERS):
        made = {"clusters": of_clusters(flying[0]), "variants": of_variants(found), "reasons": of_reasons(flying)}
        paths = [folder / f"quality_why_{name}.png" for name in made]
        for path, figure in zip(paths, made.values(), strict=True):
            figure.savefig(path, dpi=SIZE["dpi"], metadata={"Software": None})
    return paths


def of_clusters(run: dict[str, Any]) -> Figure:
    """How the state really moved in each cluster of one run, in the order of what the clusters are called."""
    figure = Figure(figsize=(SIZE["width"], 4.3), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, name in zip(panels, (PAPER, OURS), strict=True):
        boxes(panel, run["facts"][name]["clusters"], run["band"])
        panel.set_title(f"{name}: motion_auc {1 - run['facts'][name]['lost']:.3f}")
        panel.set_xlabel("what the cluster is called; below it, its moments")
    panels[0].set_ylabel(f"real change of {run['explained']} in {run['horizon_steps']} steps ({run['unit']})")
    figure.suptitle(
        f"{run['name']}: what really happened where each cluster spoke\n"
        "(box: the middle half, whiskers: 5 to 95 %; orange: called negative, blue: called positive)",
        fontsize=10,
    )
    return figure


def boxes(panel: Axes, clusters: Sequence[dict[str, Any]], band: float) -> None:
    """One box a cluster."""
    panel.axhspan(-band, band, color="#dddddd", zorder=0)
    panel.axhline(0, color=GREY, linewidth=0.8)
    for place, cluster in enumerate(clusters):
        if cluster["quantiles"] is None:
            continue
        colour = BLUE if cluster["expression"] > 0 else ORANGE
        style: dict[str, Any] = {"color": colour, "linewidth": 1.3}
        panel.bxp(
            [dict(zip(BOX, cluster["quantiles"], strict=True))],
            positions=[place],
            widths=0.6,
            showfliers=False,
            patch_artist=True,
            boxprops={"facecolor": colour + "55", "edgecolor": colour},
            medianprops={"color": DARK, "linewidth": 2},
            whiskerprops=style,
            capprops=style,
            manage_ticks=False,
        )
    labels = [f"{cluster['expression']:+.2f}\n{cluster['moments']:,}" for cluster in clusters]
    panel.set_xticks(range(len(clusters)), labels, fontsize=8.5)


def of_variants(found: dict[str, Any]) -> Figure:
    """Every variant: all moments, each run, and the moments that did not go the way they were told."""
    table = found["table"]
    figure = Figure(figsize=(SIZE["width"], 1.2 + 0.25 * (len(table) + len({r["group"] for r in table}))))
    figure.set_layout_engine("constrained")
    panel = figure.subplots()
    names = {run["name"] for run in found["runs"] if flies(run)} or {run["name"] for run in found["runs"]}
    ticks, labels, place, group = [], [], 0, None
    for record in table:
        if record["group"] != group:
            group = record["group"]
            panel.text(
                -0.01, place, group, transform=panel.get_yaxis_transform(), ha="right", va="center", weight="bold"
            )
            place += 1
        _dots(panel, record, place, names)
        ticks.append(place)
        labels.append(record["name"] + (" (by hand)" if record["by_hand"] else ""))
        place += 1
    panel.axvline(table[0]["motion_auc"]["value"], color=ORANGE, linewidth=0.9, linestyle="--")
    panel.axvline(1, color=GREY, linewidth=0.8)
    panel.set_yticks(ticks, labels, fontsize=9)
    panel.set(ylim=(place - 0.5, -0.7), xlabel="motion_auc: 1 is the true movement, .5 is chance; dashed: the paper's")
    panel.grid(axis="x", color="#e5e5e5")
    panel.legend(loc="upper center", ncols=3, bbox_to_anchor=(0.35, -0.05), frameon=False, fontsize=9)
    return figure


def _dots(panel: Axes, record: dict[str, Any], place: int, names: set[str]) -> None:
    first = record["name"] == PAPER
    value, low, high = (record["motion_auc"][name] for name in ("value", "low", "high"))
    runs = [auc for name, auc in record["by_run"].items() if name in names and auc is not None]
    panel.plot(runs, [place] * len(runs), "|", color=GREY, markersize=8, label="each run" if first else None)
    if value is not None:
        panel.plot([low or value, high or value], [place, place], color=BLUE, linewidth=2.5)
        panel.plot(value, place, "o", color=BLUE, markersize=6, label="mean, 95 % over flights" if first else None)
    told = record["motion_auc_disobeyed"]["value"]
    if told is not None:
        style = {"markerfacecolor": "white", "color": ORANGE, "markersize": 5.5, "linestyle": "none"}
        panel.plot(told, place, "D", **style, label="where it did not follow the instruction" if first else None)


def of_reasons(runs: Sequence[dict[str, Any]]) -> Figure:
    """What the best quarter holds, what the clusters divide, where the axes point; means over the runs."""
    figure = Figure(figsize=(SIZE["width"], 4.4), layout="constrained")
    heat, divided, axes = figure.subplots(1, 3, width_ratios=(0.9, 1.1, 1.1))
    _heat(heat, runs)
    weights = [
        each for run in runs for each in (run["facts"]["weights"]["axis"], run["facts"]["weights"]["regression"])
    ]
    names = [name for name in weights[0] if any(each[name] for each in weights)]
    for offset, name in ((-0.18, PAPER), (0.18, OURS)):
        values = [[run["facts"][name]["divided"][each] for each in names] for run in runs]
        _bars(divided, values, offset, COLOURS[name], f"clusters of {name}")
    divided.set(title="what the clusters divide", xlabel="share of its variance\nbetween the clusters", xlim=(0, 1))
    for offset, name, colour, label in (
        (-0.18, "regression", ORANGE, "regression of m* on the change"),
        (0.18, "axis", BLUE, "instructor's axis"),
    ):
        values = [[run["facts"]["weights"][name][each] for each in names] for run in runs]
        _bars(axes, values, offset, colour, label)
    axes.axvline(0, color=GREY, linewidth=0.8)
    axes.set(title="what an axis weighs", xlabel="share of the weights,\nin standard deviations")
    for panel, labels in ((divided, names), (axes, [])):
        panel.set_yticks(range(len(names)), labels or [""] * len(names), fontsize=9)
        panel.invert_yaxis()
        panel.legend(loc="lower center", bbox_to_anchor=(0.45, 1.12), frameon=False, fontsize=9)
    return figure


def _bars(panel: Axes, values: list[list[float]], offset: float, colour: str, label: str) -> None:
    """Means over runs ``(runs, names)`` as bars, each run as a tick."""
    places = np.arange(len(values[0])) + offset
    panel.barh(places, np.mean(values, axis=0), 0.34, color=colour, alpha=0.75, label=label)
    for run in values:
        panel.plot(run, places, "|", color=DARK, markersize=5, markeredgewidth=0.8)


def _heat(panel: Axes, runs: Sequence[dict[str, Any]]) -> None:
    tables = [run["facts"]["learnt_from"]["told_by_context"] for run in runs]
    names, told = list(tables[0]), runs[0]["instruction_values"]
    mean = np.mean([[table[name] for name in names] for table in tables], axis=0)
    panel.imshow(mean, cmap="Blues", vmin=0, vmax=max(0.4, mean.max()), aspect="auto")
    for row, column in np.ndindex(mean.shape):
        colour = "white" if mean[row, column] > 0.22 else DARK
        panel.text(column, row, f"{mean[row, column]:.0%}", ha="center", va="center", color=colour, fontsize=11)
    panel.set_xticks(range(len(told)), [f"{value:+g}" if value else "0" for value in told])
    panel.set_yticks(range(len(names)), names)
    panel.set(title="best quarter: windows", xlabel="instruction m*", ylabel="context")
    panel.spines[:].set_visible(False)


if __name__ == "__main__":
    given = [Path(each) for each in sys.argv[1:]]
    source, folder = (*given, *(Path("benchmarks/why.json"), Path("docs/img"))[len(given) :])
    draw(json.loads(source.read_text()), folder)
