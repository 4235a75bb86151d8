"""The figures of an evaluation, as PNG files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ibe_rl.storage.run_folder import write_atomically

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""The colour-blind safe palette of Okabe and Ito."""
_MARKERS = "osD^vPX"
GREY = "#777777"
DPI = 130


@rc_context({"text.parse_math": False})  # texts of users may hold dollars
def draw_all(
    folder: Path, quality: dict[str, Any], calibration: dict[str, Any], ours: str, beside: Sequence[str]
) -> list[Path]:
    """Draw the figures of an evaluation; returns their paths.

    Args:
        folder: to write to.
        quality: contents of quality.json.
        calibration: contents of calibration.json.
        ours: the evaluated explainer.
        beside: explainers shown with it over the horizons.
    """
    own = quality["protocol"]["horizon_steps"]
    drawings: dict[str, Callable[[], Figure]] = {
        "quality.png": lambda: by_explainer(quality["rows"], own),
        "confidence.png": lambda: confidence(calibration),
        "horizons.png": lambda: over_horizons(quality["rows"], (ours, *beside), own),
    }
    if not calibration["reliability"]:  # no explanations
        del drawings["confidence.png"]
    if quality["changing_policy"]:
        drawings["changing_policy.png"] = lambda: changing(quality["changing_policy"], own)
    return [save(draw(), folder / name) for name, draw in drawings.items()]


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as a PNG file, reproducible to the byte."""
    FigureCanvasAgg(figure)
    write_atomically(path, lambda stream: figure.savefig(stream, format="png", dpi=DPI))
    return path


def _figure(width: float, height: float, columns: int, **shared: Any) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, columns, **shared)).tolist()
    for each in axes:
        each.grid(color="#dddddd", linewidth=0.6)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _plain(name: str) -> str:
    return name.removeprefix("baseline:").replace("_", " ")


def by_explainer(rows: Sequence[dict[str, Any]], horizon_steps: int) -> Figure:
    """Every explainer at one horizon, best first, with intervals; with several numbers a panel for each."""
    here = [row for row in rows if row["horizon_steps"] == horizon_steps and row["motion_auc"]["value"] is not None]
    here.sort(key=lambda row: row["motion_auc"]["value"])
    panels = _panels(here)
    figure, axes = _figure(2.8 + 3.35 * len(panels), 1.6 + 0.3 * len(here), len(panels), sharey=True)
    for axis, (title, estimate) in zip(axes, panels.items(), strict=True):
        for place, (row, value) in enumerate(zip(here, estimate, strict=True)):
            ours, spread = row["explainer"].startswith("ibe:"), row.get("over") == "refits"
            colour = COLOURS[0] if ours else GREY if spread else COLOURS[1]
            _point(axis, value, place, colour, _MARKERS[0] if ours else _MARKERS[2] if spread else _MARKERS[1])
        axis.axvline(0.5, color="#000000", linewidth=0.8, linestyle=":")
        axis.set(xlim=(-0.02, 1.02), xlabel="motion AUC (0.5: chance, 1: always right)")
        axis.set_title(title, fontsize=10)
    _name_explainers(axes[0], here)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.suptitle(f"AUC for the direction of motion over the next {horizon_steps} steps (95 % intervals)")
    return figure


def _panels(rows: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Title of each panel to the values of all rows; with several numbers their mean comes first."""
    metrics = {"motion_auc": "all moments", "motion_auc_disobeyed": "where it did not follow the instruction"}
    numbers = [each["number"] for each in rows[0].get("each", ())] if rows else []
    mean = f"\n(mean of {len(numbers)} numbers)" if numbers else ""
    panels = {f"{title}{mean}": [row[metric] for row in rows] for metric, title in metrics.items()}
    return panels | {
        f"{name}: all moments": [row["each"][i]["motion_auc"] for row in rows] for i, name in enumerate(numbers)
    }


