"""Which word a typed text says: by hand, and with the model of the extra."""

import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import pytest

from ibe_rl.apps.teach.phrase_groups import LEAST_SIMILARITY, load_nearest, nearest_word
from ibe_rl.task.words import Words
from ibe_rl.types import Array

ANGLES = {"left": 0.0, "west": 0.3, "westward": 0.9, "right": 2.0, "up": 1.1}


def on_a_circle(texts: Sequence[str]) -> Array:
    angles = np.array([ANGLES[one] for one in texts])
    return np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_text_says_the_word_it_is_most_similar_to_or_none():
    words = Words(["left", "right"])
    assert nearest_word("West", words, on_a_circle) == 0
    assert np.cos(0.9) < LEAST_SIMILARITY
    assert nearest_word("westward", words, on_a_circle) is None
    words.count_as(0, "west")  # which is near enough
    assert nearest_word("westward", words, on_a_circle) == 0
    assert nearest_word("up", Words(["right"]), on_a_circle) is None


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("to the left", "left"),
        ("Left!", "left"),
        ("go right", "right"),
        ("hold it", "hold"),
        ("to the right", "right"),
        ("a la izquierda", "izquierda"),
        ("nach links", None),
        ("faster", None),
        ("down", None),
    ],
)
def test_the_model_knows_what_says_the_same(text: str, word: str | None):
    words = Words(["left", "hold", "right", "izquierda", "derecha"])
    found = load_nearest()(text, words)
    assert (None if found is None else words.names[found]) == word


def test_the_model_leaves_what_is_logged_as_it_is():
    """In a process of its own, where it was never imported."""
    program = "import logging; from ibe_rl.apps.teach.phrase_groups import load_nearest; before = logging.root.level; "
    program += "load_nearest(); print(logging.root.level == before, logging.root.handlers)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "True []\n"
