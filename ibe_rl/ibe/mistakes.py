"""Regressions of what is said on the state, by an instructor who may make mistakes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

MIN_MISTAKES, FIRST_GUESS = 0.01, 0.1
"""Least share of mistakes, and the share before anything is known."""
SHARE_ROUNDS = 3
"""Of weighing steps and counting mistakes between two fits."""
MISTAKE_ROUNDS, SETTLED_WEIGHT = 20, 0.005
"""Of fitting and weighing. At 30 % of mistakes it takes 16 to 19 until the weights hardly change."""
FEW_MISTAKES = 0.025
"""A regression that misses no more is taken as it is."""

Fit = Callable[[NDArray[Any], NDArray[Any], int], LogisticRegression]
"""From features ``(N, S)``, classes ``(N,)`` from 0 and a seed to a fitted regression."""


def best_fit(features: NDArray[Any], kinds: NDArray[Any], seed: int) -> tuple[Fit, LogisticRegression]:
    """The plain regression, or the one despite mistakes where that is right more often.

    Args:
        features: ``(N, S)``.
        kinds: ``(N,)`` classes from 0.
        seed: of the solver.

    Returns:
        How it is fitted, for fits on fewer features; and fitted on all of them.
    """
    plain = regression(features, kinds, seed)
    if (accuracy := plain.score(features, kinds)) < 1 - FEW_MISTAKES:
        despite = regression_despite_mistakes(features, kinds, seed)
        if despite.score(features, kinds) > accuracy:
            return regression_despite_mistakes, despite
    return regression, plain


def regression(features: NDArray[Any], kinds: NDArray[Any], seed: int) -> LogisticRegression:
    """Hardly regularised: shrinkage would spread the rule over correlated dimensions that it does not read."""
    return LogisticRegression(C=1_000, max_iter=1_000, random_state=seed).fit(features, kinds)


def regression_despite_mistakes(features: NDArray[Any], kinds: NDArray[Any], seed: int) -> LogisticRegression:
    """The same, of an instructor who makes mistakes."""
    model = LogisticRegression(C=1_000, max_iter=1_000, warm_start=True, random_state=seed)
    fit_despite_mistakes(model, features, kinds, MISTAKE_ROUNDS, SETTLED_WEIGHT)
    return model


def fit_despite_mistakes(
    model: LogisticRegression, features: NDArray[Any], kinds: NDArray[Any], rounds: int, settled: float = 0.0
) -> None:
    """Fit by expectation maximisation: each step counts as much as it is likely to be no mistake.

    A mistake says anything, whatever the features are. Without this share the regression would explain mistakes by
    further features and by less steep odds.

    Args:
        model: is fitted; with ``warm_start`` each round goes on from the one before.
        features: ``(N, S)``.
        kinds: ``(N,)`` classes from 0.
        rounds: of fitting and weighing, at most.
        settled: mean change of the weights at which it is done.
    """
    weight, share = np.ones(len(kinds)), FIRST_GUESS
    for _ in range(rounds):
        likely = model.fit(features, kinds, sample_weight=weight).predict_proba(features)
        likely = likely[np.arange(len(kinds)), kinds]
        wrong = np.bincount(kinds, 1.001 - weight)
        wrong, before = (wrong / wrong.sum())[kinds], weight
        for _ in range(SHARE_ROUNDS):
            weight = (1 - share) * likely / ((1 - share) * likely + share * wrong)
            share = max(MIN_MISTAKES, 1 - float(weight.mean()))
        if np.abs(weight - before).mean() < settled:
            break
