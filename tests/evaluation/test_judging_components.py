"""Everybody judged on two numbers at once: a lift that is told a way and a speed."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import WORDS
from lift import TASK as LIFT

from ibe_rl.evaluation import figures, tables
from ibe_rl.evaluation.baselines import StateRegressor
from ibe_rl.evaluation.changing import judge_ages
from ibe_rl.evaluation.judging import Learnt, judge, rows_of
from ibe_rl.evaluation.moments import Moments
from ibe_rl.evaluation.observers import observe_all
from ibe_rl.evaluation.report import write_moments
from ibe_rl.evaluation.rows import EACH, Judged
from ibe_rl.ibe import ClusterMapping, Windows
from ibe_rl.ibe.space import along
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.metrics.quality import mean_over_numbers, vocabulary_scores
from ibe_rl.types import Array

SPEED = replace(WORDS, zero="as fast", negative="{degree}slower", positive="{degree}faster")
TASK = replace(
    LIFT,
    phrases=(WORDS, SPEED),
    explained=(0, 1),
    explained_band=(0.5, 0.2),
    explained_range=(),
    motion=lambda states: states[..., 1::-1] / 10,
    goal_offset=lambda states: 5 - states[..., :2],
)
OURS = "ibe:lift"
EPISODES = 12
WAYS = np.array([[a, b] for a in (-1.0, 0, 1) for b in (-1.0, 0, 1)])


def words(second: float = 1.0) -> ClusterMapping:
    """A cluster for each combination; the second number is said ``second`` times as it is."""
    ones = np.ones(9)
    axes = along(np.array([[0.5, 0], [0, 1], [0, 0]]))
    return ClusterMapping(axes, WAYS, WAYS, WAYS * [1, second], ones, ones, ones, np.arange(9))


def flights(seed: int) -> Moments:
    """Each combination of going 2 m and gaining 1 m/s once an episode, foreseen exactly; told at random."""
    random = np.random.default_rng(seed)
    change = np.concatenate([np.tile(WAYS * [2, 1], (EPISODES, 1)), np.zeros((9 * EPISODES, 1))], axis=1)
    count = len(change)
    return Moments(
        episode=np.repeat(np.arange(EPISODES), 9),
        seed=np.repeat(np.arange(EPISODES), 9) + 100,
        step=np.arange(count),
        state=np.zeros((count, 3)),
        instruction=random.integers(-1, 2, (count, 2)).astype(float),
        given=np.ones(count, bool),
        regular=np.ones(count, bool),
        observed=np.ones(count, bool),
        realised=change[:, None],
        predicted=change[:, None, None],
        trusted=np.ones((count, 1, 1), bool),
        horizons_steps=(5,),
    )


class Upwards:
    """Foretells a metre upwards, whatever the state."""

    def predict(self, states: Array) -> Array:
        return np.ones(len(states))


@pytest.fixture(scope="module")
def judged() -> Judged:
    learnt = Learnt(
        {OURS: words(), "baseline:paper": words(second=-1.0)},
        {"baseline:shuffled": [words(), words(second=-1.0)]},
        [StateRegressor("ridge", Upwards(), {}), StateRegressor("boosting", Upwards(), {})],
    )
    here = flights(0)
    return judge(learnt, here, flights(1), 5, TASK, episode_weights(here.episode, 20, 0), seed=0)


def row(judged: Judged, name: str) -> dict[str, Any]:
    [found] = [row for row in rows_of(judged) if row["explainer"] == name]
    return found


def test_each_number_is_judged_by_itself_and_the_row_has_the_mean(judged: Judged):
    """The paper's vocabulary, as it is made up here, says the second number the wrong way round."""
    for name, aucs, mean in ((OURS, [1, 1], 1), ("baseline:paper", [1, 0], 0.5)):
        found = row(judged, name)
        assert [each["number"] for each in found["each"]] == ["height", "speed"]
        assert [each["motion_auc"]["value"] for each in found["each"]] == aucs
        assert [each["vocabulary_loss"]["value"] for each in found["each"]] == [1 - auc for auc in aucs]
        assert found["motion_auc"]["value"] == mean
        assert found["vocabulary_loss"]["value"] == 1 - mean
        for metric in set(EACH) - {"motion_auc_hard"}:
            values = [each[metric]["value"] for each in found["each"]]
            assert found[metric]["value"] == pytest.approx(np.mean(values), abs=1e-5)
        assert found["motion_auc_hard"]["value"] is None  # nothing that goes upwards is hard here
        assert [each["left_right"]["value"] for each in found["each"]] == [[1, 1], [1, 1]]
        assert found["left_right"] is None


