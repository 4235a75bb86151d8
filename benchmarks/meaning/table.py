"""Verdicts as a Markdown table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.meaning.judge import Verdict
from benchmarks.meaning.trial import Truth


def as_markdown(truths: Mapping[str, Truth], verdicts: Mapping[str, Sequence[Verdict]]) -> str:
    """One line a situation, and the totals.

    Args:
        truths: by the name of the situation.
        verdicts: likewise, one a seed.
    """
    seeds = max(len(each) for each in verdicts.values())
    heads = ["situation", "tellable", *(f"seed {seed}" for seed in range(seeds)), "why"]
    rows = [
        [name, "yes" if truths[name].tellable else "no", *(_cell(one) for one in each), _reasons(each)]
        for name, each in verdicts.items()
    ]
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join([*("| " + " | ".join(line) + " |" for line in lines), "", *_totals(truths, verdicts)])


def _cell(verdict: Verdict) -> str:
    return verdict.outcome if verdict.auc != verdict.auc else f"{verdict.outcome} {verdict.auc:.2f}"


def _reasons(verdicts: Sequence[Verdict]) -> str:
    """The reason of the first silent seed, or else of the first."""
    silent = [one.reason for one in verdicts if one.outcome == "silent"]
    return (silent or [verdicts[0].reason])[0].replace("|", "/")


def _totals(truths: Mapping[str, Truth], verdicts: Mapping[str, Sequence[Verdict]]) -> list[str]:
    pairs = [(truths[name].tellable, one.outcome) for name, each in verdicts.items() for one in each]
    told = [outcome for tellable, outcome in pairs if tellable]
    untold = [outcome for tellable, outcome in pairs if not tellable]
    reversed_ = [outcome for _, outcome in pairs if outcome == "reversed"]
    return [
        f"- silently reversed: {len(reversed_)} of {len(pairs)}",
        f"- tellable and true: {told.count('true')} of {len(told)}",
        f"- tellable and silent: {told.count('silent')} of {len(told)}",
        f"- not tellable and silent: {untold.count('silent')} of {len(untold)}",
    ]
