"""Speech that holds still: votes are gathered over a few steps, and the phrase changes only with a lead."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ibe_rl.explain.phrasing import ExplainerState, hold, reworded
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.types import Array, Explanation

MEMORY_STEPS, LEAD = 2, 0.2
"""Votes of so many earlier steps count too; a new phrase needs so much more of the votes than the last one.

Chosen on 72 greedy episodes of three default agents (docs/LOG.md): 1.2 to 1.6 changes in 100 steps instead of 4 to 5,
hardly any of them undone, none later than before, and a little more of it comes true.
"""
DOUBT_STEPS = 4
"""The confidence of so many earlier steps counts too: a moment of doubt is not worth a word."""


class SteadySpeaker:
    """Says the explanations of one episode, in the order of its steps.

    Each future of a moment votes for the phrase of its change, over the windows that begin at ``AHEAD_STEPS``, less
    where the predictor distrusts it. The phrase with most of the votes of the last steps is said, a new one only if
    this moment votes for it. ``agreement`` is its share of them. The expression is that of a future with this phrase,
    or else the last one with it; ``movement`` stays that of the moment.

    Args:
        explainer: that made the explanations.
    """

    def __init__(self, explainer: ExplainerState):
        self._explainer = explainer
        self._voices: dict[int, _Voice] = {}

    def say(self, one: Explanation, step: int) -> Explanation:
        """The explanation as it is spoken at a step, and those of its other spans."""
        spans = tuple(self._voice(span).say(span, step) for span in one.spans)
        return replace(self._voice(one).say(one, step), spans=spans)

    def _voice(self, one: Explanation) -> _Voice:
        steps, ours = one.horizon_steps, self._explainer
        if steps not in self._voices:
            state = ours if steps == ours.horizon_steps else ExplainerState(ours.spans[steps], steps, ours.words)
            self._voices[steps] = _Voice(state)
        return self._voices[steps]


class _Voice:
    """What is said of one span of time."""

    def __init__(self, explainer: ExplainerState):
        self._explainer = explainer
        self._heard: deque[tuple[int, Mapping[str, float]]] = deque()
        self._sure: deque[tuple[int, float]] = deque()
        self._last: Explanation | None = None

    def say(self, one: Explanation, step: int) -> Explanation:
        votes = self._votes(one, step)
        before = self._last.phrase if self._last is not None else None
        possible = [each for each in votes if each == before or each in self._heard[-1][1]]
        phrase = max(possible, key=lambda each: (votes[each], each == one.phrase))
        if before in votes and votes[phrase] <= votes[before] + LEAD:
            phrase = before
        self._last = self._known(self._with(one, phrase, votes[phrase]), step)
        return self._last

    def _known(self, said: Explanation, step: int) -> Explanation:
        """Whether it is sure enough, on the average of the last steps."""
        self._sure.append((step, said.confidence))
        _forget(self._sure, step - DOUBT_STEPS)
        mean = np.mean([confidence for _, confidence in self._sure])
        return replace(said, known=said.meant and bool(mean >= self._explainer.min_confidence))

    def _votes(self, one: Explanation, step: int) -> dict[str, float]:
        """Mean votes of this and the last steps, by phrase."""
        self._heard.append((step, self._votes_of(one)))
        _forget(self._heard, step - MEMORY_STEPS)
        phrases = dict.fromkeys(phrase for _, votes in self._heard for phrase in votes)
        return {each: float(np.mean([votes.get(each, 0.0) for _, votes in self._heard])) for each in phrases}

    def _votes_of(self, one: Explanation) -> dict[str, float]:
        deltas = np.concatenate([one.futures, one.later_futures]) if len(one.later_futures) else one.futures
        called = self._called(deltas)
        return {phrase: count * one.trusted_share / len(called) for phrase, count in Counter(called.tolist()).items()}

    def _called(self, deltas: Array) -> Array:
        return phrases_of(self._explainer.mapping.express(deltas), self._explainer.words)

    def _with(self, one: Explanation, phrase: str, agreement: float) -> Explanation:
        mapping, calibration = self._explainer.mapping, self._explainer.calibration
        said = one if phrase == one.phrase else replace(one, **self._changed(one, phrase), of_the_moment=one.phrase)
        meant = bool(mapping.knows(said.delta_state[None])[0])
        features = np.array([[agreement, said.purity]])
        probability = features.prod() if calibration is None else calibration.probability(features)[0]
        confidence = float(probability) if meant else 0.0
        return replace(said, phrase=phrase, agreement=agreement, confidence=confidence, meant=meant)

    def _changed(self, one: Explanation, phrase: str) -> dict[str, Any]:
        """The fields of a future of this moment that has the phrase, or of the last explanation that had it."""
        mapping, having = self._explainer.mapping, np.flatnonzero(self._called(one.futures) == phrase)
        if len(having):
            delta = one.futures[having[0]]
        elif self._last is not None and self._last.phrase == phrase:
            delta = self._last.delta_state
        else:  # of a window that begins later
            later = one.later_futures
            delta = later[np.flatnonzero(self._called(later) == phrase)[0]]
        found = delta[None]
        return {
            "delta_state": delta,
            "expression": mapping.express(found)[0],
            "cluster": int(mapping.ids[mapping.cluster(found)[0]]),
            "purity": float(mapping.confidence(found)[0]),
        }


def _forget(heard: deque[tuple[int, Any]], before_step: int) -> None:
    while heard[0][0] < before_step:
        heard.popleft()


def say_steadily(said: Sequence[Explanation], explainer: ExplainerState, every_steps: int = 1) -> list[Explanation]:
    """The explanations of one episode as they are spoken.

    Args:
        said: of moments that are ``every_steps`` apart.
        explainer: that made them.
        every_steps: see ``said``.
    """
    speaker = SteadySpeaker(explainer)
    return [speaker.say(one, number * every_steps) for number, one in enumerate(said)]


def said_in(explainer: ExplainerState, said: Sequence[Explanation], every_steps: int) -> list[Explanation]:
    """What would have been said of the same predictions in another vocabulary.

    Args:
        explainer: the other vocabulary.
        said: ``T`` explanations of an episode, each held for ``every_steps``.
        every_steps: see ``said``.
    """
    spoken = say_steadily(reworded(said[::every_steps], explainer), explainer, every_steps)
    return hold(spoken, every_steps, len(said))
