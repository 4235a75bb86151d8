"""The table of ``benchmarks.paper`` in docs/PAPER.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import fill
from benchmarks.truth_report import DOCS
from ibe_rl.apps.paper.names import AT_CONTACT, AT_END, DEFAULT, NO_WORDS, PAPERS, SIGNS_KEPT, STRAIGHT

PAGE = DOCS / "PAPER.md"
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
Runs = Sequence[dict[str, Any]]
"""As ``benchmarks.paper`` reads them."""


def insert_table(runs: Runs, output: Path | None = None) -> None:
    """Put the table into docs/PAPER.md, or alone into ``output``."""
    fill(output / PAGE.name if output else PAGE, {"paper": table(runs)}, "benchmarks.paper")


def table(runs: Runs) -> list[str]:
    """The claims of the paper, what it says, and what came out here; then how near the agents are to its own."""
    end, contact = foretold(runs, AT_END, "to the end of the episode"), foretold(runs, AT_CONTACT, "To first contact")
    rows = [
        (
            "high-score episodes follow the instruction more",
            "to the left yes, straight down yes; by eye",
            followed(runs),
        ),
        ("its clusters are skewed to the right", "yes", skewed(runs)),
        ("small movements to a side are not named as such", "one episode", missed(runs)),
        (
            "hearing it helps to predict where the lander comes down",
            "1 of 20 episodes better, 1 worse",
            f"{end} {contact}",
        ),
    ]
    head = [f"| over {kinds(runs)} | the paper | here |", "|---|---|---|"]
    return [*head, *(f"| {' | '.join(row)} |" for row in rows), "", near(runs)]


def kinds(runs: Runs) -> str:
    """How many runs of which kind of agent, in the order in which they were named."""
    counts = Counter(run["agent"].upper() for run in runs)
    parts = [f"{_number(count)} {agent}" for agent, count in counts.items()]
    return f"{_and(parts)} run{'s' * (counts[next(reversed(counts))] > 1)}"


def followed(runs: Runs) -> str:
    """In how many tests the best episodes follow more: each run, agent and instruction is one."""
    told = [(float(value), claim) for run in runs for one in run["claims"].values() for value, claim in one.items()]
    aside, down = ([claim for value, claim in told if bool(value) == way] for way in (True, False))
    return f"to a side: {_followed(aside)}. Straight down: {_followed(down)}"


def _followed(claims: Sequence[dict[str, str | None]]) -> str:
    within, everywhere = (_tests([claim[over] for claim in claims]) for over in ("within", "all"))
    return f"{within} among episodes with the same pad, {everywhere} over all"


def _tests(verdicts: Sequence[str | None]) -> str:
    known = [one for one in verdicts if one is not None]
    return f"in {known.count('yes')} of {len(known)} tests (the reverse in {known.count('no')})"


def skewed(runs: Runs) -> str:
    """In how many vocabularies the mean expression is above 0."""
    every = [one for run in runs for one in run["skew"].values()]
    paper, ours = ([one[name] for one in every] for name in (PAPERS, DEFAULT))
    return f"in {sum(one > 0 for one in paper)} of {len(paper)} vocabularies, {_spread(paper)}; ours {_spread(ours)}"


def _spread(skews: Sequence[float]) -> str:
    if not skews:
        return "not known"
    mean, low, high = (f"{round(each, 2) + 0.0:+.2f}" for each in (np.mean(skews), min(skews), max(skews)))
    return f"mean expression {mean} ({low} to {high})"


def missed(runs: Runs) -> str:
    """The mean share over runs, agents and sides, and what of it goes away with the signs kept instead of min-max."""
    known = [one for run in runs for one in run["missed"].values() if one is not None]
    if not known:
        return "no such movements"
    paper, signs, ours = (100 * float(np.mean([one[name] for one in known])) for name in (PAPERS, SIGNS_KEPT, DEFAULT))
    return f"in {paper:.0f} %; with its clusters but without min-max {signs:.0f} %; ours {ours:.0f} %"


def foretold(runs: Runs, cut: str, title: str) -> str:
    """In how many cases the words help significantly, and the mean errors; each run and agent is a case."""
    cases = [one[cut] for run in runs for one in run["foretold"].values()]
    if not cases:
        return f"{title}: not known."
    helped, mean = {}, {}
    for name in (PAPERS, DEFAULT):
        verdicts = [one[name] for one in cases]
        helped[name] = f"better in {verdicts.count('yes')} of {len(cases)} cases, worse in {verdicts.count('no')}"
    for name in (NO_WORDS, STRAIGHT, PAPERS, DEFAULT):
        mean[name] = f"{np.mean([one['error'][name] for one in cases]):.1f} %"
    return (
        f"{title}: with its words {helped[PAPERS]}; with ours {helped[DEFAULT]}. Mean error {mean[NO_WORDS]} without "
        f"words, {mean[STRAIGHT]} expecting it straight down, {mean[PAPERS]} with its words, {mean[DEFAULT]} with ours."
    )


def near(runs: Runs) -> str:
    """In how many runs the agents are as good as the paper's; the others are counted as well."""
    names = sorted({name for run in runs for name in run["near"]} - {"C"})
    counts = {name: [run["near"][name] for run in runs if name in run["near"]] for name in names}
    told = _and([f"{name} in {sum(found)} of {len(found)}" for name, found in counts.items()])
    return f"As good as the paper's agent, up to 8 points: {told} runs. In the other runs the nearest policy counts."


def _number(count: int) -> str:
    return NUMBERS[count] if count < len(NUMBERS) else f"{count}"


def _and(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
