"""One episode in the terminal: what the agent would do if it were told something else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.explain.what_if import together, whatever
from ibe_rl.task import Phrases
from ibe_rl.types import Explanation
from ibe_rl.view.spoken import without_flicker
from ibe_rl.view.wording import shortener, span_name

MOST_COLUMNS = 4
"""So many values have a column each; of more, those with the same answer are listed together."""
FIRST_ANSWERS, MOST_ANSWERS = 14, 20
"""Rows from the beginning, and in all."""
THE_SAME = "the same whatever it is told"


def answers_table(said: Sequence[Explanation], words: Sequence[Phrases]) -> Table:
    """What it would do if it were told each value: a row for consecutive steps with the same answers."""
    short, names = shortener(words), list(said[0].what_if)
    columns = [f"told {short(name)}" for name in names] if len(names) <= MOST_COLUMNS else ["answer"]
    table = Table(box=SIMPLE, title_justify="left", show_edge=False, padding=(0, 1, 0, 0))
    table.title = f"If it were told otherwise, {span_name(said[0].horizon_steps)}"
    for column in ("steps", *columns, "listens"):
        table.add_column(column, no_wrap=column == "steps", justify="left" if column in columns else "right")
    rows = _rows(said, short)
    left_out = len(rows) - MOST_ANSWERS
    for number, row in enumerate(rows):
        if left_out <= 1 or number < FIRST_ANSWERS or number >= FIRST_ANSWERS + left_out:
            table.add_row(*row)
        elif number == FIRST_ANSWERS:
            table.add_row("...")
    return table


def _rows(said: Sequence[Explanation], short: Callable[[str], str]) -> list[tuple[str, ...]]:
    answers = without_flicker([("", *(short(one.said) for one in each.what_if.values())) for each in said])
    names = [short(name) for name in said[0].what_if]
    rows = []
    for (_, *cells), group in groupby(range(len(said)), key=answers.__getitem__):
        steps = list(group)
        span = str(steps[0]) if len(steps) == 1 else f"{steps[0]}-{steps[-1]}"
        shown = cells if len(names) <= MOST_COLUMNS else [together(names, cells)]
        rows.append((span, *shown, f"{_mean_listening([said[step] for step in steps]):.0%}"))
    return rows


def _mean_listening(said: Sequence[Explanation]) -> float:
    listens = [one.listens for one in said if one.listens is not None]
    return float(np.mean(listens)) if listens else float("nan")


def listening_line(said: Sequence[Explanation]) -> str:
    """How much the agent listens over an episode, and where it does not, in one sentence or two."""
    same = [whatever(one) for one in said]
    share = np.mean([one is not None for one in same])
    line = f"It listens {_mean_listening(said):.0%} (0 %: it does {THE_SAME}; 100 %: as it is told)"
    if not share:
        return f"{line}."
    runs = [(phrase, list(group)) for phrase, group in groupby(range(len(said)), key=same.__getitem__)]
    phrase, longest = max(((one, steps) for one, steps in runs if one is not None), key=lambda run: len(run[1]))
    spans = f"step {longest[0]}" if len(longest) == 1 else f"steps {longest[0]} to {longest[-1]}"
    return f"{line}. At {share:.0%} of the moments it does {THE_SAME}; at {spans}, whatever you say: {phrase}."
