"""From refreshes to what the view says of them in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import sayable
from ibe_rl.ibe.meaning_lines import meaning_lines
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.metrics.verdict import in_one_line, wrong_signs
from ibe_rl.task import Phrases, Task
from ibe_rl.task.words import Words
from ibe_rl.types import CANNOT_TELL, Array
from ibe_rl.view.wording import literal, short
from ibe_rl.vocabulary.lateness import lateness_lines
from ibe_rl.vocabulary.refresh import Refresh
from ibe_rl.vocabulary.words import MEANS_NOTHING


def counts(of: Mapping[str, int]) -> str:
    """Names and numbers in one line.

    >>> counts({"left": 1200, "right": 3})
    'left: 1,200, right: 3'
    """
    return ", ".join(f"{name}: {number:,}" for name, number in of.items())


def vocabulary_table(refresh: Refresh, words: Sequence[Phrases], spoken: int | None = None, links: bool = True) -> str:
    """The clusters as a markdown table with what each was called before; the one just spoken marked.

    With ``links`` the name of a cluster leads to where rerun's film says it.
    """
    rows = ["| cluster | says | expression | windows | before |", "|:--|:--|--:|--:|:--|"]
    mapping, before = refresh.standing, phrases_before(refresh, words)
    for row, (name, now) in enumerate(cluster_phrases(mapping, words).items()):
        number = "-" if now == CANNOT_TELL else expression_text(mapping.expressions[row], words)
        then = before.get(name, "new") if before else now
        cells = [literal(now), number, f"{mapping.sizes[row]:,.0f}", "" if then == now else literal(then)]
        if name == spoken:
            cells = [f"**{cell}**" if cell else cell for cell in cells]
        link = f"[#{name}](recording://said/{name})" if links else f"#{name}"
        rows.append("| " + " | ".join([f"→ {link}" if name == spoken else link, *cells]) + " |")
    return "\n".join(rows)


def expression_text(expression: Array, words: Sequence[Phrases]) -> str:
    """An expression in figures: its numbers, or the shares of its words, the largest first."""
    if not isinstance(words, Words):
        return " ".join(f"{value:+.2f}" for value in expression)
    ranked = [slot for slot in np.argsort(-expression, kind="stable") if expression[slot] >= LEAST_SHARE]
    return ", ".join(f"{words.name_at(int(slot))} {expression[slot]:.0%}" for slot in ranked)


LEAST_SHARE = 0.05
"""Smaller shares of a word are not shown."""


def cluster_phrases(mapping: ClusterMapping, words: Sequence[Phrases]) -> dict[int, str]:
    """What the clusters are called, in short, by their ids; no word whose meaning is not known."""
    known = sayable(mapping.expressions, mapping.meanings)
    said = [phrase(one, words) if can else CANNOT_TELL for one, can in zip(mapping.expressions, known, strict=True)]
    phrases = short(said, words)
    return dict(zip(mapping.ids.tolist(), phrases, strict=True))


def phrases_before(refresh: Refresh, words: Sequence[Phrases]) -> dict[int, str]:
    """What the clusters were called before a refresh that was taken; empty if nothing was before."""
    return cluster_phrases(refresh.change.last, words) if refresh.change is not None and refresh.taken else {}


def transitions(refresh: Refresh, words: Sequence[Phrases]) -> list[str]:
    """What became of the clusters, one line for each that emerged, vanished or is called something else now."""
    change, before = refresh.change, phrases_before(refresh, words)
    if change is None or not refresh.taken:
        return []
    now = cluster_phrases(refresh.mapping, words)
    lines = [f"#{name} emerged: {now[name]}" for name in change.transition.emerged]
    lines += [f"#{name} vanished: {before[name]}" for name in change.transition.vanished]
    renamed = [name for name in change.transition.survived if before[name] != now[name]]
    return lines + [f"#{name} was {before[name]}, is {now[name]}" for name in renamed]


def moved(refresh: Refresh) -> list[str]:
    """What moved since the refresh before; nothing at the first one."""
    change = refresh.change
    if change is None:
        return []
    acts = f"it acts otherwise in {change.policy_drift:.0%} of the probed states"
    words = f"{change.drift.phrase_changed:.0%} of the probed windows are called something else"
    told = not math.isnan(change.staleness)
    stale = f"staleness of the words before: {change.staleness:+.3f}" if told else "their staleness is unknown"
    return [acts, words, stale] if refresh.taken else [acts, f"{stale}, so they stay"]


def worth(refresh: Refresh, task: Task) -> list[str]:
    """Whether the words that stand tell the way, what they are known to mean, and what is declared wrongly."""
    verdicts, meanings = refresh.verdicts(task), refresh.standing.meanings
    noticed = [one.text for one in refresh.word_notices if one.kind != MEANS_NOTHING]  # which a line on meanings says
    found = [*meaning_lines(meanings, task), *noticed, *lateness_lines(refresh.delays)]
    return [in_one_line(verdicts), *found, *wrong_signs(verdicts, meanings, task)]


def standing(refresh: Refresh, task: Task, spoken: int | None, links: bool = True) -> str:
    """A vocabulary, what it is worth, what moved, and what it stands on, in markdown."""
    changes = literal("; ".join(moved(refresh)))
    since = f"Since {refresh.change.since_frame:,} frames {changes}.\n\n" if refresh.change else ""
    known = "  \n".join(map(literal, worth(refresh, task)))
    table = f"{vocabulary_table(refresh, task.phrases, spoken, links)}\n\n{known}\n\n{since}"
    if not refresh.taken:  # what follows is of the one that was not taken
        return table
    return (
        f"{table}Best {refresh.episodes_used:,} of the newest {refresh.episodes_counted:,} episodes: "
        f"{literal(counts(refresh.episodes_by_context))}  \n"
        f"{len(refresh.top):,} windows of {refresh.top.horizon_steps} steps: "
        f"{literal(counts(refresh.windows_by_context))}  \n"
        f"by instruction: {literal(counts(refresh.windows_by_instruction))}"
    )
