"""What an instruction depends on: the state, and there a position or a rate of change; or a plan in time."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

from ibe_rl.ibe.delta import LoggedSteps
from ibe_rl.types import Array

MAX_RATE_STEPS, MAX_PRODUCTS = 2_500, 400
MIN_R2 = 0.95
"""Of the regression of a quantity on one step of the state, for it to be a rate of change."""
MAX_CLASSIFIER_STEPS, MIN_ONSETS = 1_500, 10
MIN_GAIN = 0.2
"""Share of the errors of the majority class that a classifier on the state has to avoid."""
EXACT_ACCURACY = 0.95
"""From here on the state is taken to decide the instruction; no plan is predicted so well."""
TIME_MARGIN = 0.02
"""By how much time has to predict the instruction better than the state, to be a plan."""
MIN_ONSET_RATIO = 0.5
"""At changes of the instruction: how often the state has to predict the new sign, relative to the old one."""


def is_rate(log: LoggedSteps, axis: Array, seed: int) -> bool:
    """Whether a quantity, the state along ``axis`` ``(S,)``, is the rate of change of another one.

    One step of the state then predicts it: linearly, or with factors that are states themselves (a sine changes by the
    cosine times the angular velocity). Tested on steps that the regression has not seen.
    """
    rows = np.random.default_rng(seed).permutation(len(log))[:MAX_RATE_STEPS]
    before, after = log.states[rows], log.next_states[rows]
    between = (before + after) / 2
    quantity = between @ axis
    steps = _standardised(after - before)
    regressors = [steps]
    if steps.shape[1] ** 2 <= MAX_PRODUCTS:
        products = [steps * column[:, None] for column in _standardised(between).T]
        regressors.append(np.concatenate([steps, *products], axis=1))
    return any(_held_out_r2(columns, quantity) > MIN_R2 for columns in regressors)


def integral(log: LoggedSteps, axis: Array) -> Array:
    """The axis ``(S,)`` whose rate of change is the state along ``axis``, as far as a linear regression finds it."""
    steps = log.next_states - log.states
    scale = steps.std(axis=0)
    columns = np.divide(steps, scale, out=np.zeros_like(steps), where=scale > 0)
    quantity = (log.next_states + log.states) / 2 @ axis
    found = np.linalg.lstsq(columns, quantity - quantity.mean(), rcond=1e-6)[0]
    return np.divide(found, scale, out=np.zeros_like(found), where=scale > 0)


def depends_on_state(log: LoggedSteps, number: int, seed: int) -> bool:
    """Whether the state decides the instruction, not a plan in time that the agent may follow.

    An agent that follows a plan reaches states that predict the instruction, but not at the steps where the plan
    changes. A plan that is the same in every episode is predicted better by the step than by the state. An instruction
    that is too rare to occur in both halves of the steps counts as independent of the state.
    """
    signs = log.signs(number)
    rows = np.random.default_rng(seed).permutation(np.flatnonzero(log.given))[:MAX_CLASSIFIER_STEPS]
    fitted = _half(signs[rows], log.episode[rows])
    if fitted is None:
        return False
    majority = np.unique(signs[rows], return_counts=True)[1].max() / len(rows)
    classify = partial(_classifier, signs=signs, fit_on=rows[fitted], score_on=rows[~fitted])
    _, by_time = classify(log.step[:, None])
    model, by_state = classify(log.states)
    if by_time > by_state + TIME_MARGIN or by_state < majority + MIN_GAIN * (1 - majority):
        return False
    onsets = log.onsets(number)[:MAX_RATE_STEPS]
    if len(onsets) < MIN_ONSETS or by_state >= EXACT_ACCURACY:
        return True
    predicted = model.predict(log.states[onsets])
    return bool(np.mean(predicted == signs[onsets]) >= MIN_ONSET_RATIO * np.mean(predicted == signs[onsets - 1]))


def _half(signs: Array, episode: Array) -> Array | None:
    """Which steps ``(N,)`` bool to fit on: of odd episodes, or else odd steps.

    None if in either case one half has a single sign.
    """
    for odd in (episode % 2 == 1, np.arange(len(signs)) % 2 == 1):
        if min(len(np.unique(signs[half])) for half in (odd, ~odd)) > 1:
            return odd
    return None


def _classifier(columns: Array, signs: Array, fit_on: Array, score_on: Array) -> tuple[Any, float]:
    """The better of a linear model and a tree, and its accuracy on held-out steps."""
    models = (
        make_pipeline(StandardScaler(), LogisticRegression(C=1_000, max_iter=300)),
        DecisionTreeClassifier(max_depth=8, min_samples_leaf=5, random_state=0),
    )
    fitted = [model.fit(columns[fit_on], signs[fit_on]) for model in models]
    scored = [(model, float(model.score(columns[score_on], signs[score_on]))) for model in fitted]
    return max(scored, key=lambda pair: pair[1])


def _standardised(columns: Array) -> Array:
    scaled: Array = StandardScaler().fit_transform(columns)
    return scaled


def _held_out_r2(columns: Array, quantity: Array) -> float:
    """R squared of a linear regression that is fitted on every other row, on the rows between."""
    with_mean = np.column_stack([columns, np.ones(len(columns))])
    found = np.linalg.lstsq(with_mean[::2], quantity[::2], rcond=1e-6)[0]
    residuals, variance = quantity[1::2] - with_mean[1::2] @ found, np.var(quantity[1::2])
    return float(1 - np.mean(residuals**2) / variance) if variance > 0 else 0.0
