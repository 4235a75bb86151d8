"""What was said is compared with what then happened, in the same words."""

from dataclasses import replace

import numpy as np
import pytest
from by_hand import TASK, on_a_line

from ibe_rl.ibe import Windows
from ibe_rl.metrics.quality import (
    SCORES,
    episode_scores,
    instruction_f1,
    mean_scores,
    motion_auc,
    motion_spearman,
    number_scores,
    outcomes,
    phrase_accuracy,
    phrase_hits,
    realised_phrases,
    vocabulary_scores,
)
from ibe_rl.task import Phrases
from ibe_rl.types import CANNOT_TELL, Array, Episode, Explanation

WORDS = [Phrases("still", "{degree}down", "{degree}up", ((0.5, ""),))]


class Sign:
    """Expresses the sign of the change."""

    def cluster(self, delta: Array) -> Array:
        return np.zeros(len(delta), int)

    def express(self, delta: Array) -> Array:
        return np.sign(delta[:, :1])

    def knows(self, delta: Array) -> Array:
        return np.ones(len(delta), bool)

    def confidence(self, delta: Array) -> Array:
        return np.ones(len(delta))


def spoken(phrase: str, horizon_steps: int = 2) -> Explanation:
    return Explanation(np.zeros(1), phrase, 0, np.zeros(1), horizon_steps, 1.0, np.zeros((3, 1)), np.zeros((1, 1)))


@pytest.fixture
def episode() -> Episode:
    """Over two steps, to the end where that is nearer: up, still, down, down."""
    states = np.array([[0.0], [3], [5], [3], [1]])
    return Episode(states, np.zeros(4), np.zeros(4), np.zeros((4, 1)), np.ones(4, bool), True, True, "")


@pytest.mark.parametrize(
    ("said", "true"),
    [
        (["up", "still", "down", "down"], [True, True, True, True]),
        (["up", "still", "down", "still"], [True, True, True, False]),
        (["up", "up", "down", "still"], [True, False, True, False]),
        (["down", "up", "still", "down"], [False, False, False, True]),
        (["down", "up", "up", "up"], [False, False, False, False]),
    ],
)
def test_each_phrase_is_judged_at_its_own_moment(episode: Episode, said: list[str], true: list[bool]):
    assert realised_phrases(episode, 2, Sign(), WORDS) == ["up", "still", "down", "down"]
    assert phrase_hits(episode, [spoken(phrase) for phrase in said], Sign(), WORDS).tolist() == true


def test_a_phrase_that_was_not_sure_enough_to_be_said_is_judged_too(episode: Episode):
    said = [replace(spoken(phrase), known=False) for phrase in ("up", "up", "down", "up")]
    assert phrase_hits(episode, said, Sign(), WORDS).tolist() == [True, False, True, False]


def test_the_horizon_is_the_explanations_own(episode: Episode):
    """Over one step: up, up, down, down."""
    said = [spoken(phrase, horizon_steps=1) for phrase in ("up", "up", "down", "down")]
    assert phrase_hits(episode, said, Sign(), WORDS).all()


def test_there_is_an_explanation_for_every_step(episode: Episode):
    with pytest.raises(ValueError, match="zip"):
        phrase_hits(episode, [spoken("up")] * 3, Sign(), WORDS)


class Second:
    """Says the second number of the change, whatever the first one was."""

    ids = np.zeros(1, int)

    def cluster(self, delta: Array) -> Array:
        return np.zeros(len(delta), int)

    def express(self, delta: Array) -> Array:
        return delta[:, 1:2]

    def knows(self, delta: Array) -> Array:
        return np.ones(len(delta), bool)

    def confidence(self, delta: Array) -> Array:
        return np.ones(len(delta))


def windows(*rows: tuple[float, float, float]) -> Windows:
    """Of (what was told, how the height changed, what ``Second`` says)."""
    instruction, change, said = np.reshape(rows, (-1, 3)).T
    delta = np.column_stack([change, said, np.zeros(len(rows))])
    given, steps, episodes = np.ones(len(rows), bool), np.zeros(len(rows), int), np.arange(len(rows))
    return Windows(delta, instruction[:, None], given, episodes, steps, 5)


def auc(said: list[float], change: list[float], band: float = 0.5) -> float:
    return motion_auc(np.array(said, float), np.array(change, float), band)