def _name_explainers(axis: Axes, rows: Sequence[dict[str, Any]]) -> None:
    """Label the rows of the figure, and its colours."""
    axis.set_yticks(range(len(rows)), [_plain(row["explainer"]) for row in rows])
    for tick, row in zip(axis.get_yticklabels(), rows, strict=True):
        tick.set_fontweight("bold" if row["explainer"].startswith("ibe:") else "normal")
    for colour, marker, label in (
        (COLOURS[0], _MARKERS[0], "the run's vocabulary"),
        (COLOURS[1], _MARKERS[1], "baselines"),
        (GREY, _MARKERS[2], "many refits: mean and 95 % range"),
    ):
        axis.plot([], [], color=colour, marker=marker, label=label)


def _point(axis: Axes, estimate: dict[str, Any], place: float, colour: str, marker: str) -> None:
    if estimate["value"] is None:
        return
    if estimate["low"] is not None:
        axis.plot([estimate["low"], estimate["high"]], [place, place], color=colour, linewidth=2)
    axis.plot([estimate["value"]], [place], color=colour, marker=marker, markersize=6, linestyle="")


def confidence(calibration: dict[str, Any]) -> Figure:
    """Reliability diagram, and risk against coverage."""
    figure, (left, right) = _figure(9.5, 4.3, 2)
    bins, curve = calibration["reliability"], calibration["risk_coverage"]
    left.plot([0, 1], [0, 1], color="#000000", linewidth=0.8, linestyle=":", label="perfect calibration")
    sizes = np.array([each["moments"] for each in bins])
    sure, true = [each["confidence"] for each in bins], [each["came_true"] for each in bins]
    left.plot(sure, true, color=COLOURS[0], linewidth=1)
    left.scatter(sure, true, s=20 + 180 * sizes / sizes.max(), color=COLOURS[0], label="moments (area: count)")
    left.set(
        xlim=(0, 1.03),
        ylim=(0, 1.03),
        xlabel="confidence that it goes as predicted",
        ylabel="share that went as predicted",
    )
    left.set_title("Calibration", fontsize=10)
    left.legend(fontsize=8, frameon=False, loc="lower right", markerscale=0.6)
    risk = 100 * np.array(curve["risk"])
    right.plot(100 * np.array(curve["coverage"]), risk, color=COLOURS[0], drawstyle="steps-pre")
    right.axhline(risk[-1], color="#000000", linewidth=0.8, linestyle=":", label="always speaking")
    right.axvline(80, color=COLOURS[1], linewidth=0.8, linestyle="--", label="the 80 % most confident")
    right.set(xlim=(0, 101), ylim=(0, max(1.0, 1.15 * float(risk.max()))))
    right.set(
        xlabel="coverage, most confident moments first (%)", ylabel="risk: share that did not go as predicted (%)"
    )
    right.set_title("Risk and coverage", fontsize=10)
    right.legend(fontsize=8, frameon=False, loc="upper left")
    name, steps = _plain(calibration["explainer"]), calibration["horizon_steps"]
    figure.suptitle(f"Confidence of {name} over the next {steps} steps")
    return figure


def over_horizons(rows: Sequence[dict[str, Any]], explainers: Sequence[str], own: int) -> Figure:
    """Motion AUC of some explainers over the horizons."""
    figure, axes = _figure(9.5, 4.4, 2, sharey=True)
    metrics = {"motion_auc": "all moments", "motion_auc_disobeyed": "where it did not follow the instruction"}
    shift = 1.4
    for axis, (metric, title) in zip(axes, metrics.items(), strict=True):
        for number, name in enumerate(explainers):
            estimate = [(row["horizon_steps"], row[metric]) for row in rows if row["explainer"] == name]
            known = [(steps, each) for steps, each in estimate if each["value"] is not None]
            label = _plain(name) if axis is axes[0] else None
            _line(axis, known, number, shift * (number - (len(explainers) - 1) / 2), label)
        axis.axvline(own, color=GREY, linewidth=0.8, linestyle=":")
        axis.set_title(title, fontsize=10)
        axis.set(xlabel="horizon (steps)", xticks=sorted({row["horizon_steps"] for row in rows}))
    axes[0].set_ylabel("motion AUC (0.5: chance, 1: always right)")
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.suptitle(f"AUC by horizon (95 % intervals; dotted: {own} steps, the run's own; points shifted)")
    return figure