def test_what_came_true_is_the_whole_phrase(judged: Judged):
    assert row(judged, OURS)["came_true"]["value"] == 1
    half_right = replace(words(), expressions=WAYS * [1, 0])
    here = replace(flights(0), predicted=flights(0).realised[:, None] * [1, -1, 1])
    learnt = Learnt({OURS: words(), "baseline:paper": half_right}, {}, [StateRegressor("ridge", Upwards(), {})] * 2)
    found = judge(learnt, here, here, 5, TASK, episode_weights(here.episode, 20, 0), seed=0)
    assert row(found, OURS)["came_true"]["value"] == pytest.approx(1 / 3, abs=1e-5)  # where the speed does not change
    assert row(found, "baseline:paper")["came_true"]["value"] == 1


def test_baselines_and_controls_say_both_numbers(judged: Judged):
    for name in ("last_instruction", "constant", "state_regressor", "present_velocity", "direction_to_goal"):
        assert len(row(judged, f"baseline:{name}")["each"]) == 2
    assert row(judged, "baseline:last_instruction")["instruction_f1"]["value"] == 1
    assert [each["motion_auc"]["value"] for each in row(judged, "baseline:flipped")["each"]] == [0, 0]
    shuffled = row(judged, "baseline:shuffled")
    assert [each["motion_auc"]["value"] for each in shuffled["each"]] == [1, 0.5]
    assert shuffled["refits"]["motion_auc"] == [1, 0.5]
    assert judged.truth.hard.mean(axis=0) == pytest.approx([2 / 3, 2 / 3])  # all that do not go upwards


def test_the_mean_leaves_out_a_number_whose_motion_is_unknown():
    nan = np.array([np.nan, 0.3])
    assert mean_over_numbers("motion_auc", [nan, np.array([0.5, 0.6])]).tolist() == [0.5, 0.6]
    assert np.isnan(mean_over_numbers("motion_auc", [nan])).tolist() == [True, False]
    assert np.isnan(mean_over_numbers("motion_spearman", [nan, np.array([0.5, 0.6])])).tolist() == [True, False]


def test_scores_without_a_predictor_are_means_too():
    here = flights(0)
    windows = Windows(here.realised[:, 0], here.instruction, here.given, here.episode, here.step, 5)
    assert vocabulary_scores(words(), windows, TASK)["motion_auc"] == 1
    assert vocabulary_scores(words(second=-1), windows, TASK)["motion_auc"] == 0.5


def test_ages_are_judged_on_the_means():
    ages = judge_ages(10, {5: words(second=-1), 10: words()}, flights(0), 5, TASK, 20, 0)
    assert [age["motion_auc"]["value"] for age in ages] == [0.5, 1]


def test_the_observer_reads_each_number_on_its_own_scale():
    """Typically two metres and 1 m/s, two of three times; an error is the mean of both, in % of the range 1."""
    here = flights(0)
    both = {OURS: [words()], "baseline:paper": [words(second=-1.0)]}
    _, report = observe_all(here, here.realised[:, 0, :2], 5, TASK, both, 20, 0)
    assert (report["episodes"], report["typical"]) == (9 * EPISODES, [2, 1])
    found = {row["explainer"]: row["observer_error"]["value"] for row in report["rows"]}
    assert found[OURS] == found["baseline:predicted_change"] == 0
    assert found["baseline:paper"] == pytest.approx(100 * (0 + 2 / 3 * 2) / 2, abs=1e-4)  # the speed the wrong way
    assert found["no_explanation"] == pytest.approx(100 * (2 / 3 * 2 + 2 / 3 * 1) / 2, abs=1e-4)  # it stands still


def test_moments_have_a_column_a_number(judged: Judged, tmp_path: Path):
    write_moments(tmp_path / "moments.csv", flights(0), judged, OURS, TASK)
    with (tmp_path / "moments.csv").open() as stream:
        first = next(csv.DictReader(stream))
    assert [name for name in first if name.startswith("m")] == ["m*_height", "m*_speed", "m_height", "m_speed"]
    assert (float(first["m_height"]), float(first["m_speed"]), first["phrase"]) == (-1, -1, "going down and slower")


def test_tables_and_figures_show_each_number(judged: Judged, capsys: pytest.CaptureFixture[str]):
    rows = rows_of(judged)
    tables.print_rows(rows, "both")
    tables.print_observers({"episodes": 0, "rows": []})
    said = capsys.readouterr().out
    assert "Each component of the instruction" in said
    assert "observer" not in said
    titles = [axis.get_title() for axis in figures.by_explainer(rows, 5).axes]
    assert titles == [
        "all moments\n(mean of 2 numbers)",
        "where it did not follow the instruction\n(mean of 2 numbers)",
        "height: all moments",
        "speed: all moments",
    ]