@pytest.mark.parametrize(
    ("said", "area"),
    [
        ([-1, -0.5, 0, 0.5, 1], 1.0),
        ([0.1, 0.11, 0.12, 0.13, 0.14], 1.0),  # only the order counts
        ([1, 0.5, 0, -0.5, -1], 0.0),
        ([0.3] * 5, 0.5),
        ([0, 1, 0, 0, 1], (3.5 / 6 + 2.5 / 6) / 2),
        ([-1, 0, 0, 0, 1], (5 / 6 + 5 / 6) / 2),
    ],
    ids=["perfect", "shifted", "inverted", "always the same", "some", "ties"],
)
def test_motion_auc_is_the_share_of_pairs_in_the_right_order(said: list[float], area: float):
    """Down, down, neither, up, up: two by three pairs for each way, a tie counts half."""
    assert auc(said, [-3, -2, 0, 2, 3]) == pytest.approx(area)


def test_motion_auc_is_one_half_by_chance():
    assert auc([1, -1, 1, -1], [2, 2, -2, -2]) == 0.5
    random = np.random.default_rng(0)
    assert motion_auc(random.uniform(-1, 1, 20_000), random.normal(size=20_000), 0.5) == pytest.approx(0.5, abs=0.02)


def test_motion_auc_is_the_mean_of_both_ways():
    """Up against the rest 3 of 4 pairs, down against the rest 4 of 4."""
    assert auc([-1, 0.6, 0.5, 1], [-2, 0, 2, 2]) == pytest.approx((3 / 4 + 3 / 3) / 2)


@pytest.mark.parametrize("change", [[1, 2, 3], [-1, -2, -3], [0, 0, 0], [1, 0, 0], [0, 0, -1], []])
def test_motion_auc_cannot_tell_from_one_way(change: list[float]):
    assert np.isnan(auc([0.0, 0.5, 1.0][: len(change)], change))


def test_a_change_just_as_large_as_the_band_is_none():
    """What was said of these two would cost 2 of 4 pairs each way if they counted."""
    assert auc([-1, 1, 2, -2], [0.5, -0.5, 3, -3], band=0.5) == 1
    assert auc([-1, 1, 2, -2], [0.5, -0.5, 3, -3], band=0.49) == 0.75


def test_motion_spearman_is_the_correlation_of_the_ranks():
    change = np.array([-8.0, -1, 0, 5])
    assert motion_spearman(np.array([0.1, 0.2, 0.3, 1]), change) == pytest.approx(1)
    assert motion_spearman(np.array([1, 0.3, 0.2, 0.1]), change) == pytest.approx(-1)
    assert motion_spearman(np.array([0.2, 0.1, 0.3, 1]), change) == pytest.approx(1 - 6 * 2 / (4 * 15))
    assert np.isnan(motion_spearman(np.zeros(4), change))
    assert np.isnan(motion_spearman(change, np.ones(4)))


def test_instruction_f1_takes_the_nearest_value():
    values, instruction, once = (-1.0, 0.0, 1.0), np.array([-1.0, 0, 0, 1]), np.ones((1, 4))
    assert instruction_f1(instruction, instruction, values, once) == 1
    assert instruction_f1(np.array([-0.6, 0.4, -0.4, 0.51]), instruction, values, once) == 1
    assert instruction_f1(np.zeros(4), instruction, values, once) == pytest.approx((0 + 2 * 0.5 * 1 / 1.5 + 0) / 3)
    assert instruction_f1(-instruction, instruction, values, once) == pytest.approx(1 / 3)


def test_a_vocabulary_is_scored_by_what_really_happened():
    scores = vocabulary_scores(Second(), windows((1, 3, 0.8), (-1, -3, -0.7), (0, 0, 0.1), (1, 2, 0.6)), TASK)
    assert scores == pytest.approx(dict.fromkeys(SCORES, 1.0) | {"motion_auc_disobeyed": np.nan}, nan_ok=True)


def test_the_score_on_disobeyed_windows_leaves_out_the_followed_ones():
    followed = [(1, 3, -0.9), (-1, -3, 0.9), (0, 0.5, 1), (0, -0.5, -1)]  # all said wrongly; the band's edge is still
    disobeyed = [(0, 2, 0.4), (-1, 2, 0.3), (1, 0, 0), (1, -2, -0.3), (0, -0.6, -0.1)]  # all said rightly
    scores = vocabulary_scores(Second(), windows(*followed, *disobeyed), TASK)
    assert scores["motion_auc_disobeyed"] == 1
    assert scores["motion_auc"] < 0.8
    wrong = vocabulary_scores(
        Second(), windows(*followed, *((instruction, went, -said) for instruction, went, said in disobeyed)), TASK
    )
    assert wrong["motion_auc_disobeyed"] == 0


