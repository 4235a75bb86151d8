"""Tables and figures of ``benchmarks.truth``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from ibe_rl.storage.run_folder import write_atomically

DOCS = Path(__file__).parent.parent / "docs"
PAGE, PICTURES = DOCS / "QUALITY.md", DOCS / "img"
BEGIN, END = "<!-- tables: python -m benchmarks.truth -->", "<!-- end of tables -->"
BLUE, ORANGE, GREY, GREEN, PINK = "#0072B2", "#E69F00", "#8C8C8C", "#009E73", "#CC79A7"
AGENT_COLOURS = {"ppo": BLUE, "dqn": ORANGE}

NOT_TOLD = "-"
SHOWN = {
    "ibe:axis": "axis (default, as refreshed)",
    "refit:axis": "axis, learnt from nothing",
    "refit:axis_soft": "axis, soft membership",
    "refit:axis_direct": "axis, no clusters",
    "refit:axis_quantile": "axis, equal clusters",
    "refit:axis_bisecting": "axis, halved clusters",
    "refit:axis_mean": "axis, mean instruction",
    "refit:lasso": "lasso of m* on Δs",
    "refit:network": "network from Δs to m*",
    "refit:information": "weighted by information",
    "refit:paper_context": "paper, best of each pad",
    "refit:paper_sign": "paper, signs kept",
    "baseline:paper": "the paper's",
    "baseline:present_velocity": "present velocity",
    "baseline:state_regressor": "regression from the state",
    "baseline:direction_to_goal": "direction to the goal",
    "baseline:last_instruction": "last instruction",
    "baseline:constant": "always the same",
    "baseline:predicted_change": "predicted change itself",
    "baseline:true_future": "true future",
    "no_explanation": "no explanation",
    "baseline:flipped": "flipped",
    "baseline:shuffled": "shuffled instructions",
    "baseline:random_clusters": "random clusters",
    "baseline:random_names": "names dealt at random",
    "baseline:another_moment": "another moment's future",
}
"""Explainers in the order of the report, and what they are called in it."""
VOCABULARIES = list(SHOWN)[:13]
COLUMNS = {
    "motion_auc": "`motion_auc`",
    "motion_auc_disobeyed": "disobeyed",
    "motion_spearman": "`spearman`",
    "vocabulary_loss": "`vocabulary_loss`",
    "came_true": "`came_true`",
    "came_true_voted": "voted",
    "observer_error": "`observer_error` %",
    "ece": "`ece`",
    "size_cv": "`size_cv`",
    "size_max": "largest",
}
GOALS = [
    ("vocabulary_loss", "≤", 0.015),
    ("motion_auc", "≥", 0.98),
    ("motion_auc_disobeyed", "≥", 0.97),
    ("motion_spearman", "≥", 0.94),
    ("came_true", "≥", 0.90),
    ("came_true_voted", "≥", 0.90),
    ("ece", "≤", 0.05),
    ("size_cv", "≤", 0.60),
    ("size_max", "≤", 0.35),
]


def insert_tables(together: dict[str, Any]) -> None:
    """Put the tables between their marks in docs/QUALITY.md."""
    page = PAGE.read_text()
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    parts = [part for agent in together["iqm"] for part in _tables(agent, together)]
    text = f"{before}{BEGIN}\n\n" + "\n\n".join(parts) + f"\n\n{END}{after}"
    write_atomically(PAGE, lambda stream: stream.write(text.encode()))


def _tables(agent: str, together: dict[str, Any]) -> list[str]:
    runs = [run for run in together["runs"] if run["agent"] == agent]
    seeds = ", ".join(f"{run['seed']} ({run['success_rate']:.2f})" for run in runs)
    head = f"### {agent.upper()}, seeds (greedy success at the end) {seeds}"
    ages = [_ages(runs)] if all(run["changing_policy"] for run in runs) else []
    return [head, _goals(agent, together, runs), _explainers(together["iqm"][agent]), _each(runs), *ages]


def _goals(agent: str, together: dict[str, Any], runs: list[dict[str, Any]]) -> str:
    ours = together["iqm"][agent][runs[0]["ours"]]
    rows = ["| number to reach | IQM [95 %] | each seed | |", "|---|---|---|---|"]
    for metric, sign, goal in GOALS:
        told = ours[metric]
        reached = told["value"] >= goal if sign == "≥" else told["value"] <= goal
        each = " ".join(_short(run["values"][run["ours"]][metric]) for run in runs)
        rows.append(f"| `{metric}` {sign} {goal:g} | {_cell(told)} | {each} | {'reached' if reached else '**no**'} |")
    rows += [_paired_row(title, [run[key] for run in runs], sign) for title, key, sign in PAIRED]
    saved = [run["observers"][run["ours"]]["observer_error"]["value"] for run in runs]
    nothing = [run["observers"]["no_explanation"]["observer_error"]["value"] for run in runs]
    share = (
        1
        - together["iqm"][agent][runs[0]["ours"]]["observer_error"]["value"]
        / (together["iqm"][agent]["no_explanation"]["observer_error"]["value"])
    )
    each = " ".join(f"{one:.2f}/{other:.2f}" for one, other in zip(saved, nothing, strict=True))
    rows.append(
        f"| observer's error at least 40 % less than without | {share:.0%} less | {each} | {_word(share >= 0.4)} |"
    )
    for title, key in (("without explanation", "minus_no_explanation"), ("with the paper's", "minus_paper")):
        rows.append(
            _paired_row(f"observer's error less than {title}", [r["observers"][r["ours"]][key] for r in runs], -1)
        )
    sides = [run["left_right"] for run in runs]
    even = all(abs(left - right) <= 1 for left, right in sides)
    rows.append(f"| expressions left / right, ± 1 | | {' '.join(f'{a}/{b}' for a, b in sides)} | {_word(even)} |")
    return "\n".join(rows)


PAIRED = [
    ("`motion_auc` above present velocity, interval clear of 0 on every seed", "over_velocity", 1),
    ("the same above the regression from the state (not asked for)", "over_regressor", 1),
    ("the 80 % most confident go as predicted more often", "risk", -1),
]


def _paired_row(title: str, found: list[dict[str, Any]], sign: int) -> str:
    clear = [sign * (each["low"] if sign > 0 else each["high"]) > 0 for each in found]
    each = " ".join(_signed(one) for one in found)
    return f"| {title} | {sum(clear)} of {len(clear)} seeds | {each} | {_word(all(clear))} |"


def _word(reached: bool) -> str:
    return "reached" if reached else "**no**"


def _explainers(iqm: dict[str, Any]) -> str:
    rows = [f"| said by | {' | '.join(COLUMNS.values())} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for name, title in SHOWN.items():
        if name in iqm:
            cells = [_cell(iqm[name][metric]) for metric in COLUMNS]
            rows.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _each(runs: list[dict[str, Any]]) -> str:
    quantiles = [np.nanquantile(np.array(run["shuffled"], float), [0.05, 0.5, 0.95]) for run in runs]
    text = "; ".join(
        f"seed {run['seed']}: {a:.2f} **{b:.2f}** {c:.2f}" for run, (a, b, c) in zip(runs, quantiles, strict=True)
    )
    return f"Instructions shuffled by whole episodes, `motion_auc` of the refits, 5 % **median** 95 %: {text}."


def _ages(runs: list[dict[str, Any]]) -> str:
    """What the last policy loses in the first vocabulary, and in the one before the last."""
    rows = [
        "| seed | own vocabulary | the first one | own minus first | went as predicted, own minus first |",
        "|---|---|---|---|---|",
    ]
    for run in runs:
        ages = run["changing_policy"]
        less = ages[0]["refreshed_minus_this"]
        auc, true = (_signed(less[metric]) for metric in ("motion_auc", "came_true"))
        own, first = (_short(row["motion_auc"]["value"]) for row in (ages[-1], ages[0]))
        rows.append(f"| {run['seed']} | {own} | {first} | {auc} | {true} |")
    return "The last policy in its own vocabulary and in that of the first refresh (`motion_auc`):\n\n" + "\n".join(
        rows
    )


def _signed(told: dict[str, float]) -> str:
    return f"{told['value']:+.3f} [{told['low']:+.3f}, {told['high']:+.3f}]"


def _cell(told: dict[str, float] | None) -> str:
    return NOT_TOLD if told is None else f"{_short(told['value'])} [{_short(told['low'])}, {_short(told['high'])}]"


def _short(value: float | None) -> str:
    return NOT_TOLD if value is None else f"{value:.3f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.2f}"


def draw(together: dict[str, Any]) -> None:
    """Draw the figures into docs/img."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    for name, make in (("truth", _truth), ("tradeoff", _tradeoff), ("controls", _controls)):
        figure = make(together)
        path = PICTURES / f"quality_{name}.png"
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
            if name in told and told[name]["observer_error"]:
                place = [told[name][metric]["value"] for metric in ("came_true", "observer_error")]
                axis.plot(*place, marker, color=_family(name), markersize=8, label=SHOWN[name], linestyle="none")
        nothing = told["no_explanation"]["observer_error"]["value"]
        axis.axhline(nothing, color=PINK, linestyle="--", linewidth=1, label="no explanation")
        axis.axhline(0.6 * nothing, color=PINK, linestyle=":", linewidth=1, label="40 % less")
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
            horizons = sorted(runs[0][key])
            means = [np.mean([run[key][h]["value"] for run in runs]) for h in horizons]
            right.plot(
                horizons,
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
