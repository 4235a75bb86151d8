"""The figures of an analysis, drawn from its numbers alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ibe_rl.apps.paper import names
from ibe_rl.apps.plot_style import DARK, FAINT, INK, grid, interval, legend_of
from ibe_rl.apps.study.arm_names import ARM_NAMES, unit

_OBSERVERS = {
    "none": names.NO_WORDS,
    "paper": names.PAPERS,
    "ibe": names.DEFAULT,
    "placebic": names.SWAPPED,
    "true_future": names.TRUE_END,
}
"""Arms to the observers of the paper's report who hear the same; an arm has their colour and marker."""
_ALL = {"color": INK, "marker": "o"}
_SEED = 0
_FEWEST_ANSWERS = 5
"""Of a bin of confidence that is drawn."""


def _style(arm: str) -> dict[str, Any]:
    observer = _OBSERVERS.get(arm)
    if observer is None:
        return _ALL
    return {"color": names.OBSERVER_COLOURS[observer], "marker": names.OBSERVER_MARKERS[observer]}


def _heading(figure: Figure, found: dict[str, Any], text: str) -> None:
    figure.suptitle(f"PILOT, no participants: {text}" if found["pilot"] else text)


@rc_context(DARK)
def means_chart(found: dict[str, Any]) -> Figure:
    """Every person, the mean of each arm, and the simulated observers on the same episodes."""
    arms = [arm for arm in found["arms"] if found["means"][arm]["people"]]
    figure, [[axis]] = grid(1, 1, 9.5, 1.6 + 0.75 * len(arms))
    random = np.random.default_rng(_SEED)
    for row, arm in enumerate(arms):
        one, style = found["means"][arm], _style(arm)
        spread = row + 0.22 + 0.1 * random.uniform(-1, 1, len(one["each"]))
        axis.plot(one["each"], spread, ".", color=FAINT, markersize=5, label=None if row else "a person")
        interval(axis, one["loss"], row, style["color"], style["marker"], alpha=1.0)
        if found["observers"][arm] is not None:
            axis.plot([found["observers"][arm]], [row - 0.22], **_hollow(arm), label=_once(row))
    axis.set_yticks(range(len(arms)), [f"{ARM_NAMES[arm]} ({found['means'][arm]['people']})" for arm in arms])
    axis.set(ylim=(len(arms) - 0.5, -0.5), xlabel=f"error ({unit(found)})")
    axis.set_xlim(left=0)
    legend_of([axis], figure, 2)
    _heading(figure, found, "How far off people are (95 % intervals over people)")
    return figure


def _hollow(arm: str) -> dict[str, Any]:
    style = _style(arm)
    return {
        "marker": style["marker"],
        "markeredgecolor": style["color"],
        "markerfacecolor": "none",
        "markersize": 7,
        "linestyle": "",
    }


def _once(row: int) -> str | None:
    return None if row else "simulated observers (hollow)"


@rc_context(DARK)
def each_episode_chart(found: dict[str, Any]) -> Figure:
    """Mean error in each episode by arm, beside the simulated observers' (the paper's figure)."""
    shown = found["episodes"]
    figure, [[axis]] = grid(1, 1, 13, 4.4)
    places, arms = np.arange(1, len(shown) + 1), found["arms"]
    for number, arm in enumerate(arms):
        at = places + 0.7 * ((number + 0.5) / len(arms) - 0.5)
        means, style = _column(shown, "loss", arm), _style(arm)
        axis.vlines(at, 0, means, color=style["color"], linewidth=2, alpha=0.7)
        axis.plot(at, means, **style, linestyle="", markersize=5, label=ARM_NAMES[arm])
        axis.plot(at, _column(shown, "observers", arm), **_hollow(arm), label=_once(number))
    top = axis.get_ylim()[1]
    for place, one in enumerate(shown, start=1):
        if one["p"] is not None and one["p"] < found["registered"]["alpha"]:
            axis.text(place, 0.97 * top, "*", ha="center", va="top", fontsize=14)
    axis.set_xticks(places, [one["file"] for one in shown], rotation=90 if len(shown) > 20 else 0)
    axis.set(xlim=(0.3, len(shown) + 0.7), ylim=(0, top), xlabel="episode", ylabel=f"error ({unit(found)})")
    axis.grid(visible=False, axis="x")
    legend_of([axis], figure, 4)
    _heading(figure, found, "Every episode by itself (*: the two registered arms differ, corrected)")
    return figure


def _column(shown: list[dict[str, Any]], what: str, arm: str) -> list[float]:
    return [np.nan if one[what][arm] is None else one[what][arm] for one in shown]


@rc_context(DARK)
def confidence_chart(found: dict[str, Any]) -> Figure:
    """How often people were right, by how sure they were."""
    figure, [[axis]] = grid(1, 1, 9.5, 5.4)
    axis.plot([0, 100], [0, 100], color=FAINT, linewidth=0.9, linestyle=":", label="calibrated")
    for arm, one in found["calibration"].items():
        style, bins = _style(arm), [each for each in one["bins"] if each["answers"] >= _FEWEST_ANSWERS]
        x, y = ([100 * each[key] for each in bins] for key in ("confidence", "value"))
        axis.plot(x, y, **style, markersize=6, linewidth=1.6, label=ARM_NAMES[arm])
        for at, each in zip(x, bins, strict=True):
            if each["low"] is not None:
                axis.vlines(at, 100 * each["low"], 100 * each["high"], color=style["color"], linewidth=1.2, alpha=0.6)
    axis.set(xlim=(0, 100), ylim=(0, 100), xlabel="confidence (%)", ylabel="right (%)")
    legend_of([axis], figure, 3)
    _heading(figure, found, "Confidence (95 % intervals over people)")
    return figure


@rc_context(DARK)
def learning_chart(found: dict[str, Any]) -> Figure:
    """Mean error over the trials of a block."""
    figure, [[axis]] = grid(1, 1, 9.5, 4.2)
    for arm, one in found["learning"].items():
        axis.plot(one["trial"], one["loss"], **_style(arm), markersize=5, linewidth=1.6, label=ARM_NAMES[arm])
    axis.set(xlabel="trial in the block", ylabel=f"error ({unit(found)})")
    axis.set_ylim(bottom=0)
    legend_of([axis], figure, 3)
    _heading(figure, found, "Learning over the trials")
    return figure


@rc_context(DARK)
def scales_chart(found: dict[str, Any]) -> Figure:
    """Mean of each scale by arm, 0 to 100."""
    scales = found["scales"]
    figure, [axes] = grid(1, len(scales), max(9.5, 2.5 + 3.4 * len(scales)), 2.6)
    for axis, one in zip(axes, scales, strict=True):
        _scale(axis, one)
    _heading(figure, found, "Scales, 0 to 100 (95 % intervals over people)")
    return figure


def _scale(axis: Axes, one: dict[str, Any]) -> None:
    for row, (arm, loss) in enumerate(one["groups"].items()):
        if loss:
            interval(axis, loss, row, _style(arm)["color"], _style(arm)["marker"], alpha=1.0)
    groups = [ARM_NAMES.get(arm, "all people") for arm in one["groups"]]
    axis.set_yticks(range(len(groups)), groups)
    alpha = "-" if one["alpha"] is None else f"{one['alpha']:.2f}"
    axis.set(xlim=(0, 100), ylim=(len(groups) - 0.5, -0.5), title=f"{one['scale']} (alpha {alpha})")
