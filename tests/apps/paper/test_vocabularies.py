"""Vocabularies on a line, and what they call movements; all rates are worked out by hand."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from by_hand import TASK as LIFT
from by_hand import better_half, on_a_line, two_floors
from rides import TASK, ride

from ibe_rl.apps.paper.names import DEFAULT, PAPERS, SIGNS_KEPT, SPLIT_MINMAX
from ibe_rl.apps.paper.vocabularies import (
    _STRIDE_STEPS,
    LabelledMovements,
    best_of,
    call,
    called_zero,
    learn_variants,
    rates_by_movement,
    skew,
    small_rates,
    straight_below,
    variants,
    vocabulary_json,
)
from ibe_rl.ibe import ClusterMapping, TooLittleDataError, normalise
from ibe_rl.task import Phrases
from ibe_rl.types import Episode
from ibe_rl.vocabulary.fitting import fit_mapping

EVEN = on_a_line([-2, 0, 2])
"""Calls what is nearer to 0 than a metre straight."""
LEANING = on_a_line([-3, 0, 0.5])
"""Calls it straight from 1.5 m down to 0.25 m up."""
ONE_SIDED = on_a_line([-1, 1], [1, 1])
"""Calls everything up."""
VOCABULARY = on_a_line([0, 1, 2, 3, 4], [-1, -1, 0, 0.5, 0.5])
SMALL_ONES = (-2.0, -0.9, 0.9, 2.0)
OTHERS = (0.2, -4.0, 4.0, 7.0)


def moving(changes: Sequence[float]) -> list[Episode]:
    """Episodes too short for a second window that is looked at."""
    return [ride([0, 0, change]) for change in changes]


def heard(changes: Sequence[float], *vocabularies: ClusterMapping, name: str = DEFAULT) -> LabelledMovements:
    return call(moving(changes), [{name: each} for each in vocabularies], TASK, 2, 30, 0)


def test_vocabularies_are_learnt_from_the_best_episodes():
    rewards = ((10, "upper"), (9, "upper"), (2, "lower"), (3, "lower"))
    episodes = [ride([0, 1], 1, reward, context) for reward, context in rewards]
    assert best_of(episodes, better_half()) == episodes[:2]
    assert best_of(episodes, better_half(top_within="context")) == [episodes[0], episodes[3]]
    assert best_of(episodes, better_half(top_fraction=0.1)) == episodes[:1]


def test_two_vocabularies_and_two_between_them():
    paper, ours = better_half(), better_half(space="rule", normalisation="movement", membership="soft")
    made = variants(paper, ours)
    assert list(made) == [PAPERS, SIGNS_KEPT, SPLIT_MINMAX, DEFAULT]
    assert made[PAPERS] == paper
    assert made[DEFAULT] == ours
    assert made[SIGNS_KEPT] == replace(paper, normalisation="sign")
    assert made[SPLIT_MINMAX] == replace(ours, normalisation="minmax", membership="hard")


def test_each_is_learnt_as_a_refresh_would(tmp_path: Path):
    log = two_floors(tmp_path)
    episodes = log.read(range(8))
    made = variants(better_half(), better_half(space="rule", normalisation="movement", top_within="context"))
    learnt = learn_variants(episodes, made, LIFT, 4, seed=3)
    assert list(learnt) == list(made)
    for name, config in made.items():
        chosen = episodes[:4] if config.top_within == "all" else [*episodes[:2], *episodes[4:6]]
        alone = fit_mapping(chosen, episodes, config, LIFT, 3, horizon_steps=4)
        assert learnt[name].to_dict() == alone.to_dict()
    assert learnt[PAPERS].to_dict() != learnt[DEFAULT].to_dict()


def test_episodes_that_are_too_short_teach_nothing(tmp_path: Path):
    with pytest.raises(TooLittleDataError, match="no window of 50 steps"):
        learn_variants(two_floors(tmp_path).read(range(8)), {PAPERS: better_half()}, LIFT, 50, 0)


def test_skew_is_the_mean_expression():
    assert skew(EVEN) == 0
    assert skew(on_a_line([0, 1, 2], [-1, 0, 0.4])) == pytest.approx(-0.2)
    assert skew(ONE_SIDED) == 1


@pytest.mark.parametrize("means", [(-0.5, 0.0, 1.0), (-1.0, 0.0, 0.25), (-0.6, 0.0, 0.6)])
def test_minmax_calls_a_mean_of_0_what_the_ends_make_of_it(means: Sequence[float]):
    zero = called_zero(on_a_line([0, 1, 2], means))
    assert zero == pytest.approx(normalise(np.array(means)[:, None])[1, 0])
    assert zero == pytest.approx(-(means[0] + means[2]) / (means[2] - means[0]))


def test_minmax_makes_nothing_of_equal_means():
    assert called_zero(on_a_line([0, 1], [0.3, 0.3])) is None


def test_a_vocabulary_as_json():
    assert vocabulary_json(VOCABULARY) == {
        "expressions": [-1, -1, 0, 0.5, 0.5],
        "mean_instructions": [-1, -1, 0, 0.5, 0.5],
        "sizes": [1] * 5,
        "ids": [0, 1, 2, 3, 4],
        "skew": pytest.approx(-0.2),
        "below_zero": 1,
        "above_zero": 1,
        "minmax_of_zero": pytest.approx(1 / 3),
    }


def test_movements_are_called_what_the_nearest_cluster_is():
    of_one = heard(SMALL_ONES, EVEN)
    assert of_one.change.tolist() == [*SMALL_ONES]
    assert of_one.band == TASK.explained_band[0] == 0.5
    assert of_one.called[DEFAULT].straight.tolist() == [0, 1, 1, 0]
    assert of_one.called[DEFAULT].wrong.tolist() == [0, 0, 0, 0]
    assert heard(SMALL_ONES, ONE_SIDED).called[DEFAULT].wrong.tolist() == [1, 1, 0, 0]


@pytest.mark.parametrize(("said", "straight"), [(0.0, 1), (0.29, 1), (-0.29, 1), (0.3, 0), (-0.3, 0), (1.0, 0)])
def test_straight_is_what_the_words_call_so(said: float, straight: float):
    assert straight_below(TASK.phrases[0]) == 0.3
    assert straight_below(Phrases("", "", "", ((0.15, ""), (0.4, "")))) == 0.15
    called = heard([2.0], on_a_line([0, 1], [said, said])).called[DEFAULT]
    assert called.straight.tolist() == [straight]
    assert called.wrong.tolist() == [said <= -0.3]  # what is straight is not the wrong way, whatever its sign


def test_what_is_called_is_a_mean_over_the_clusterings():
    together = heard(SMALL_ONES, EVEN, LEANING, ONE_SIDED).called[DEFAULT]
    assert together.straight == pytest.approx(np.array([0, 2, 1, 0]) / 3)
    assert together.wrong == pytest.approx(np.array([1, 1, 0, 0]) / 3)


def test_each_kind_of_vocabulary_is_called_by_itself():
    several = [{DEFAULT: EVEN, PAPERS: ONE_SIDED}, {DEFAULT: LEANING, PAPERS: ONE_SIDED}]
    called = call(moving(SMALL_ONES), several, TASK, 2, 30, 0).called
    assert list(called) == [DEFAULT, PAPERS]
    assert called[DEFAULT].straight.tolist() == [0, 1, 0.5, 0]
    assert called[PAPERS].wrong.tolist() == [1, 1, 0, 0]


def test_windows_are_looked_at_every_few_steps_to_the_end_of_the_episode():
    heights = [0, 0, 0, 0, 1, 1, 1, 1, 3, 8]
    some = call([ride(heights)], [{DEFAULT: EVEN}], TASK, _STRIDE_STEPS, 5, 0)
    assert some.change.tolist() == [1, 2, 5]
    assert some.weights.shape == (6, 3)


def test_rates_of_small_movements_are_exact():
    """Those between the band and five of it, half a metre to two and a half: two to each side."""
    found = small_rates(heard([*SMALL_ONES, *OTHERS], EVEN, LEANING, ONE_SIDED))[DEFAULT]
    values = {kind: rate["value"] for kind, rate in found.items()}
    assert values == {
        "straight_left": pytest.approx((0 + 2) / 3 / 2),
        "straight_right": pytest.approx((1 + 0) / 3 / 2),
        "wrong_left": pytest.approx((1 + 1) / 3 / 2),
        "wrong_right": 0,
        "left_minus_right": pytest.approx(2 / 3 - 1 / 6),
    }
    assert all(rate["low"] <= rate["value"] <= rate["high"] for rate in found.values())


def test_a_rate_of_no_movement_is_unknown():
    found = small_rates(heard([0.9, 2.0, -4.0], EVEN))[DEFAULT]
    unknown = {"value": None, "low": None, "high": None}
    assert found["straight_left"] == found["wrong_left"] == found["left_minus_right"] == unknown
    assert found["straight_right"]["value"] == 0.5


def test_rates_go_from_far_left_to_far_right_without_empty_bins():
    several = heard([-5.5, -0.9, -0.6, 0.2, 0.5, 0.9, 2.0, 7.0], EVEN, LEANING)
    rows = [(row["from"], row["to"], row["windows"], row["value"]) for row in rates_by_movement(several, DEFAULT)]
    assert rows == [
        (-6, -5, 1, 0),
        (-1, -0.5, 2, 1),
        (-0.5, 0.5, 1, 1),
        (0.5, 1, 2, 0.5),
        (2, 2.5, 1, 0),
    ]


def test_rates_are_means_over_windows_with_an_interval():
    [row] = rates_by_movement(heard([0.6, 0.7, 0.8, 0.9], EVEN, ONE_SIDED, ONE_SIDED, ONE_SIDED), DEFAULT)
    assert (row["value"], row["low"], row["high"]) == (0.25, 0.25, 0.25)
    [row] = rates_by_movement(heard([1.6, 1.7, 1.8, 1.9], on_a_line([0, 3.5])), DEFAULT)
    assert (row["value"], row["windows"]) == (0, 4)
    mixed = on_a_line([1.6, 1.7, 1.8, 1.9], [0, 0, 0, 1])
    [row] = rates_by_movement(heard([1.6, 1.7, 1.8, 1.9], mixed), DEFAULT)
    assert row["low"] < row["value"] == 0.75 < row["high"]
