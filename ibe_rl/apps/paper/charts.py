"""The figures of the report that are drawn from numbers alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    DEFAULT,
    NO_WORDS,
    OBSERVER_COLOURS,
    OBSERVER_LABELS,
    OBSERVER_MARKERS,
    PAPERS,
    VARIANT_LABELS,
    VOCABULARY_NAMES,
)
from ibe_rl.apps.plot_style import DARK, FAINT, INK, expression_colours, grid, hexed, interval, legend_of
from ibe_rl.view import palette as colours

_GROUPS = {"best": "the best episodes", "others": "the other episodes"}
_BEST, _OTHER, _YELLOW = hexed(colours.GREEN), hexed(colours.MUTED), hexed(colours.INSTRUCTED)
CUT_TITLES = {AT_END: "to the end of the episode (as in the paper)", AT_CONTACT: "to the first ground contact"}


@rc_context(DARK)
def policies_chart(found: dict[str, Any]) -> Figure:
    """How good every kept policy was, and which of them are A, B and C."""
    figure, [[axis]] = grid(1, 1, 9.5, 4.2)
    tried = found["screened"]
    frames = np.array([each["frame"] for each in tried]) / 1000
    sizes = [8 + each["episodes"] / 4 for each in tried]
    axis.scatter(frames, [100 * each["success"] for each in tried], s=sizes, color=_OTHER, label="evaluated to choose")
    beside = ((-20, 5), (-5, 12), (11, 5))  # apart from each other, should it be one policy
    for each, marker, offset in zip(found["agents"], "osD", beside, strict=True):
        success, frame = each["success"], each["frame"] / 1000
        axis.vlines(frame, 100 * success["low"], 100 * success["high"], color=_BEST, linewidth=2)
        label = f"{each['name']}, evaluated again: {100 * success['value']:.1f} %"
        axis.plot(
            [frame], [100 * success["value"]], marker, color=_BEST, markersize=9, label=label, markeredgecolor=INK
        )
        axis.annotate(
            each["name"],
            (frame, 100 * success["value"]),
            offset,
            textcoords="offset points",
            weight="bold",
            fontsize=12,
        )
        if each["wanted"]:
            axis.axhline(100 * each["wanted"], color=_YELLOW, linewidth=0.9, linestyle=":")
            text = f"the paper's agent {each['name']}: {100 * each['wanted']:.1f} %"
            axis.text(frames[0], 100 * each["wanted"] + 1.2, text, color=_YELLOW, fontsize=8)
    axis.set(xlabel="training frames (thousand)", ylabel="greedy success (%)", ylim=(-3, 103))
    legend_of([axis], figure, 4)
    figure.suptitle("Agents A, B and C among the policies that the run kept (95 % intervals)")
    return figure


@rc_context(DARK)
def movements_chart(found: dict[str, Any]) -> Figure:
    """Histograms of the movement after each instruction, best against other episodes (the paper's figure)."""
    instructions = list(found["preliminary"][0]["told"])
    figure, rows = grid(
        len(found["preliminary"]), len(instructions), 11, 2.5 * len(found["preliminary"]) + 0.9, sharex=True
    )
    for axes, agent in zip(rows, found["preliminary"], strict=True):
        for axis, value in zip(axes, instructions, strict=True):
            _histogram(axis, agent["told"][value])
            if axes is rows[0]:
                axis.set_title(f"m* = {float(value):+.0f} “{found['phrases'][value]}”".replace("+0", "0"))
        axes[0].set_ylabel(f"agent {agent['agent']}\ndensity")
    for axis in rows[-1]:
        axis.set_xlabel(found["change_label"])
    legend_of(rows[0][:1], figure, 4)
    about = found["protocol"]
    best = f"the best: {100 * about['top_fraction']:.0f} % of the episodes, by return"
    figure.suptitle(f"Movement over the next {about['horizon_steps']} steps, by instruction ({best})")
    return figure


def _histogram(axis: Axes, movements: dict[str, Any]) -> None:
    edges = np.array(movements["edges"])
    for name, colour, alpha in (("others", _OTHER, 0.75), ("best", _BEST, 0.45)):
        axis.stairs(movements[name]["density"], edges, color=colour, fill=True, alpha=alpha)
        axis.stairs(movements[name]["density"], edges, color=colour, linewidth=1.2, label=_GROUPS[name])
    for name, colour, line in (("others", hexed(colours.PALE), "--"), ("best", _BEST, "-")):
        if movements[name]["mean"] is not None:
            axis.axvline(
                movements[name]["mean"], color=colour, linewidth=2, linestyle=line, label=f"mean, {_GROUPS[name]}"
            )
    axis.axvline(0, color=FAINT, linewidth=0.8, linestyle=":")
    top = 1.25 * movements["shown_to"]
    axis.set_ylim(0, top or None)
    if 0 < top < max(movements["best"]["density"] + movements["others"]["density"]):
        axis.text(0.02, 0.97, "peak cut", transform=axis.transAxes, va="top", fontsize=8, color=FAINT)


@rc_context(DARK)
def claim_chart(found: dict[str, Any]) -> Figure:
    """Effect sizes of the paper's claim, over all episodes and within each context."""
    instructions = list(found["preliminary"][0]["told"])
    figure, [axes] = grid(1, len(instructions), 11, 3.6, sharey=True)
    names = [agent["agent"] for agent in found["preliminary"]]
    for axis, value in zip(axes, instructions, strict=True):
        for place, agent in enumerate(found["preliminary"]):
            claims = agent["told"][value]["claim"]
            for over, shift, colour, marker in (("all", -0.13, _BEST, "o"), ("within", 0.13, _YELLOW, "D")):
                if claims[over]:
                    interval(axis, claims[over]["superiority"], place + shift, colour, marker)
        axis.axvline(0.5, color=INK, linewidth=0.9, linestyle=":")
        axis.set(xlim=(0, 1), ylim=(len(names) - 0.5, -0.5), xlabel="chance that a best episode follows more")
        asked = "moves further that way" if float(value) else "moves less to either side"
        axis.set_title(f"m* = {float(value):+.0f}: {asked}".replace("+0", "0"))
    axes[0].set_yticks(range(len(names)), [f"agent {name}" for name in names])
    for over, colour, marker in (
        ("over all episodes, as in the paper", _BEST, "o"),
        (f"among episodes with the same {found['protocol']['context']}", _YELLOW, "D"),
    ):
        axes[0].plot([], [], color=colour, marker=marker, label=over)
    legend_of(axes[:1], figure, 2)
    figure.suptitle(
        "Do the best episodes follow the instruction more? (0.5: no difference; 95 % intervals over episodes)"
    )
    return figure


@rc_context(DARK)
def expressions_chart(found: dict[str, Any]) -> Figure:
    """The expressions of the clusters, the paper's vocabulary beside ours (the paper's figure), with their sizes."""
    taught = found["expressions"]
    figure, rows = grid(2 * len(taught), 2, 10.5, 3.7 * len(taught) + 0.6, height_ratios=[3, 1] * len(taught))
    for row, agent in enumerate(taught):
        for column, name in enumerate((PAPERS, DEFAULT)):
            results = agent["vocabularies"][name]
            _clusters(rows[2 * row][column], rows[2 * row + 1][column], results)
            lean = f"skew {results['skew']:+.2f}, {results['below_zero']} left of 0, {results['above_zero']} right"
            rows[2 * row][column].set_title(f"Agent {agent['agent']}, {VOCABULARY_NAMES[name]}: {lean}")
        rows[2 * row][0].set_ylabel("expression mⁱ")
        rows[2 * row + 1][0].set_ylabel("windows (%)")
    for axis in rows[-1]:
        axis.set_xlabel("cluster, from left to right")
    figure.suptitle("What each cluster is called: -1 “left”, 0 “straight down”, +1 “right”; band: called straight")
    return figure


def _clusters(above: Axes, below: Axes, results: dict[str, Any]) -> None:
    said, sizes = np.array(results["expressions"]), np.array(results["sizes"], float)
    places, shades = np.arange(1, len(said) + 1), expression_colours(said)
    above.axhspan(-results["straight_below"], results["straight_below"], color=FAINT, alpha=0.18, linewidth=0)
    above.axhline(0, color=FAINT, linewidth=0.8)
    above.vlines(places, 0, said, color=shades, linewidth=5)
    above.scatter(places, said, color=shades, s=60, zorder=3)
    for place, value in zip(places.tolist(), said.tolist(), strict=True):
        at, beside = (place, value), (0, 7 if value >= 0 else -15)
        above.annotate(_signed(value), at, beside, textcoords="offset points", ha="center", fontsize=8)
    above.set(ylim=(-1.35, 1.35), xticks=places, xlim=(0.4, len(said) + 0.6), yticks=[-1, -0.5, 0, 0.5, 1])
    above.tick_params(labelbottom=False)
    below.bar(places, 100 * sizes / sizes.sum(), color=shades)
    below.set(xticks=places, xlim=(0.4, len(said) + 0.6))


def _signed(value: float) -> str:
    text = f"{value:+.2f}"
    return text[1:] if float(text) == 0 else text


@rc_context(DARK)
def straight_chart(found: dict[str, Any]) -> Figure:
    """When small movements are called straight, and which half of the mapping makes it so."""
    results = found["straight"]
    figure, rows = grid(len(results), 2, 11, 3.6 * len(results) + 1.0, width_ratios=[1.25, 1])
    for (left, right), agent in zip(rows, results, strict=True):
        for name in (PAPERS, DEFAULT):
            _rates(left, agent["by_movement"][name], name)
        for edge in agent["small"]:
            left.axvspan(-edge[1], -edge[0], color=hexed(colours.NEGATIVE), alpha=0.13, linewidth=0)
            left.axvspan(edge[0], edge[1], color=hexed(colours.POSITIVE), alpha=0.13, linewidth=0)
        left.set(ylim=(0, 103), ylabel=f"agent {agent['agent']}\ncalled straight (%)", xlabel=found["change_label"])
        _small(right, agent["rates"])
    rows[0][0].set_title("Realised movement, and how often it is called straight")
    rows[0][1].set_title("Small movements that are misnamed")
    legend_of(rows[0], figure, 3)
    figure.suptitle("The paper's failed episode: min-max or the split? (95 % intervals over episodes)")
    return figure


def _rates(axis: Axes, rows: list[dict[str, Any]], name: str) -> None:
    middles = [(row["from"] + row["to"]) / 2 for row in rows]
    low, high, value = (
        [100 * row[key] if row[key] is not None else np.nan for row in rows] for key in ("low", "high", "value")
    )
    axis.fill_between(middles, low, high, color=OBSERVER_COLOURS[name], alpha=0.2, linewidth=0)
    axis.plot(
        middles,
        value,
        color=OBSERVER_COLOURS[name],
        marker=OBSERVER_MARKERS[name],
        markersize=5,
        label=VOCABULARY_NAMES[name],
    )


def _small(axis: Axes, rates: dict[str, dict[str, Any]]) -> None:
    for place, results in enumerate(rates.values()):
        for side, shift, colour in (("left", -0.2, colours.NEGATIVE), ("right", 0.2, colours.POSITIVE)):
            called, wrong = (100 * (results[f"{kind}_{side}"]["value"] or 0.0) for kind in ("straight", "wrong"))
            solid: dict[str, Any] = {
                "color": hexed(colour),
                "label": None if place else f"to the {side}, called straight",
            }
            hatched: dict[str, Any] = {"facecolor": "none", "edgecolor": hexed(colour), "hatch": "////"}
            hatched["label"] = "" if place else f"to the {side}, called the other way"
            axis.barh(place + shift, called, 0.36, **solid)
            axis.barh(place + shift, wrong, 0.36, left=called, **hatched)
    axis.set_yticks(range(len(rates)), [VARIANT_LABELS[name] for name in rates])
    axis.set(xlim=(0, 100), ylim=(len(rates) - 0.4, -0.6), xlabel="share of the small movements (%)")


@rc_context(DARK)
def errors_chart(found: dict[str, Any]) -> Figure:
    """How far off the observers are, agent by agent and cut by cut."""
    results = [(agent["agent"], cut, agent["cuts"][cut]) for agent in found["prediction"] for cut in CUT_TITLES]
    figure, rows = grid(
        len(found["prediction"]), len(CUT_TITLES), 11, 3.1 * len(found["prediction"]) + 0.6, sharey=True, sharex="col"
    )
    names = list(OBSERVER_LABELS)
    for axis, (agent, cut, judged) in zip([axis for row in rows for axis in row], results, strict=True):
        for place, name in enumerate(names):
            interval(axis, judged["error"][name], place, OBSERVER_COLOURS[name], OBSERVER_MARKERS[name])
        none = judged["error"][NO_WORDS]["value"]
        axis.axvline(none, color=OBSERVER_COLOURS[NO_WORDS], linewidth=0.9, linestyle=":")
        axis.set_title(f"Agent {agent}, {CUT_TITLES[cut]}")
        axis.set(ylim=(len(names) - 0.5, -0.5))
    for row in rows:
        row[0].set_yticks(range(len(names)), [OBSERVER_LABELS[name] for name in names])
    for axis in rows[-1]:
        axis.set_xlabel("error of the predicted x (% of the width)")
    figure.suptitle("Where will it end? Simulated observers, no people (95 % intervals over episodes)")
    return figure


@rc_context(DARK)
def episodes_chart(found: dict[str, Any]) -> Figure:
    """The error in each of the episodes, with and without explanation."""
    agents = found["prediction"]
    figure, rows = grid(len(agents), len(CUT_TITLES), 13, 3.2 * len(agents) + 0.6)
    for axes, agent in zip(rows, agents, strict=True):
        for axis, (cut, title) in zip(axes, CUT_TITLES.items(), strict=True):
            _each(axis, agent["cuts"][cut]["episodes"])
            axis.set_title(f"Agent {agent['agent']}, {title}")
        axes[0].set_ylabel("error (% of the width)")
    for axis in rows[-1]:
        axis.set_xlabel("episode")
    legend_of(rows[0][:1], figure, 3)
    figure.suptitle("Every episode by itself (simulated observers)")
    return figure


def _each(axis: Axes, episodes: list[dict[str, Any]]) -> None:
    places = np.arange(1, len(episodes) + 1)
    for name, shift in ((NO_WORDS, -0.25), (PAPERS, 0.0), (DEFAULT, 0.25)):
        values = [each["errors"][name] for each in episodes]
        axis.vlines(places + shift, 0, values, color=OBSERVER_COLOURS[name], linewidth=2, alpha=0.7)
        axis.plot(
            places + shift,
            values,
            OBSERVER_MARKERS[name],
            color=OBSERVER_COLOURS[name],
            markersize=4.5,
            label=OBSERVER_LABELS[name],
        )
    axis.set(xticks=places, xlim=(0.3, len(episodes) + 0.7), ylim=(0, None))
    axis.grid(visible=False, axis="x")
