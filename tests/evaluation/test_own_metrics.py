"""Metrics of one's own score what each explainer said; one that fails is named and costs nothing else."""

import re
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lift import TASK, words
from test_judging import EPISODES, NAMES, OURS, Nothing, flights

from ibe_rl.config.settings import ExplainConfig, MetricConfig
from ibe_rl.evaluation import tables
from ibe_rl.evaluation.baselines import Learnt, StateRegressor
from ibe_rl.evaluation.judging import judge, rows_of
from ibe_rl.evaluation.own_metrics import OwnMetrics
from ibe_rl.evaluation.rows import Statements
from ibe_rl.evaluation.task_settings import refuse_unread
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.training.check import check_columns
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.listener import Metric

RESAMPLES = 20


class Right(Metric):
    """Share of the moments with the right direction; of vocabularies also how many phrases they have."""

    def score(self, statements: Statements) -> Mapping[str, Any]:
        truth = statements.truth
        found = {"my/right": weighted_mean((np.sign(statements.said) == np.sign(truth.change))[:, 0], truth.weights)}
        if statements.spoken is None:
            return found
        return found | {"my/phrases": np.full(len(truth.weights), len({*statements.spoken.phrase}))}


class Failing(Metric):
    """Returns or raises what it is told to, from one explainer on."""

    def __init__(self, score: Callable[[], Any], at: str):
        self._score, self._at, self.asked = score, at, 0

    def score(self, statements: Statements) -> Mapping[str, Any]:
        self.asked += 1
        return {"my/size": statements.truth.weights.sum(axis=1)} if statements.explainer != self._at else self._score()


def boom() -> Any:
    raise ValueError("a bug\nof theirs")


def rows(*metrics: Metric) -> dict[str, dict[str, Any]]:
    here = flights(0)
    learnt = Learnt(
        {OURS: words(), "baseline:paper": words((-4, 0, 2), (-1, 0, 1))},
        {"baseline:shuffled": [words(), words(expressions=(1, 0, -1))], "baseline:random_clusters": [words()]},
        [StateRegressor("ridge", Nothing(), {})],
    )
    weights = episode_weights(here.episode, RESAMPLES, 0)
    judged = judge(learnt, here, flights(1), 5, TASK, weights, seed=0, own=OwnMetrics(metrics).score)
    return {row["explainer"]: row for row in rows_of(judged)}


def test_every_explainer_has_its_score_with_an_interval() -> None:
    found = rows(Right())
    assert found.keys() == {OURS, *(f"baseline:{name}" for name in NAMES)}
    assert found[OURS]["my/right"] == {"value": 1.0, "low": 1.0, "high": 1.0}
    assert found["baseline:true_future"]["my/right"]["value"] == 1
    assert found["baseline:constant"]["my/right"]["value"] == 0.2  # right where nothing moves
    assert found["baseline:flipped"]["my/right"]["value"] == 0.2
    told = found["baseline:last_instruction"]["my/right"]
    assert told["low"] < told["value"] < told["high"]
    assert found["baseline:shuffled"]["refits"]["my/right"] == [1.0, 0.2]
    assert found[OURS]["my/phrases"]["value"] == 3
    assert found["baseline:constant"]["my/phrases"] is None  # it has no words
    assert found[OURS]["motion_auc"] == rows()[OURS]["motion_auc"]


def test_without_metrics_of_ones_own_a_row_is_as_ever() -> None:
    assert not {name for row in rows().values() for name in row if name.startswith("my/")}


def test_they_stand_in_a_table_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    tables.print_rows([*rows(Right()).values()], "All")
    told = capsys.readouterr().out
    assert "Metrics of your own" in told
    assert "my/phrases" in told
    tables.print_rows([*rows().values()], "All")
    assert "Metrics of your own" not in capsys.readouterr().out


def test_they_stand_in_the_table_over_the_horizons() -> None:
    table = tables.horizons_table([*rows(Right()).values()], [OURS])
    assert "my/right" in [*table.columns[0].cells]


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "raises": (boom, "ValueError: a bug of theirs"),
    "shape": (lambda: {"my/size": [1.0]}, r"ValueError: its score my/size has the shape \(1,\), not \(21,\)"),
    "taken": (lambda: {"motion_auc": 1.0}, "ValueError: its score motion_auc has the name of another column"),
    "nothing": (lambda: None, "AttributeError: "),
    "text": (lambda: {"my/size": "many"}, "ValueError: could not convert string"),
}


@pytest.mark.parametrize("how", WRONG)
def test_one_that_fails_is_named_and_the_others_go_on(how: str, capsys: pytest.CaptureFixture[str]) -> None:
    failing = Failing(WRONG[how][0], at=OURS)
    found = rows(failing, Right())
    [line] = capsys.readouterr().out.splitlines()
    expected = rf"warning: the metric Failing failed at {OURS} \({WRONG[how][1]}.*\): it is not asked any more"
    assert re.fullmatch(expected, line)
    assert found[OURS]["my/size"] is None
    assert found["baseline:constant"]["my/size"]["value"] == 5 * EPISODES  # asked before
    assert found["baseline:flipped"]["my/size"] is None
    assert found["baseline:shuffled"]["my/right"]["value"] == 0.6


def test_a_spread_over_refits_is_of_all_of_them(capsys: pytest.CaptureFixture[str]) -> None:
    class Second(Failing):
        def score(self, statements: Statements) -> Mapping[str, Any]:
            if statements.explainer == "baseline:shuffled" and self.asked > len(NAMES) - 1:
                self._at = statements.explainer
            return super().score(statements)

    found = rows(Second(boom, at=""))
    assert "failed at baseline:shuffled" in capsys.readouterr().out
    assert found["baseline:shuffled"]["my/size"] is None
    assert found["baseline:flipped"]["my/size"] is not None


def test_a_metric_overrides_what_it_needs() -> None:
    nothing = Metric()
    event, statements = SimpleNamespace(), SimpleNamespace()
    assert (nothing.columns, nothing(event), nothing.score(statements)) == ((), {}, {})


def test_they_are_refused_for_a_task_that_does_not_ask_them() -> None:
    asked = {"mine": MetricConfig(kind="x:Y")}
    for task in ("evaluate", "compare"):
        refuse_unread(ExplainConfig(task=task, metrics=asked))
    refuse_unread(ExplainConfig(task="episode"))
    with pytest.raises(ConfigError, match=r"^metric=\[mine\] with task=episode: allowed with task=evaluate or task="):
        refuse_unread(ExplainConfig(task="episode", metrics=asked))


@pytest.mark.parametrize("column", ["frames", "ibe/windows", "train/new", "time/x", "a/b"])
def test_a_column_that_is_taken_is_refused(column: str) -> None:
    metric, other = Metric(), Metric()
    other.columns, metric.columns = ("a/b",), ("c/d", column)
    with pytest.raises(ConfigError, match=rf"^metrics\.mine: its column {column} is taken; allowed is another one"):
        check_columns([("other", other), ("mine", metric)])
    check_columns([("other", other)])
