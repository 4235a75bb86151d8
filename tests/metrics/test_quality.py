"""What was said is compared with what then happened, in the same words."""

import numpy as np
import pytest

from ibe_rl.data import Array, Episode, Explanation, Phrases
from ibe_rl.metrics import came_true, phrases_true

WORDS = [Phrases("still", "{degree}down", "{degree}up", ((0.5, ""),))]


class Sign:
    """Expresses the sign of the change."""

    def cluster(self, delta: Array) -> Array:
        return np.zeros(len(delta), int)

    def express(self, delta: Array) -> Array:
        return np.sign(delta[:, :1])

    def confidence(self, delta: Array) -> Array:
        return np.ones(len(delta))


def spoken(phrase: str, horizon_steps: int = 2) -> Explanation:
    return Explanation(np.zeros(1), phrase, 0, np.zeros(1), horizon_steps, 1.0, np.zeros((3, 1)))


@pytest.fixture
def episode() -> Episode:
    """Over two steps, to the end where that is nearer: up, still, down, down."""
    states = np.array([[0.0], [3], [5], [3], [1]])
    return Episode(states, np.zeros(4), np.zeros(4), np.zeros((4, 1)), np.ones(4, bool), True, True, "")


@pytest.mark.parametrize(
    ("said", "share"),
    [
        (["up", "still", "down", "down"], 1.0),
        (["up", "still", "down", "still"], 0.75),
        (["down", "up", "still", "down"], 0.25),
        (["down", "up", "up", "up"], 0.0),
    ],
)
def test_the_share_of_phrases_that_came_true(episode: Episode, said: list[str], share: float):
    assert came_true(episode, [spoken(phrase) for phrase in said], Sign(), WORDS) == share


def test_each_phrase_is_judged_at_its_own_moment(episode: Episode):
    said = [spoken(phrase) for phrase in ("up", "up", "down", "still")]
    assert phrases_true(episode, said, Sign(), WORDS).tolist() == [True, False, True, False]


def test_only_what_is_newly_said_counts(episode: Episode):
    said = [spoken(phrase) for phrase in ("up", "up", "down", "down")]  # one every second step, held in between
    assert came_true(episode, said, Sign(), WORDS, every_steps=2) == 1
    assert came_true(episode, said, Sign(), WORDS) == 0.75


def test_the_horizon_is_the_explanations_own(episode: Episode):
    """Over one step: up, up, down, down."""
    said = [spoken(phrase, horizon_steps=1) for phrase in ("up", "up", "down", "down")]
    assert came_true(episode, said, Sign(), WORDS) == 1


def test_there_is_an_explanation_for_every_step(episode: Episode):
    with pytest.raises(ValueError, match="zip"):
        came_true(episode, [spoken("up")] * 3, Sign(), WORDS)
