"""The tables of ``benchmarks.scaling`` in docs/SCALING.md."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.pages import fill
from benchmarks.report import setting
from benchmarks.truth_report import DOCS

PAGE = DOCS / "SCALING.md"
COMMAND = "benchmarks.scaling"
ALONE = "in the trainer"


def write_report(found: dict[str, Any], output: Path | None = None) -> None:
    """Put the tables into docs/SCALING.md, or alone into ``output``."""
    tables = {
        "conditions": conditions(found),
        "collection": collection(found["rounds"]),
        "training": training(found["rounds"]),
        "limits": limits(found["rounds"]),
    }
    fill(output / PAGE.name if output else PAGE, tables, COMMAND)


def conditions(found: dict[str, Any]) -> list[str]:
    """When, where and how often."""
    rounds = len(found["rounds"])
    return [f"Measured {found['about']['date']}, {rounds} round{'s' * (rounds > 1)}, {setting(found['about'])}."]


def against(rates: dict[str, list[float]], name: str) -> str:
    """The cells of an arm: its median, and the median and range of its ratios to ``ALONE`` in the same round."""
    ratios = [one / alone for one, alone in zip(rates[name], rates[ALONE], strict=True)]
    spread = f"{min(ratios):.2f} to {max(ratios):.2f}"
    return f"{median(rates[name]):,.0f} | {median(ratios):.2f} | {spread}"


def collection(rounds: list[dict[str, Any]]) -> list[str]:
    """Batches as fast as they come, nobody learns."""
    rates = {name: [one["collect"][name] for one in rounds] for name in rounds[0]["collect"]}
    lines = [f"| collection alone | frames/s | times that {ALONE} | of single rounds |", "|---|---:|---:|---|"]
    return lines + [f"| {name} | {against(rates, name)} |" for name in rates]


def training(rounds: list[dict[str, Any]]) -> list[str]:
    """All of train.py, and what the trainer spends its time on."""
    rates = {name: [one["train"][name]["frames_per_s"] for one in rounds] for name in rounds[0]["train"]}
    head = f"| train.py | frames/s | times that {ALONE} | of single rounds | waits for batches | learns | logs |"
    lines = [head, "|---|---:|---:|---|---:|---:|---:|"]
    for name in rates:
        shares = [one["train"][name]["shares"] for one in rounds]
        told = " | ".join(f"{median(one[part] for one in shares):.0%}" for part in ("collect", "learn", "log"))
        lines.append(f"| {name} | {against(rates, name)} | {told} |")
    return lines


def limits(rounds: list[dict[str, Any]]) -> list[str]:
    """Where a worker's time goes, what bringing the batches costs, and what the trainer alone takes."""
    inside = {part: median(one["inside"][part] for one in rounds) for part in rounds[0]["inside"]}
    lines = ["| a worker's time while it collects | share |", "|---|---:|"]
    names = {"games": "the games and their instructor", "policy": "the policy", "collector": "TorchRL's collector"}
    lines += [f"| {names[part]} | {share:.0%} |" for part, share in inside.items()]
    lines += ["", "| what bringing the batches costs, of a worker's time | share |", "|---|---:|"]
    for name in ("1 process of its own", "Ray, 1 worker"):
        costs = [1 - one["collect"][name] / one["collect"][ALONE] for one in rounds]
        lines.append(f"| {name} | {median(costs):.0%} |")
    trainer = median(one["train"][ALONE]["learning_s"] for one in rounds)
    return [
        *lines,
        "",
        f"The trainer itself, with nobody to wait for, takes {trainer:.1f} s a million frames: "
        f"at most {1e6 / trainer:,.0f} frames/s, however many workers there are.",
    ]
