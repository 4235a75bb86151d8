"""Figures of ``benchmarks.truth``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.truth_report import AGENT_COLOURS, BLUE, GREEN, GREY, OBSERVER_SAVES, ORANGE, PINK, SHOWN, VOCABULARIES
from ibe_rl.storage.run_folder import write_atomically


def draw(together: dict[str, Any], pictures: Path) -> None:
    """Draw the figures into a folder."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    for name, make in (("truth", _truth), ("tradeoff", _tradeoff), ("controls", _controls)):
        figure = make(together)
        path = pictures / f"quality_{name}.png"
        write_atomically(path, lambda stream, figure=figure: figure.savefig(stream, dpi=110, format="png"))
        plt.close(figure)


def _truth(together: dict[str, Any]) -> plt.Figure:
    """Each explainer's AUC, all moments and those where the agent did not do what it was told."""
    names = [name for name in SHOWN if any(name in each for each in together["iqm"].values())]
    names = [name for name in names if _known(together, name, "motion_auc")]
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 0.27 * len(names) + 1.3), sharey=True, layout="constrained")
    for axis, metric, title in zip(
        axes,
        ("motion_auc", "motion_auc_disobeyed"),
        ("all moments", "where it did not follow the instruction"),
        strict=True,
    ):
        _points(axis, together, names, metric)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("AUC for “really went left / right”")
        axis.axvline(0.5, color="0.8", linewidth=0.8, zorder=0)
    axes[0].set_yticks(range(len(names)), [SHOWN[name] for name in names])
    axes[0].invert_yaxis()
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure


def _known(together: dict[str, Any], name: str, metric: str) -> bool:
    return any(each.get(name, {}).get(metric) for each in together["iqm"].values())


def _points(axis: Any, together: dict[str, Any], names: list[str], metric: str) -> None:
    for offset, (agent, told) in zip((-0.16, 0.16), together["iqm"].items(), strict=False):
        runs = [run for run in together["runs"] if run["agent"] == agent]
        for row, name in enumerate(names):
            one = told.get(name, {}).get(metric)
            if one is None:
                continue
            each = [run["values"][name][metric] for run in runs]
            colour = AGENT_COLOURS[agent]
            axis.plot(each, [row + offset] * len(each), ".", color=colour, alpha=0.35, markersize=4)
            axis.plot([one["low"], one["high"]], [row + offset] * 2, color=colour, linewidth=1.5)
            label = f"{agent.upper()}, interquartile mean of {len(runs)} seeds" if row == 0 else None
            axis.plot(one["value"], row + offset, "o", color=colour, markersize=5, label=label)


def _tradeoff(together: dict[str, Any]) -> plt.Figure:
    """Truth of the words against what a listener gains from them."""
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.6), layout="constrained", sharey=True)
    for axis, (agent, told) in zip(axes, together["iqm"].items(), strict=False):
        for name, marker in zip(VOCABULARIES, "o*sDPX^v<>hp8", strict=True):
            place = [told.get(name, {}).get(metric) for metric in ("came_true", "observer_error")]
            if None not in place:
                axis.plot(
                    *(one["value"] for one in place),
                    marker,
                    color=_family(name),
                    markersize=8,
                    label=SHOWN[name],
                    linestyle="none",
                )
        nothing = told["no_explanation"]["observer_error"]["value"]
        axis.axhline(nothing, color=PINK, linestyle="--", linewidth=1, label="no explanation")
        axis.axhline(
            (1 - OBSERVER_SAVES[agent]) * nothing, color=PINK, linestyle=":", linewidth=1, label="error to reach"
        )
        axis.axvline(0.9, color="0.7", linestyle=":", linewidth=1)
        axis.set(title=agent.upper(), xlabel="share that went as predicted (to the right is better)")
    axes[0].set_ylabel("observer's error, % of the width (down is better)")
    axes[0].set_ylim(bottom=0)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _family(name: str) -> str:
    if name in ("ibe:axis", "refit:axis"):
        return GREEN
    return BLUE if "axis" in name else GREY if "paper" in name else ORANGE


def _controls(together: dict[str, Any]) -> plt.Figure:
    """What must fail fails; and truth over horizons."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.4), layout="constrained")
    for agent in together["iqm"]:
        runs = [run for run in together["runs"] if run["agent"] == agent]
        shuffled = np.concatenate([np.array(run["shuffled"], float) for run in runs])
        left.hist(
            shuffled[~np.isnan(shuffled)],
            np.linspace(0, 1, 26),
            color=AGENT_COLOURS[agent],
            alpha=0.5,
            label=f"{agent.upper()}, {len(shuffled)} refits",
        )
        for key, style, title in (("horizons", "-", "axis"), ("velocity_at", "--", "present velocity")):
            horizons = sorted(runs[0][key], key=int)  # read from a file, they are text
            means = [np.mean([run[key][h]["value"] for run in runs]) for h in horizons]
            right.plot(
                [int(h) for h in horizons],
                means,
                style,
                marker="o",
                markersize=4,
                color=AGENT_COLOURS[agent],
                label=f"{agent.upper()}, {title}",
            )
    left.axvline(0.5, color="0.4", linewidth=1)
    left.set(xlabel="AUC, instructions shuffled by whole episodes", ylabel="refits")
    right.set(xlabel="horizon, steps", ylabel="AUC, mean of the seeds")
    for axis in (left, right):
        axis.legend(frameon=False, fontsize=8)
    return figure
