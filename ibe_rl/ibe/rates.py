"""What kind of quantity an instructor goes by: a place, a rate of change, or none, as of a plan."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from ibe_rl.ibe.record import Record
from ibe_rl.types import Array

MOST_STEPS, MOST_PRODUCTS = 2_500, 400
A_RATE = 0.95
"""Share of the variance of a quantity that one step of the state must tell for it to be a rate of change."""
FEWEST_ONSETS = 10
MOST_TOLD = 1_500
DEPENDS, EXACTLY, BETTER, AT_ONSETS = 0.2, 0.95, 0.02, 0.5
"""What part of what is not said most often the state must tell, and from which share on no plan is told so well; by how
much the step must tell more; how often, against what was said before, the state must tell what is said at a change."""


def is_rate(record: Record, axis: Array, seed: int) -> bool:
    """Whether a quantity is the rate of change of another one: a speed, not a place.

    One step of the state then tells it: linearly, or with factors that are states themselves (a sine changes by its
    cosine times the turning). Checked on steps that the fit has not seen.

    Args:
        record: of the log.
        axis: ``(S,)`` of the quantity.
        seed: of the sample.
    """
    rows = np.random.default_rng(seed).permutation(len(record))[:MOST_STEPS]
    before, after = record.states[rows], record.after[rows]
    between = (before + after) / 2
    quantity = between @ axis
    steps = _scaled(after - before)
    fits = [steps]
    if steps.shape[1] ** 2 <= MOST_PRODUCTS:
        fits.append(np.concatenate([steps, *(steps * column[:, None] for column in _scaled(between).T)], axis=1))
    return any(_told_by(columns, quantity) > A_RATE for columns in fits)


def integral(record: Record, axis: Array) -> Array:
    """The direction ``(S,)`` of the state that changes by a rate, as far as there is one: steps it is regressed on."""
    steps = record.after - record.states
    scale = steps.std(axis=0)
    columns = np.divide(steps, scale, out=np.zeros_like(steps), where=scale > 0)
    quantity = (record.after + record.states) / 2 @ axis
    found = np.linalg.lstsq(columns, quantity - quantity.mean(), rcond=1e-6)[0]
    return np.divide(found, scale, out=np.zeros_like(found), where=scale > 0)


def depends_on_state(record: Record, number: int, seed: int) -> bool:
    """Whether what is said is decided by the state, and not by a plan in time that the agent may follow.

    Who follows a plan ends up in states that tell what was said, but not at the steps at which the plan changes. A
    plan that is the same in every episode is told better by the step than by the state. What is said too rarely to be
    told from one half of the steps in the other one does not depend on anything.
    """
    signs = record.signs(number)
    rows = np.random.default_rng(seed).permutation(np.flatnonzero(record.given))[:MOST_TOLD]
    fitted = _half(signs[rows], record.episode[rows])
    if fitted is None:
        return False
    most = np.unique(signs[rows], return_counts=True)[1].max() / len(rows)
    places = record.step[:, None], record.states
    halves = rows[fitted], rows[~fitted]
    (_, told_by_step), (model, told_by_state) = (_teller(columns, signs, *halves) for columns in places)
    if told_by_step > told_by_state + BETTER or told_by_state < most + DEPENDS * (1 - most):
        return False
    onsets = record.onsets(number)[:MOST_STEPS]
    if len(onsets) < FEWEST_ONSETS or told_by_state >= EXACTLY:
        return True
    told = model.predict(record.states[onsets])
    return bool(np.mean(told == signs[onsets]) >= AT_ONSETS * np.mean(told == signs[onsets - 1]))


def _half(signs: Array, episode: Array) -> Array | None:
    """Which steps ``(N,)`` bool to fit on: those of every other episode, or else every other one.

    None if in either case one half is told the same throughout.
    """
    for odd in (episode % 2 == 1, np.arange(len(signs)) % 2 == 1):
        if min(len(np.unique(signs[half])) for half in (odd, ~odd)) > 1:
            return odd
    return None


def _teller(columns: Array, signs: Array, fit_on: Array, score_on: Array) -> tuple[Any, float]:
    """What tells better what was said, a linear model or a tree, and the share that it tells of unseen steps."""
    models = (
        make_pipeline(StandardScaler(), LogisticRegression(C=1_000, max_iter=300)),
        DecisionTreeClassifier(max_depth=8, min_samples_leaf=5, random_state=0),
    )
    fitted = [model.fit(columns[fit_on], signs[fit_on]) for model in models]
    scored = [(model, float(model.score(columns[score_on], signs[score_on]))) for model in fitted]
    return max(scored, key=lambda pair: pair[1])


def _scaled(columns: Array) -> Array:
    scaled: Array = StandardScaler().fit_transform(columns)
    return scaled


def _told_by(columns: Array, quantity: Array) -> float:
    """Share of the variance that a linear fit on every other row tells of the rows between."""
    with_mean = np.column_stack([columns, np.ones(len(columns))])
    found = np.linalg.lstsq(with_mean[::2], quantity[::2], rcond=1e-6)[0]
    rest, variance = quantity[1::2] - with_mean[1::2] @ found, np.var(quantity[1::2])
    return float(1 - np.mean(rest**2) / variance) if variance > 0 else 0.0
