"""A classifier of what was said with made-up mistakes in it."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from ibe_rl.ibe.mistakes import best_fit, fit_despite_mistakes, regression, regression_despite_mistakes
from ibe_rl.types import Array

CLASSES = 3


def said(share: float, seed: int = 0) -> tuple[Array, Array, Array]:
    """Places, which of three classes is meant there, and what is said, some of it at random."""
    random = np.random.default_rng(seed)
    places = random.uniform(-1, 1, (4_000, 1))
    meant = np.digitize(places[:, 0], [-0.2, 0.2])
    wrong = random.random(len(meant)) < share
    return places, meant, np.where(wrong, random.integers(0, CLASSES, len(meant)), meant)


def model() -> LogisticRegression:
    return LogisticRegression(C=1_000, solver="newton-cholesky", max_iter=100, warm_start=True)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4])
def test_what_is_meant_is_found(share: float):
    places, meant, heard = said(share)
    fitted = model()
    fit_despite_mistakes(fitted, places, heard, 20, 0.005)
    assert fitted.score(places, meant) > 0.99
    # who is sure of the rule, whatever else was heard: a plain regression has to be as unsure as what it hears
    assert fitted.predict_proba([[1.0]])[0, 2] > 0.99


def test_a_plain_regression_is_less_steep():
    places, _, heard = said(0.4)
    assert model().fit(places, heard).predict_proba([[1.0]])[0, 2] < 0.95


def test_it_is_done_when_the_weights_settle():
    fits: list[int] = []

    class Counted(LogisticRegression):
        def fit(self, *given, **named):  # type: ignore[no-untyped-def]
            fits.append(1)
            return super().fit(*given, **named)

    places, _, heard = said(0.2)
    fit_despite_mistakes(Counted(C=1_000), places, heard, 20, settled=1.0)
    assert len(fits) == 1
    fit_despite_mistakes(Counted(C=1_000), places, heard, 4)
    assert len(fits) == 5


def test_the_regression_that_is_right_more_often_is_taken():
    places, meant, _ = said(0.0)
    fit, model = best_fit(places, meant, 0)
    assert fit is regression
    assert model.score(places, meant) > 0.99
    heard = said(0.2)[2]
    assert best_fit(places, heard, 0)[0] is regression_despite_mistakes


def test_where_mistakes_explain_nothing_the_plain_one_is_taken():
    """Which of two things is said depends on whether two numbers have the same sign: no line tells that."""
    places = np.random.default_rng(0).normal(size=(4_000, 2))
    rule = (places.prod(axis=1) > 0).astype(int)
    plain, despite = (fit(places, rule, 0).score(places, rule) for fit in (regression, regression_despite_mistakes))
    assert despite < plain < 0.7
    assert best_fit(places, rule, 0)[0] is regression
