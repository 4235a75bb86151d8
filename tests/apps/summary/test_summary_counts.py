"""Shares by context and phase, and where it does not do as told, on episodes made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ibe_rl.apps.summary.disobeying import longest_moments, where_not_as_told
from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.printing import lines_not_as_told
from ibe_rl.apps.summary.shares import phrase_shares, shares_by_context_and_phase
from ibe_rl.apps.summary.side_by_side import beside
from ibe_rl.apps.summary.steps import StepTable, step_table
from ibe_rl.apps.summary.telling import MOST_TYPICAL, telling_episodes
from tests.apps.summary.hand_played import played

ONE = played("uuuddd", "uuuddd", "uuuuud", seed=1)
TWO = played("ssss--", "?ussss", "ssssss", seed=2, context="upper", success=False, contact=4)


def counted(*episodes: PlayedEpisode) -> StepTable:
    return step_table(episodes, resamples=50, seed=0)


def test_every_step_has_its_row() -> None:
    steps = counted(ONE, TWO)
    assert len(steps) == 12
    np.testing.assert_array_equal(steps.episode, [0] * 6 + [1] * 6)
    np.testing.assert_array_equal(steps.third, [0, 0, 1, 1, 2, 2] * 2)
    np.testing.assert_array_equal(steps.touched, [False] * 10 + [True] * 2)
    np.testing.assert_array_equal(steps.true[6:], [np.nan, 0, 1, 1, 1, 1])
    assert steps.weights.shape == (51, 2)


def test_shares_of_phrases_are_counted_by_context_and_phase() -> None:
    rows = {
        (row["context"], row["phase"]): row
        for row in shares_by_context_and_phase(counted(ONE, TWO), ("lower", "upper"))
    }
    assert {context for context, _ in rows} == {"all", "lower", "upper"}
    whole = rows["all", "whole episode"]
    assert (whole["episodes"], whole["steps"]) == (2, 12)
    assert whole["said"] == {"going up": 0.33333, "staying": 0.33333, "going down": 0.25, "I do not know": 0.08333}
    assert whole["came_true"]["value"] == pytest.approx(8 / 11, abs=1e-5)
    assert whole["came_true"]["low"] <= whole["came_true"]["value"] <= whole["came_true"]["high"]
    assert rows["lower", "last third"]["said"] == {"going down": 1.0}
    assert rows["lower", "last third"]["came"] == {"going down": 0.5, "going up": 0.5}
    assert rows["lower", "whole episode"]["came_true"]["low"] is None  # a single episode has no interval
    assert rows["upper", "from first contact on"]["steps"] == 2
    assert ("lower", "from first contact on") not in rows


def test_without_contexts_and_contact_there_are_fewer_rows() -> None:
    rows = shares_by_context_and_phase(counted(ONE, ONE), ())
    assert [row["phase"] for row in rows] == ["whole episode", "first third", "middle third", "last third"]
    assert {row["context"] for row in rows} == {"all"}


def test_an_episode_of_one_step_is_counted_too() -> None:
    [whole, first] = shares_by_context_and_phase(counted(played("u", "u", "u")), ("lower",))
    assert (whole["steps"], first["phase"]) == (1, "first third")


def test_equally_frequent_phrases_keep_the_order_of_their_texts() -> None:
    assert [*phrase_shares(np.array(["b", "a", "c", "c"], object))] == ["c", "a", "b"]


def test_where_it_does_not_do_as_told() -> None:
    found = where_not_as_told(counted(ONE, TWO), [ONE, TWO])
    assert found["steps"] == 10  # two were silent
    assert found["went"]["value"] == 0.2
    assert found["said"]["value"] == pytest.approx(1 / 9, abs=1e-5)
    assert found["said_so"]["value"] == 0.0  # it went up where it said down
    by = {(row["by"], row["name"]): row["went"]["value"] for row in found["by"]}
    assert by["instruction", "going down"] == pytest.approx(2 / 3, abs=1e-5)
    assert by["instruction", "staying"] == by["instruction", "going up"] == by["context", "upper"] == 0
    assert by["phase", "middle third"] == 0.25
    assert ("instruction", "(silent)") not in by
    [moment] = found["moments"]
    where = {"seed": 1, "context": "lower", "first_step": 3, "last_step": 4, "steps": 2}
    assert moment == where | {"told": "going down", "said": "going down", "came": "going up"}
    assert "Most after “going down” (67%). Longest: seed 1, steps 3 to 4" in lines_not_as_told(found)[1]


def test_the_longest_stretch_of_each_episode_counts_and_ends_where_it_is_told_something_else() -> None:
    long, short = played("uuddd", "sssss", "sssss", seed=3), played("ususu", "sssss", "sssss", seed=4)
    found = longest_moments([short, long])
    assert [(one["seed"], one["first_step"], one["steps"]) for one in found] == [(3, 2, 3), (4, 0, 1)]


def test_what_can_be_said_where_nothing_is_told_or_all_is_done() -> None:
    silent, tame = played("---", "uuu", "uuu"), played("uuu", "uuu", "uuu")
    told_nothing = where_not_as_told(counted(silent), [silent])
    assert lines_not_as_told(told_nothing)[0].startswith("Nobody told it anything")
    assert told_nothing["by"] == told_nothing["moments"] == []
    assert lines_not_as_told(where_not_as_told(counted(tame), [tame])) == ["It always does as told."]


def test_the_telling_episodes_are_the_typical_one_and_those_that_differ() -> None:
    usual = [played("uuuu", "uuuu", "uuuu", seed=seed) for seed in range(4)]
    odd = [played("uuuu", "dddd", "uuuu", seed=8), played("uuuu", "uuuu", "uuuu", seed=9, success=False)]
    found = telling_episodes([*odd, *usual], judges_success=True, count=5)
    assert [one["seed"] for one in found] == [0, 8, 9]  # the others are alike
    assert found[0]["special"] == MOST_TYPICAL
    assert found[1]["special"].startswith("says “going down” at 100% of its steps, the mean is 17%")
    assert found[2]["special"].startswith("does not succeed, 83% of all do")
    assert [one["number"] for one in found] == [2, 0, 1]


def test_length_return_and_disobedience_are_told_too() -> None:
    usual = [played("uuuu", "uuuu", "uuuu", seed=seed) for seed in range(4)]
    for odd, said in (
        (played("u" * 40, "u" * 40, "u" * 40, reward=0.1), "40 steps, the mean is 11"),
        (played("uuuu", "uuuu", "uuuu", reward=10.0), "return 40.0, the mean is 11.2"),
        (played("dddd", "uuuu", "uuuu"), "does not do as told at 100% of its steps, the mean is 20%"),
    ):
        found = telling_episodes([*usual, odd], judges_success=False, count=5)
        assert [one["number"] for one in found] == [0, 4]
        assert found[1]["special"] == said
        assert found[1]["success"] is None


def test_two_agents_are_aligned_by_the_texts_of_their_phrases() -> None:
    ours, theirs = [ONE, ONE], [played("uuuddd", "uuusss", "uuuddd", success=False)] * 2
    found = beside((ours, counted(*ours)), (theirs, counted(*theirs)), judges_success=True)
    measures = {row["name"]: row for row in found["measures"]}
    assert [*measures] == ["success", "return", "length_steps", "came_true", "not_as_told", "said_not_as_told"]
    assert measures["success"]["difference"] == {"value": 1.0, "low": 1.0, "high": 1.0}
    assert measures["came_true"]["this"]["value"] == pytest.approx(4 / 6, abs=1e-5)
    assert measures["came_true"]["other"]["value"] == 0.5
    phrases = {row["name"]: (row["this"]["value"], row["other"]["value"]) for row in found["phrases"]}
    assert phrases == {"going up": (0.5, 0.5), "going down": (0.5, 0.0), "staying": (0.0, 0.5)}
    assert next(iter(phrases)) == "going up"


def test_paired_resamples_know_that_the_seeds_are_the_same() -> None:
    """Where both differ by the same amount on every seed, the difference is exact although the values vary."""
    low = [played("u" * 4, "u" * 4, "u" * 4, reward=reward) for reward in (1.0, 5.0, 9.0)]
    high = [played("u" * 4, "u" * 4, "u" * 4, reward=reward + 1) for reward in (1.0, 5.0, 9.0)]
    rows = beside((high, counted(*high)), (low, counted(*low)), judges_success=False)["measures"]
    assert rows[0]["name"] == "return"
    assert rows[0]["difference"] == {"value": 4.0, "low": 4.0, "high": 4.0}
    assert rows[0]["this"]["low"] < rows[0]["this"]["value"]
