"""The summary in the terminal: a short table, and where the rest is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.apps.report_page import number
from ibe_rl.apps.summary.shares import ALL_CONTEXTS, WHOLE_EPISODE
from ibe_rl.evaluation import tables
from ibe_rl.view.wording import span_name

SHOWN_PHRASES, MOST_ROWS_BESIDE = 3, 6
MEASURE_NAMES = {
    "success": "success",
    "return": "return",
    "length_steps": "steps an episode",
    "came_true": "came as said",
    "not_as_told": "went another way than told",
    "said_not_as_told": "said another way than told",
}
"""Measures to their names for people."""


def print_summary(found: Mapping[str, Any], path: Path, page: Path, shorten: Callable[[str], str]) -> None:
    """Print what the agent does, the telling episodes, the comparison, and the paths.

    Args:
        found: what summary.json holds.
        path: of that file.
        page: its path.
        shorten: a phrase to one that fits into a table.
    """
    console = tables.console()
    if by := found["protocol"]["instructed_by"]:
        console.print(f"The instructions are {by}, not the rule's.", soft_wrap=True)
    console.print(shares_table(found, shorten))
    for line in [*lines_not_as_told(found["not_as_told"]), "", "The episodes that say most about it:"]:
        console.print(line, soft_wrap=True)
    for one in found["telling_episodes"]:
        console.print(f"  seed {one['seed']}, {one['context']}: {one['special']}", soft_wrap=True)
    if found["beside"]:
        console.print()
        console.print(beside_table(found))
    console.print(f"\nnumbers: {path}\npage:    {page}", soft_wrap=True)


def shares_table(found: Mapping[str, Any], shorten: Callable[[str], str]) -> Table:
    """What was said most: in all contexts by phase, in each context over whole episodes."""
    about = found["protocol"]
    table = Table(box=SIMPLE, show_edge=False, title_justify="left", padding=(0, 1, 0, 0))
    table.title = (
        f"{about['run']}, policy of frame {about['policy_frame']:,}: {about['episodes']} unseen episodes, "
        f"{about['steps']:,} steps; it speaks of its {span_name(about['horizon_steps'])}"
    )
    table.add_column("context", no_wrap=True)
    table.add_column("phase", no_wrap=True)
    table.add_column("says", overflow="fold")
    table.add_column("came as said", justify="right")
    table.add_column("not as told", justify="right")
    for row in found["shares"]:
        if row["context"] != ALL_CONTEXTS and row["phase"] != WHOLE_EPISODE:
            continue  # the page has them
        table.add_row(
            row["context"],
            row["phase"],
            mostly(row["said"], shorten),
            percent(row["came_true"]),
            percent(row["not_as_told"]),
        )
    return table


def mostly(shares: Mapping[str, float], shorten: Callable[[str], str]) -> str:
    """The most frequent phrases of a part."""
    first = [f"{shorten(phrase)} {share:.0%}" for phrase, share in list(shares.items())[:SHOWN_PHRASES]]
    more = len(shares) - len(first)
    return ", ".join(first) + (f", {more} more" if more else "")


def percent(estimate: Mapping[str, Any], interval: bool = False) -> str:
    """A share with or without its interval."""
    if estimate["value"] is None:
        return "-"
    text = f"{estimate['value']:.0%}"
    known = interval and estimate["low"] is not None
    return f"{text} [{100 * estimate['low']:.0f}, {100 * estimate['high']:.0f}]" if known else text


def lines_not_as_told(found: Mapping[str, Any]) -> list[str]:
    """Where it does not do as told, in sentences."""
    if found["went"]["value"] is None:
        return ["Nobody told it anything, so it cannot be said whether it does as told."]
    if not found["moments"]:
        return ["It always does as told."]
    worst = max((one for one in found["by"] if one["by"] == "instruction"), key=lambda one: one["went"]["value"])
    longest = found["moments"][0]
    return [
        f"It does not do as told at {percent(found['went'], True)} of the steps (95 % interval), and then has said "
        f"so at {percent(found['said_so'])}.",
        f"Most after “{worst['name']}” ({percent(worst['went'])}). Longest: seed {longest['seed']}, steps "
        f"{longest['first_step']} to {longest['last_step']}, told “{longest['told']}”, it went: {longest['came']}.",
    ]


def beside_table(found: Mapping[str, Any]) -> Table:
    """Two agents side by side, with the difference."""
    other = found["beside"]["other"]
    table = Table(box=SIMPLE, show_edge=False, title_justify="left", padding=(0, 1, 0, 0))
    table.title = f"Beside {agent_name(other)}, on the same seeds (95 % intervals)"
    for heading in ("", "this", "other", "this minus other"):
        table.add_column(heading, justify="right" if heading else "left", overflow="fold")
    for row in found["beside"]["measures"]:
        table.add_row(MEASURE_NAMES[row["name"]], *cells(row))
    for row in found["beside"]["phrases"][:MOST_ROWS_BESIDE]:
        table.add_row(f"says “{row['name']}”", *cells(row))
    return table


def agent_name(agent: Mapping[str, Any]) -> str:
    """An agent as a heading names it."""
    return f"{agent['run']}, policy of frame {agent['policy_frame']:,}"


def cells(row: Mapping[str, Any]) -> Sequence[str]:
    """Both values and their difference."""
    digits = 1 if row["name"] in ("return", "length_steps") else 2
    return (*(number(row[each], digits) for each in ("this", "other")), number(row["difference"], digits, sign=True))
