"""The words of a run in its folder, and what the agent notices about them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.worded import worded
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Meaning
from ibe_rl.ibe.space import scaled
from ibe_rl.storage.run_folder import WORD_LIST
from ibe_rl.task.words import Words
from ibe_rl.types import Array, ConfigError
from ibe_rl.vocabulary.word_notices import notices_of
from ibe_rl.vocabulary.words import (
    MEANS_NOTHING,
    MEANS_OTHER,
    MEANS_SAME,
    WordNotice,
    save_words,
    take_up_words,
    words_of,
)


def test_words_are_read_as_they_were_written(tmp_path: Path):
    words = Words(["links", "上"], 3)
    words.add("später", 700)
    words.rename(0, "west")
    save_words(tmp_path, words)
    again = words_of(tmp_path, 3)
    assert again is not None
    assert again.entries == words.entries
    assert words_of(tmp_path / "elsewhere") is None


def test_a_run_that_goes_on_has_its_present_words(tmp_path: Path):
    task, now = worded(LANDER_TASK, ["a", "b", "c"], 4), Words(["x", "b", "c", "d"])
    take_up_words(tmp_path, task)
    save_words(tmp_path, now)
    take_up_words(tmp_path, task)
    take_up_words(tmp_path, LANDER_TASK)
    assert task.words is not None
    assert task.words.names == ("x", "b", "c", "d")


@pytest.mark.parametrize("text", ["", "{", "[3]", '[{"word": "a"}]', '[{"word": "", "added_at_frame": 0}]'])
def test_damaged_words_are_named(tmp_path: Path, text: str):
    (tmp_path / WORD_LIST).write_text(text)
    with pytest.raises(ConfigError, match=r"words\.json: not the words of a run"):
        words_of(tmp_path)


def test_more_words_than_places_are_refused(tmp_path: Path):
    save_words(tmp_path, Words(["a", "b"]))
    with pytest.raises(ConfigError, match="max_words=1"):
        words_of(tmp_path, 1)


def test_a_notice_survives_its_file():
    notice = WordNotice(MEANS_SAME, (0, 2), "you use 'left' and 'west' alike")
    assert WordNotice.from_dict(notice.to_dict()) == notice


DELTA = np.linspace(-1, 1, 21)[:, None]


def mapping(shares: Array, *meanings: Meaning) -> ClusterMapping:
    """Two clusters of a movement in one dimension, to the left and to the right."""
    count = np.ones(2)
    space = scaled(np.zeros(1), np.ones(1))
    return ClusterMapping(
        space, np.array([[-1.0], [1.0]]), shares, shares, count, count, count, np.arange(2), meanings=meanings
    )


def noticed(now: ClusterMapping, last: ClusterMapping | None = None) -> list[tuple[str, tuple[int, ...]]]:
    return [(one.kind, one.slots) for one in notices_of(now, DELTA, last, Words(["a", "b", "c"]))]


KNOWN = Meaning(moves=(1.0,))
LEFT_RIGHT = np.array([[1.0, 0, 0], [0, 1.0, 0]])


def test_it_says_what_means_nothing_and_what_means_the_same():
    unknown = replace(KNOWN, positive=False, reason="not heard yet")
    found = mapping(LEFT_RIGHT, KNOWN, unknown, replace(KNOWN, same_as=0))
    assert noticed(found) == [(MEANS_NOTHING, (1,)), (MEANS_SAME, (0, 2))]
    assert [one.text for one in notices_of(found, DELTA, None, Words(["left", "up", "west"]))] == [
        "'up' means nothing to me yet: not heard yet",
        "you use 'left' and 'west' alike",
    ]
    assert notices_of(found, DELTA, None, None) == []


def test_it_says_what_has_changed_its_meaning():
    before = mapping(LEFT_RIGHT, KNOWN, KNOWN, KNOWN)
    after = mapping(LEFT_RIGHT[:, [1, 0, 2]], KNOWN, KNOWN, KNOWN)
    assert noticed(after, before) == [(MEANS_OTHER, (0,)), (MEANS_OTHER, (1,))]
    assert noticed(before, before) == []
    numbers = replace(before, meanings=())
    assert noticed(after, numbers) == []
