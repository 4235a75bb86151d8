"""Tables and the figure of ``benchmarks.robustness``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.pages import fill
from benchmarks.truth import interquartile
from benchmarks.truth_report import BLUE, DOCS, GREY
from ibe_rl.types import Array

PAGE = DOCS / "INSTRUCTION.md"
COMMAND = "benchmarks.robustness"
NEAR_STEPS, PANELS_IN_A_ROW = 5, 4
MAPPINGS = {"own": ("ours", BLUE), "paper": ("the paper's", GREY)}


def write_report(found: dict[str, Any], output: Path | None = None) -> None:
    """Draw the curves and put the tables into docs/INSTRUCTION.md, or all into ``output``."""
    draw(found["curves"], (output or DOCS / "img") / "robustness.png")
    page = output / PAGE.name if output else PAGE
    fill(page, {"flaws": flaws_table(found["curves"]), "anew": anew_table(found["anew"])}, COMMAND)


def growth(records: list[dict[str, Any]], curve: str, mapping: str) -> dict[str, Array]:
    """Point to how much above that without flaws the loss of each run and draw is, if anything was taught."""
    mine = [one for one in records if one["curve"] == curve]
    points = list(dict.fromkeys(one["point"] for one in mine))
    clean = {(one["seed"], one["draw"]): one[mapping] for one in mine if one["point"] == points[0]}
    found: dict[str, list[float]] = {point: [] for point in points}
    for one in mine:
        before = clean[one["seed"], one["draw"]]
        if one[mapping] is not None and before is not None:
            found[one["point"]].append(one[mapping] - before)
    return {point: np.array(values) for point, values in found.items()}


def told(values: Array) -> dict[str, float] | None:
    """Interquartile mean with its interval; None where there is nothing."""
    return interquartile(values[:, None])[0] if len(values) else None


def flaws_table(records: list[dict[str, Any]]) -> list[str]:
    """By how much ``vocabulary_loss`` grows at each point of each curve."""
    lines = ["| flaw | | ours | the paper's | delay found | told within 5 steps |", "|---|---|---|---|---|---|"]
    for curve in dict.fromkeys(one["curve"] for one in records):
        columns = {mapping: growth(records, curve, mapping) for mapping in MAPPINGS}
        for point in list(columns["own"])[1:]:
            cells = [_cell(columns[mapping][point], mapping, records, curve, point) for mapping in MAPPINGS]
            mine = [one for one in records if (one["curve"], one["point"]) == (curve, point)]
            lines.append(f"| {curve} | {point} | {' | '.join(cells)} | {' | '.join(_delays(mine))} |")
    return lines


def _delays(records: list[dict[str, Any]]) -> tuple[str, str]:
    """The delays found in runs and draws, from the least to the longest, and how many are within ``NEAR_STEPS``."""
    known = [one["delay"]["steps"] for one in records if one.get("delay", {}).get("known")]
    near = sum(
        abs(one["delay"]["steps"] - one["late"]) <= NEAR_STEPS for one in records if one.get("delay", {}).get("known")
    )
    if not known:
        return "-", f"0 of {len(records)}"
    between = f"{min(known)}" if min(known) == max(known) else f"{min(known)} to {max(known)}"
    return between, f"{near} of {len(records)}"


def _cell(values: Array, mapping: str, records: list[dict[str, Any]], curve: str, point: str) -> str:
    failed = sum(one[mapping] is None for one in records if (one["curve"], one["point"]) == (curve, point))
    mean = told(values)
    said = "-" if mean is None else f"{mean['value']:+.3f} [{mean['low']:+.3f}, {mean['high']:+.3f}]"
    return said + (f", {failed} taught nothing" if failed else "")


def anew_table(records: list[dict[str, Any]]) -> list[str]:
    """Trained with a flawed instructor, against what corrupting the log of a run with a flawless one predicted."""
    lines = [
        "| instructor | seed | loss after training with it | loss predicted from the corrupted log | delay found |",
        "|---|---|---|---|---|",
    ]
    for one in sorted(records, key=lambda each: (each["name"], each["seed"])):
        values = [("-" if one[key] is None else f"{one[key]:.3f}") for key in ("trained", "corrupted")]
        lines.append(f"| {one['name']} | {one['seed']} | {' | '.join(values)} | {_delay(one.get('delay'))} |")
    return lines


def _delay(found: dict[str, Any] | None) -> str:
    if not found or not found["known"]:
        return "-"
    return f"{found['steps']} ({found['low']} to {found['high']})"


def draw(records: list[dict[str, Any]], picture: Path) -> None:
    """One panel a flaw."""
    names = list(dict.fromkeys(one["curve"] for one in records))
    rows = -(-len(names) // PANELS_IN_A_ROW)
    figure = Figure(figsize=(12, 3.4 * rows), layout="constrained")
    panels = figure.subplots(rows, PANELS_IN_A_ROW, sharey=True, squeeze=False).ravel()
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    for panel, curve in zip(panels, names, strict=False):
        _panel(panel, records, curve)
    panels[0].set_ylabel("growth of vocabulary_loss")
    panels[0].legend(framealpha=0.9)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=130, metadata={"Software": None})


def _panel(panel: Axes, records: list[dict[str, Any]], curve: str) -> None:
    for mapping, (name, colour) in MAPPINGS.items():
        known = {point: told(values) for point, values in growth(records, curve, mapping).items()}
        shown = [(float(point), mean) for point, mean in known.items() if mean is not None]
        low, middle, high = ([mean[key] for _, mean in shown] for key in ("low", "value", "high"))
        places = [place for place, _ in shown]
        panel.plot(places, middle, color=colour, marker="o", markersize=3, label=name)
        panel.fill_between(places, low, high, color=colour, alpha=0.2, linewidth=0)
    panel.axhline(0.02, color="#999999", linewidth=0.7, linestyle=":")
    panel.set_title(curve, fontsize=10)
    if curve.startswith("present"):
        panel.invert_xaxis()
