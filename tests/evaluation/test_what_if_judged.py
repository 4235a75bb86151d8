"""Whether it really does what it says it would: lifts that obey, that do not, and a predictor that is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, on_a_line
from by_hand import WORDS as OF_THE_LIFT

from ibe_rl.evaluation import what_if
from ibe_rl.evaluation.moments import TakenMoment
from ibe_rl.evaluation.tables import console, what_if_table
from ibe_rl.evaluation.what_if import CANNOT_COPY, WhatIf, answer, ask_and_give, baseline_rows, judge_what_if, row_of
from ibe_rl.explain.what_if import values_of
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.types import Array, Moment, Policy, Prediction, columns_of, observe

VALUES = values_of(TASK)
LINE = on_a_line([-4, 0, 4])
EPISODES = 20


class Lifts:
    """Moves by the action in every step, and is shaken by chance once."""

    def __init__(self, shaken: float = 0.0, seed: int = 0) -> None:
        self._shaken, self._random = shaken, np.random.default_rng(seed)

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        states, instruction, given = columns_of(moments)
        path = [states]
        for _ in range(horizon_steps):
            path.append(path[-1] + policy(observe(path[-1], instruction, given))[:, None])
        chance = self._random.random(len(moments)) < self._shaken
        path[-1] = path[-1] + 4 * chance[:, None].astype(np.float32)
        return Prediction.exact(np.stack(path, axis=1).astype(np.float32))


def obeys(observations: Array) -> Array:
    return observations[:, -2]


def ignores(observations: Array) -> Array:
    return np.ones(len(observations))


def at_times(observations: Array) -> Array:
    """It obeys at even heights, and stays at odd ones."""
    return np.where(np.round(observations[:, 0] / 100) % 2 == 0, observations[:, -2], 0.0)


def taken(count: int = 3 * EPISODES, instruction: float = 1.0) -> list[TakenMoment]:
    return [
        TakenMoment(
            Moment(np.array([100.0 * row]), np.array([instruction]), True), row // 3, row // 3, row % 3, True, False,
            np.zeros((1, 1)),
        )
        for row in range(count)
    ]  # fmt: skip


def judged(
    policy: Policy, shaken: float = 0.0, foretold_by: Policy | None = None
) -> dict[str, dict[str, float | None]]:
    """The rows of all explainers, as numbers."""
    world = Lifts(shaken, seed=1)

    class Foreseen(Lifts):
        def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
            return super().rollout(moments, foretold_by or policy, horizon_steps)

    asked, held_out = (ask_and_give(taken(), policy, Foreseen(), world, VALUES, 3, 4) for _ in range(2))
    weights = episode_weights(asked.episode, 50, 0)
    answers = answer(asked, LINE, [OF_THE_LIFT])
    rows = [row_of("ibe:lift", answers, answer(held_out, LINE, [OF_THE_LIFT]).calibrate(), weights)]
    rows += baseline_rows(answers, VALUES, [OF_THE_LIFT], weights)
    return {
        row["explainer"]: {name: one["value"] for name, one in row.items() if isinstance(one, dict)} for row in rows
    }


def test_of_one_that_obeys_all_comes_true_and_it_listens():
    rows = judged(obeys)
    ours = rows["ibe:lift"]
    assert (ours["what_if_came_true"], ours["what_if_came_true_other"], ours["listens"], ours["whatever"]) == (
        1,
        1,
        1,
        0,
    )
    assert ours["what_if_ece"] == pytest.approx(0, abs=0.02)
    assert rows["baseline:obeys"]["what_if_came_true"] == 1
    assert rows["baseline:as_it_is"]["what_if_came_true"] == pytest.approx(1 / 3, abs=1e-5)
    assert rows["baseline:as_it_is"]["what_if_came_true_other"] == 0


def test_one_that_does_not_listen_does_the_same_whatever_it_is_told():
    ours = judged(ignores)["ibe:lift"]
    assert (ours["what_if_came_true"], ours["listens"], ours["whatever"]) == (1, 0, 1)
    assert ours["what_if_came_true_other"] is None  # it would never do anything else


def test_one_that_obeys_at_times_listens_at_times():
    ours = judged(at_times)["ibe:lift"]
    assert (ours["what_if_came_true"], ours["listens"], ours["whatever"]) == (1, 0.5, 0.5)


def test_what_is_foretold_wrongly_does_not_come_true():
    ours = judged(ignores, foretold_by=obeys)["ibe:lift"]
    assert ours["what_if_came_true"] == pytest.approx(1 / 3, abs=1e-5)  # it goes up anyway
    assert ours["what_if_came_true_other"] == 0
    assert ours["what_if_ece"] == pytest.approx(0, abs=0.02)  # and has learnt how often that is


def test_chance_in_the_world_is_not_foretold_and_the_confidence_knows_how_often():
    ours = judged(obeys, shaken=0.3)["ibe:lift"]
    assert 0.7 < ours["what_if_came_true"] < 0.9  # shaken while it goes up it goes up still
    assert ours["what_if_ece"] < 0.1


def test_the_report_fills_the_rows_of_its_explainers_at_its_horizon_only():
    estimate = {"value": 0.9, "low": 0.8, "high": 1.0}
    found = {"explainer": "ibe:lift", "what_if_came_true": estimate, "what_if_ece": None, "listens": estimate}
    rows = [
        {"explainer": name, "horizon_steps": steps, "listens": None}
        for name in ("ibe:lift", "baseline:paper")
        for steps in (4, 8)
    ]
    report = {"values": {"up": [1.0]}, "horizon_steps": 4, "moments": 10, "rows": [found]}
    WhatIf(report).add_to(rows, 4)
    assert [row["listens"] for row in rows] == [estimate, None, None, None]
    assert rows[0]["what_if_came_true"] == estimate
    WhatIf(note="none").add_to(rows, 4)
    assert (WhatIf().calibration_json, WhatIf().report) == ({}, None)
    shown = console()
    with shown.capture() as text:
        shown.print(what_if_table(report))
    assert ".900 (.800 1.00)" in text.get()


def test_what_cannot_be_copied_is_not_judged(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(what_if, "stoppable", lambda _: None)
    run: Any = SimpleNamespace(make_env=lambda: None)
    found = judge_what_if(run, SimpleNamespace(), Lifts(), {"ibe:lift": LINE}, lambda *_: [])  # type: ignore[arg-type]
    assert (found.report, found.note) == (None, CANNOT_COPY)