def _line(
    axis: Axes, known: Sequence[tuple[float, dict[str, Any]]], number: int, shift: float, label: str | None
) -> None:
    """Values with their intervals, shifted a little to separate several lines."""
    colour, marker = COLOURS[number % len(COLOURS)], _MARKERS[number % len(_MARKERS)]
    places, values = [steps + shift for steps, _ in known], [each["value"] for _, each in known]
    axis.plot(places, values, color=colour, marker=marker, markersize=5, linewidth=1.4, label=label)
    bounded = [(place, each) for place, (_, each) in zip(places, known, strict=True) if each["low"] is not None]
    lows, highs = ([each[end] for _, each in bounded] for end in ("low", "high"))
    axis.vlines([place for place, _ in bounded], lows, highs, color=colour, linewidth=1)


def changing(rows: Sequence[dict[str, Any]], horizon_steps: int) -> Figure:
    """Each saved policy with the vocabularies of its own stage and all earlier ones."""
    policies = sorted({row["policy_frame"] for row in rows})
    ages = sorted({row["vocabulary_frame"] for row in rows})
    metrics = {
        "motion_auc": "motion AUC",
        "motion_spearman": "rank correlation",
        "came_true": "share that went as predicted",
    }
    figure, axes = _figure(3.4 * len(metrics) + 1, 2.2 + 0.42 * len(ages), len(metrics), sharey=True)
    for axis, (metric, title) in zip(axes, metrics.items(), strict=True):
        values = np.full((len(ages), len(policies)), np.nan)
        for row in rows:
            value = row[metric]["value"]
            place = ages.index(row["vocabulary_frame"]), policies.index(row["policy_frame"])
            values[place] = np.nan if value is None else value
        axis.grid(visible=False)
        known = values[~np.isnan(values)] if not np.isnan(values).all() else np.zeros(1)
        axis.imshow(values, cmap="cividis", aspect="auto", vmin=known.min(), vmax=known.max())
        middle = (known.min() + known.max()) / 2
        for (y, x), value in np.ndenumerate(values):
            if not np.isnan(value):
                axis.text(
                    x, y, f"{value:.2f}", ha="center", va="center", fontsize=8, color="w" if value < middle else "k"
                )
        axis.set_xticks(range(len(policies)), [_thousands(frame) for frame in policies], rotation=45)
        axis.set_xlabel("policy after (thousand frames)")
        axis.set_title(title, fontsize=10)
    axes[0].set_yticks(range(len(ages)), [_thousands(frame) for frame in ages])
    axes[0].set_ylabel("vocabulary learnt after (thousand frames)")
    figure.suptitle(f"Policies in earlier and later vocabularies, over {horizon_steps} steps")
    return figure


def predictors(rows: Sequence[dict[str, Any]], horizon_steps: int) -> Figure:
    """Over the training: agreement of each predictor's phrases with the exact one's, and their quality."""
    metrics = {
        "equal": "same phrase as the simulator",
        "motion_auc": "motion AUC",
        "came_true_voted": "went as predicted",
    }
    names = list(dict.fromkeys(row["predictor"] for row in rows))
    frames = sorted({row["frame"] / 1_000 for row in rows})
    step = frames[-1]
    figure, axes = _figure(3.6 * len(metrics) + 1, 3.6, len(metrics))
    for axis, (metric, title) in zip(axes, metrics.items(), strict=True):
        for number, name in enumerate(names):
            known = [(row["frame"] / 1_000, row[metric]) for row in rows if row["predictor"] == name]
            known = [(frame, estimate) for frame, estimate in known if estimate["value"] is not None]
            if metric != "equal" or name != names[0]:  # the first is the exact one
                _line(axis, known, number, step * (number - 1) / 100, name.replace("_", " "))
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("refresh after (thousand frames)")
        axis.set(xticks=frames, xticklabels=[f"{frame:,.0f}" for frame in frames])
        axis.set_xlim(frames[0] - step / 15, frames[-1] + step / 15)
        axis.tick_params(axis="x", labelrotation=30)
    axes[1].legend(fontsize=8, frameon=False)
    figure.suptitle(f"Explanations of {horizon_steps} steps with learned predictors and the simulator")
    return figure


def _thousands(frame: int) -> str:
    return f"{frame / 1000:,.0f}"
