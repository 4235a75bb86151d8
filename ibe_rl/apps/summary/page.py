"""The page of a summary: bars of phrases, tables, films, in one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ibe_rl.apps.report_page import write_page
from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.films import film_of
from ibe_rl.apps.summary.phrase_colours import Colours, phrase_colours, told_colours
from ibe_rl.apps.summary.printing import MEASURE_NAMES, agent_name, cells, lines_not_as_told, percent
from ibe_rl.task import Task
from ibe_rl.view import palette

MOST_SHOWN = 12
"""Phrases with a colour of their own in a bar."""
OTHER, LEAST_OF_INK = "other phrases", 100
"""What they are called together, and the brightness below which letters on a colour are light."""


def write_summary_page(
    folder: Path, found: Mapping[str, Any], played: Sequence[PlayedEpisode], others: Sequence[PlayedEpisode], task: Task
) -> Path:
    """Write the page; returns its path.

    Args:
        folder: where it goes.
        found: what summary.json holds.
        played: the episodes.
        others: those of the agent beside it, or none.
        task: of the environment.
    """
    colours = phrase_colours([*played, *others], task)
    films = [film_of(played[one["number"]], task, colours) for one in found["telling_episodes"]]
    shown = shown_phrases(found["shares"][0], colours)
    _, page = write_page(
        "ibe_rl.apps.summary",
        folder,
        {},
        found=found,
        about=found["protocol"],
        legend={phrase: css(colours[phrase]) for phrase in shown},
        left_out=len(colours) - len(shown),
        contexts=by_context(found["shares"], shown, colours),
        not_as_told=lines_not_as_told(found["not_as_told"]),
        films=films,
        colours={phrase: css(colour) for phrase, colour in (told_colours(played, task) | colours).items()},
        called=MEASURE_NAMES,
        cells=cells,
        agent_name=agent_name,
        percent=percent,
    )
    return page


def by_context(rows: Sequence[Mapping[str, Any]], shown: Sequence[str], colours: Colours) -> dict[str, list[Any]]:
    """Contexts to their rows, that of whole episodes first, with the bars of each."""
    found: dict[str, list[Any]] = {}
    for row in rows:
        bars = {each: bar(row[each], shown, colours) for each in ("said", "came")}
        found.setdefault(row["context"], []).append({**row, "bars": bars})
    return found


def css(colour: Sequence[int]) -> str:
    """A colour as a style sheet has it."""
    return f"rgb({' '.join(map(str, colour))})"


def shown_phrases(whole: Mapping[str, Any], colours: Colours) -> list[str]:
    """The phrases that were said or came most, in the order of the colours."""
    often = {each: whole["said"].get(each, 0.0) + whole["came"].get(each, 0.0) for each in colours}
    most = sorted(often, key=lambda each: -often[each])[:MOST_SHOWN]
    return [each for each in colours if each in most]


def bar(shares: Mapping[str, float], shown: Sequence[str], colours: Colours) -> list[dict[str, Any]]:
    """The parts of a bar: phrase, share and colour; what is not shown is one part at its end."""
    parts = [(each, shares[each], colours[each]) for each in shown if each in shares]
    rest = sum(share for each, share in shares.items() if each not in shown)
    parts += [(OTHER, rest, palette.GRID)] if rest > 0 else []
    return [
        {"phrase": each, "share": share, "colour": css(colour), "dark": max(colour) < LEAST_OF_INK}
        for each, share, colour in parts
    ]
