"""Groups of typed texts that say the same word, by a small embedding model (extra ``phrases``)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from ibe_rl.task.words import Words, alike
from ibe_rl.types import Array

LEAST_SIMILARITY = 0.75
"""Cosine from which on two texts say the same. In English none of 30 instructions then joined a wrong word, and 11 the
right one; with .65 it was 2 and 18. Where one sign makes the difference, as in Japanese, some join a wrong one."""
Embed = Callable[[Sequence[str]], Array]
"""``N`` texts to vectors ``(N, E)`` of length 1."""
Nearest = Callable[[str, Words], "int | None"]
"""The slot of the word that a text says; None if it is a new word."""


def nearest_word(text: str, words: Words, embed: Embed) -> int | None:
    """The slot of the word that a text says, by the most similar of all words and phrases; None if none is similar."""
    known = [(slot, said) for slot, one in enumerate(words.entries) for said in (one.word, *one.phrases)]
    vectors = embed([alike(one) for one in (text, *(said for _, said in known))])
    similarities = vectors[1:] @ vectors[0]
    best = int(similarities.argmax())
    return known[best][0] if similarities[best] >= LEAST_SIMILARITY else None


@contextmanager
def _logging_as_it_is() -> Iterator[None]:
    """Take back what an import does to the root logger: wordllama lets it print what all libraries report."""
    root = logging.getLogger()
    level, handlers = root.level, [*root.handlers]
    try:
        yield
    finally:
        root.setLevel(level)
        root.handlers[:] = handlers


def load_nearest() -> Nearest:
    """Load the embedding model, which its package brings along."""
    with _logging_as_it_is():
        import wordllama  # an extra

    # 0.4.0 looks for its tokenizer in another folder than the one that it is installed in
    model = wordllama.WordLlama.load(cache_dir=Path(wordllama.__file__).parent, disable_download=True)
    return partial(nearest_word, embed=lambda texts: np.asarray(model.embed(list(texts), norm=True), float))