def test_the_dimension_and_the_band_are_the_tasks():
    rows = windows((1, 3, 0.8), (-1, -3, -0.7), (0, 0.2, 0.9))
    assert vocabulary_scores(Second(), rows, TASK)["motion_auc"] == 0.75
    assert vocabulary_scores(Second(), rows, replace(TASK, explained_band=(0.1,)))["motion_auc"] == 1
    assert vocabulary_scores(Second(), rows, replace(TASK, explained=(1,)))["motion_spearman"] == pytest.approx(1)


def test_no_windows_tell_nothing():
    scores = vocabulary_scores(on_a_line([0, 1]), windows(), TASK)
    assert tuple(scores) == SCORES
    assert np.isnan(list(scores.values())).all()


def test_what_has_no_known_meaning_says_nothing(episode: Episode):
    """It neither goes as predicted nor otherwise, however well its phrase fits."""
    pairs = (("up", False), ("up", True), ("down", True), ("up", False))
    said = [replace(spoken(phrase), meant=meant) for phrase, meant in pairs]
    true = phrase_hits(episode, said, Sign(), WORDS)
    np.testing.assert_array_equal(true, [np.nan, 0, 1, np.nan])
    assert phrase_accuracy(true) == 0.5
    assert np.isnan(phrase_accuracy(true[[0, 3]]))


class OneWay(Sign):
    """Knows what down means and not what up means."""

    def knows(self, delta: Array) -> Array:
        return delta[:, 0] <= 0


def test_to_people_what_happened_is_told_in_known_words_only(episode: Episode):
    assert outcomes(episode, 2, OneWay(), WORDS) == [CANNOT_TELL, "still", "down", "down"]
    assert outcomes(episode, 2, Sign(), WORDS) == realised_phrases(episode, 2, Sign(), WORDS)


def test_the_echo_is_scored_beside_the_words():
    """The instruction tells one of three rightly, two that moved against it wrongly."""
    rows = windows((1, 2, 0.8), (-1, 2, 0.7), (1, -2, -0.9), (-1, 0, 0.0))
    scores = vocabulary_scores(Second(), rows, TASK)
    assert scores["motion_auc"] == 1
    assert scores["echo_auc"] == motion_auc(rows.instruction[:, 0], rows.delta[:, 0], 0.5)
    backwards = vocabulary_scores(Second(), windows((1, 2, -0.8), (-1, -2, 0.7), (0, 0, 0)), TASK)
    assert (backwards["motion_auc"], backwards["echo_auc"]) == (0, 1)  # reversed words are not right ones


def test_the_scores_are_the_means_of_those_of_the_numbers():
    rows = windows((1, 3, 0.8), (-1, -3, -0.7), (0, 0, 0.1))
    [only] = number_scores(Second(), rows, TASK)
    assert vocabulary_scores(Second(), rows, TASK) == pytest.approx(only, nan_ok=True)
    unlike = [only | {"motion_auc": 0.25, "echo_auc": np.nan}, only | {"motion_auc": np.nan, "echo_auc": 0.75}]
    assert mean_scores(unlike)["motion_auc"] == 0.25  # what cannot be told is left out
    assert mean_scores(unlike)["echo_auc"] == 0.75


def test_one_episode_is_scored_by_what_was_spoken_in_it(episode: Episode):
    """Up, still, down, down; told nothing but at the first step."""
    instruction = replace(episode, instructions=np.array([[1.0], [0], [0], [0]]))
    said = [replace(spoken(""), expression=np.array([value])) for value in (0.9, 0.0, -0.5, -0.6)]
    here = replace(TASK, explained=(0,))
    [found] = episode_scores(instruction, said, here)
    assert found["motion_auc"] == 1
    assert found["echo_auc"] == (1 + 0.75) / 2  # of the four pairs of down and not two are ties
    wrong = [replace(one, expression=-one.expression) for one in said]
    assert episode_scores(instruction, wrong, here)[0]["motion_auc"] == 0
    one_way = [replace(one, meant=step > 0) for step, one in enumerate(said)]
    assert np.isnan(episode_scores(instruction, one_way, here)[0]["motion_auc"])  # what is left never went up
