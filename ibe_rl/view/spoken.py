"""What was said in an episode as rows: consecutive steps with the same words, for the terminal and the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.metrics.quality import phrase_accuracy
from ibe_rl.metrics.stability import FLICKER_STEPS
from ibe_rl.task import Phrases
from ibe_rl.types import Array, Explanation, Moment
from ibe_rl.view.wording import SILENCE, literal, shortener, span_name

NOT_TRUSTED = "(?)"
TITLES = ("steps", "instruction", "expression", "confidence", "as predicted")

Cells = tuple[str, ...]


@dataclass(frozen=True)
class Row:
    """Steps ``first`` to ``last`` with the same words; the cells are in the order of ``titles``."""

    first: int
    last: int
    cells: tuple[str, ...]


def titles(said: Sequence[Explanation]) -> list[str]:
    """The columns: a phrase for each span of time between the instruction and the figures."""
    steps, instruction, *figures = TITLES
    return [steps, instruction, *(span_name(one.horizon_steps) for one in said[0].all_spans), *figures]


def spoken_words(moments: Sequence[Moment], said: Sequence[Explanation], phrases: Sequence[Phrases]) -> list[Cells]:
    """The instruction of each step and what is said of each span, marked where the predictor distrusts its path."""
    shorten = shortener(phrases)
    instructions = [shorten(phrase(one.instruction, phrases)) if one.given else SILENCE for one in moments]
    marks = [["" if span.trusted else f" {NOT_TRUSTED}" for span in one.all_spans] for one in said]
    spans = [[shorten(span.said) for span in one.all_spans] for one in said]
    return [
        (each, *(text + mark for text, mark in zip(texts, marked, strict=True)))
        for each, texts, marked in zip(instructions, spans, marks, strict=True)
    ]


def spoken_rows(words: Sequence[Cells], said: Sequence[Explanation], true: Array, steady: bool = True) -> list[Row]:
    """Rows for the steps of an episode.

    Args:
        words: for each step the instruction, and what is said of each span of time.
        said: the explanations, one a step.
        true: ``(T,)`` whether it went as said, from ``phrase_hits``.
        steady: leaves out changes that are undone within ``FLICKER_STEPS``.
    """
    shown = without_flicker(words) if steady else list(words)
    rows = []
    for cells, group in groupby(range(len(said)), key=shown.__getitem__):
        steps = list(group)
        spoken = [said[step] for step in steps if words[step] == cells]
        span = str(steps[0]) if len(steps) == 1 else f"{steps[0]}-{steps[-1]}"
        known = [step for step in steps if said[step].known]
        rows.append(Row(steps[0], steps[-1], (span, *cells, *_figures(spoken), _share(true[known]))))
    return rows


def without_flicker(words: Sequence[Cells]) -> list[Cells]:
    """The same with every change that is undone within ``FLICKER_STEPS`` taken back; the instruction is never changed.

    >>> without_flicker([("up", "a"), ("up", "b"), ("up", "a"), ("up", "c")])
    [('up', 'a'), ('up', 'a'), ('up', 'a'), ('up', 'c')]
    """
    shown = list(words)
    for step in range(1, len(shown)):
        before = shown[step - 1]
        soon = shown[step : step + FLICKER_STEPS + 1]
        back = soon.index(before) if before in soon else 0
        if all(each[0] == before[0] for each in soon[:back]):
            shown[step : step + back] = [before] * back
    return shown


def markdown(said: Sequence[Explanation], rows: Sequence[Row]) -> str:
    """Rows as a table."""
    lines = [titles(said), ["--:", *[":--"] * (len(titles(said)) - 1)], *([*map(literal, row.cells)] for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _figures(said: Sequence[Explanation]) -> tuple[str, str]:
    """Expression (of words, the largest share) and confidence of steps with the same words; "-" where undefined."""
    meant = said[0].meant
    means = movements_said(said).mean(axis=0)
    numbers = f"{means.max():.0%}" if said[0].in_words else " ".join(f"{value:+.2f}" for value in means)
    confidence = f"{np.mean([one.confidence for one in said]):.0%}" if meant and said[0].calibrated else "-"
    return (numbers if meant else "-"), confidence


def _share(true: Array) -> str:
    share = phrase_accuracy(true)
    return "-" if np.isnan(share) else f"{share:.0%}"
