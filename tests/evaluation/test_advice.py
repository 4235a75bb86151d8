"""A verdict in plain words, and what it says to do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lift import TASK, words

from ibe_rl.config.settings import TrainConfig
from ibe_rl.evaluation.advice import ASK_FOR_IT, ECHO, advice, lines_of, text_of, verdict_of, verdicts_from
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe import Meaning
from ibe_rl.storage.run_folder import write_json

OURS = "ibe:axis"
NONE = {"value": None, "low": None, "high": None}
COMPARE = "another mapping: task=compare learns every kind from the same log and judges it"


@pytest.fixture
def run(tmp_path: Path) -> TrainedRun:
    (tmp_path / "evaluation").mkdir()
    return TrainedRun(tmp_path, TrainConfig(), TASK, lambda seen: seen, 9, words(), 9, 5, {}, None)


def estimate(value: float, spread: float = 0.01) -> dict[str, Any]:
    return {"value": value, "low": value - spread, "high": value + spread}


def rows(auc: Any, echo: float = 0.61, others: dict[int, float] | None = None) -> list[dict[str, Any]]:
    found = {5: auc if isinstance(auc, dict) else estimate(auc)} | {
        n: estimate(each) for n, each in (others or {}).items()
    }
    mine = [{"explainer": OURS, "horizon_steps": n, "motion_auc": each} for n, each in found.items()]
    return [*mine, {"explainer": ECHO, "horizon_steps": 5, "motion_auc": estimate(echo)}]


def meaning(run: TrainedRun, **known: Any) -> TrainedRun:
    return replace(run, mapping=replace(run.mapping, meanings=(Meaning(**known),)))


def test_good_words_need_nothing(run: TrainedRun) -> None:
    found = verdict_of(rows(0.97), OURS, run)
    assert found == {
        "level": "good",
        "text": "GOOD: AUC of its words for the direction of motion: .97 [.96, .98], good "
        "(chance .50, repeating the last instruction .61).",
        "motion_auc": {"value": 0.97, "low": pytest.approx(0.96), "high": pytest.approx(0.98)},
        "chance": 0.5,
        "echo": 0.61,
        "advice": [],
    }


def test_reversed_words_are_named_and_the_sign_is_looked_at_first(run: TrainedRun) -> None:
    found = verdict_of(rows(0.04), OURS, meaning(run))
    assert found["level"] == "reversed"
    assert found["text"].startswith(
        "REVERSED: “going up” is said when height falls; AUC of its words for the direction of motion: .04"
    )
    first, second, *rest = found["advice"]
    assert first.startswith("env.task.explained=[height] says that height rises with +1, but")
    assert "must rise where the rule says +1" in second
    assert rest == [COMPARE, ASK_FOR_IT]
    assert verdict_of(rows(0.04), OURS, run)["advice"] == [second, *rest]  # nobody has asked what the words mean


def test_weak_words_come_with_advice_where_better_ones_are(run: TrainedRun) -> None:
    assert verdict_of(rows(0.75), OURS, run)["advice"] == [COMPARE, ASK_FOR_IT]
    judged = [("ibe:as_refreshed", 0.99), ("ibe:bisecting", 0.93), ("ibe:none", None), ("baseline:paper", 0.8)]
    table = [{"explainer": name, "motion_auc": NONE | {"value": value}} for name, value in judged]
    write_json(run.folder / "evaluation/compare.json", {"rows": table})
    (run.folder / "evaluation/compare_more.json").write_text("{")  # damaged: left out
    found = verdict_of(rows(0.75, others={2: 0.9, 3: 0.85, 10: 0.765}), OURS, run)
    assert found["level"] == "weak"
    assert found["advice"] == [
        "another mapping: task=compare found .93 with mapping=bisecting",
        "another horizon: mapping.horizon_steps=2 has .90",
        ASK_FOR_IT,
    ]
    assert "the best, bisecting, has .93" in verdict_of(rows(0.95, echo=0.95), OURS, run)["advice"][0]
    assert len(verdict_of(rows(0.75, others={10: 0.765}), OURS, run)["advice"]) == 2  # not clearly better


def test_no_better_than_chance(run: TrainedRun) -> None:
    found = verdict_of(rows(estimate(0.62, 0.2)), OURS, run)
    assert (found["level"], "no better than chance" in found["text"]) == ("unknown", True)
    assert found["advice"] == [COMPARE, ASK_FOR_IT]


def test_an_unknown_meaning_is_reported_with_its_reason(run: TrainedRun) -> None:
    found = verdict_of(rows(0.97), OURS, meaning(run, negative=False, positive=False, reason="nobody did it"))
    assert (found["level"], found["text"]) == (
        "unknown",
        "UNKNOWN: I cannot tell what “going up” means: nobody did it.",
    )
    assert found["advice"] == [ASK_FOR_IT]


def test_what_cannot_be_computed(run: TrainedRun) -> None:
    found = verdict_of([{"explainer": OURS, "horizon_steps": 5, "motion_auc": NONE}], OURS, run)
    assert (found["level"], found["motion_auc"], found["echo"]) == ("unknown", NONE, None)
    assert "height did not move both ways" in found["text"]
    assert "explained_band" in found["advice"][0]


def test_a_reversed_number_is_not_hidden_by_a_mean(run: TrainedRun) -> None:
    two = replace(
        TASK, phrases=TASK.phrases * 2, explained=(0, 1), explained_band=(0.5, 0.5), explained_range=(), motion=None
    )
    both = replace(run, task=two)
    each = {
        name: [{"motion_auc": estimate(0.99)}, {"motion_auc": estimate(auc)}]
        for name, auc in ((OURS, 0.2), (ECHO, 0.6))
    }
    table = [{"explainer": n, "horizon_steps": 5, "motion_auc": estimate(0.6), "each": of} for n, of in each.items()]
    found = verdict_of(table, OURS, both)
    assert (found["level"], found["number"], found["motion_auc"]["value"]) == ("reversed", "speed", 0.2)
    assert found["text"].startswith("REVERSED: “going up” is said when speed falls; ")
    assert [one.level for one in verdicts_from(table, OURS, both)] == ["weak", "reversed"]  # .99 echoed is no better


def test_what_is_printed(run: TrainedRun) -> None:
    verdicts = verdicts_from(rows(0.75), OURS, run)
    assert lines_of(text_of(verdicts, run), advice(verdicts, run)) == [
        text_of(verdicts, run),
        f"  what to do: {COMPARE}",
        f"  or {ASK_FOR_IT}",
    ]
