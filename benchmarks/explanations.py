"""Exact explanations a second, against the naive loop and against the bare engine."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.child import measure
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say

GAME_FRAME_MS = 20.0
"""One frame of a game at 50 frames a second."""
PAIRS = {
    "explanations_batched_vs_naive": ("explanations/s", "batched", "naive"),
    "explanations_vs_engine": ("explanations/s", "batched", "engine"),
    "explanation_live_ms": ("ms", "live_ms", "game_frame_ms"),
    "explanations_what_if": ("explanations/s", "what_if", "batched"),
    "explanation_live_what_if_ms": ("ms", "live_what_if_ms", "live_ms"),
}
"""Figures: their unit, and what of ``explaining.rates`` is ours and what it is compared with."""


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Measure all ways in turn, as often as asked; yields the figures so far after each round."""
    found: list[dict[str, float]] = []
    for repeat in range(plan.repeats):
        say(f"explanations, round {repeat + 1} of {plan.repeats}")
        sizes = {"moments": plan.sizes.moments, "live_moments": plan.sizes.live_moments}
        found.append(measure("explaining.rates", **sizes) | {"game_frame_ms": GAME_FRAME_MS})
        say(f"  {', '.join(f'{name} {value:,.1f}' for name, value in found[-1].items())}")
        yield figures(found)


def figures(found: list[dict[str, float]]) -> Figures:
    """The pairs as records."""
    return [
        figure(name, unit, plain([rates[mine] for rates in found]), plain([rates[other] for rates in found]))
        for name, (unit, mine, other) in PAIRS.items()
    ]
