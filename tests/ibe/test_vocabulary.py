"""From mean instructions to expressions, and from expressions to words."""

import subprocess
import sys

import numpy as np
import pytest

from ibe_rl.envs import LANDER_TASK
from ibe_rl.ibe import normalise, phrase
from ibe_rl.ibe.vocabulary import NORMALISATIONS
from ibe_rl.task import Phrases


def column(*values: float) -> np.ndarray:
    return np.array(values, float)[:, None]


def test_minmax_spreads_over_the_whole_scale():
    np.testing.assert_allclose(normalise(column(0.2, 0.4, 0.6)), column(-1, 0, 1), atol=1e-12)
    np.testing.assert_allclose(normalise(column(-0.5, 0.0, 1.5), "minmax"), column(-1, -0.5, 1))


def test_sign_keeps_every_sign():
    np.testing.assert_allclose(normalise(column(0.2, 0.4, 0.8), "sign"), column(0.25, 0.5, 1))
    np.testing.assert_allclose(normalise(column(-0.5, 0.0, 0.25), "sign"), column(-1, 0, 0.5))


def test_equal_means_say_nothing():
    assert normalise(column(0.3, 0.3, 0.3), "minmax").tolist() == [[0], [0], [0]]
    assert normalise(column(0, 0), "sign").tolist() == [[0], [0]]


@pytest.mark.parametrize("how", NORMALISATIONS)
def test_columns_are_normalised_on_their_own_and_stay_in_the_scale(how: str):
    means = np.random.default_rng(0).uniform(-1, 1, (8, 3))
    means[:, 1] = 0
    normal = normalise(means, how)
    assert np.abs(normal).max() == 1
    assert not normal[:, 1].any()
    np.testing.assert_array_equal(normal[:, [2]], normalise(means[:, [2]], how))


def test_another_normalisation_is_refused():
    with pytest.raises(ValueError, match="normalisation='softmax': choose one of minmax, sign"):
        normalise(column(0, 1), "softmax")


WORDS = Phrases("still", "{degree}down", "{degree}up", ((0.2, "a little "), (0.5, ""), (0.9, "far ")))


@pytest.mark.parametrize(
    ("size", "down", "up"),
    [
        (0.0, "still", "still"),
        (0.199, "still", "still"),
        (0.2, "a little down", "a little up"),
        (0.499, "a little down", "a little up"),
        (0.5, "down", "up"),
        (0.899, "down", "up"),
        (0.9, "far down", "far up"),
        (1.0, "far down", "far up"),
    ],
)
def test_the_words_at_each_limit(size: float, down: str, up: str):
    assert phrase(np.array([-size]), [WORDS]) == down
    assert phrase(np.array([size]), [WORDS]) == up


def test_several_numbers_are_joined():
    other = Phrases("level", "{degree}left", "{degree}right", ((0.5, ""),))
    assert phrase(np.array([1.0, -0.6]), [WORDS, other]) == "far up and left"
    with pytest.raises(ValueError, match="zip"):
        phrase(np.array([1.0]), [WORDS, other])


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (-1, "falling to the left"),
        (-0.5, "falling moderately to the left"),
        (-0.3, "falling slightly to the left"),
        (-0.2, "falling straight down"),
        (0, "falling straight down"),
        (0.3, "falling slightly to the right"),
        (0.5, "falling moderately to the right"),
        (1, "falling to the right"),
    ],
)
def test_the_landers_words(value: float, words: str):
    assert phrase(np.array([value]), LANDER_TASK.phrases) == words


def test_ibe_knows_no_torch():
    code = "import ibe_rl, ibe_rl.ibe, sys; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
