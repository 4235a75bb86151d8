"""Words of whoever teaches: what is one, what is none, and how they are kept in slots."""

import numpy as np
import pytest

from ibe_rl.task.words import FREE_SLOT, LONGEST_WORD, MOST_WORDS, PHRASES_KEPT, Word, WordError, Words, clean


def test_words_of_any_script_keep_their_slots():
    words = Words(["links", "halt", "上", "يسار", "बाएँ"], slots=7)
    assert words.names == ("links", "halt", "上", "يسار", "बाएँ")
    assert (len(words), words.slot_of("HALT"), words.slot_of("stop")) == (7, 1, None)
    np.testing.assert_array_equal(words.one_hot(2), np.eye(7)[2])
    assert words.add("west", 500) == 5
    words.rename(5, "Westen")
    assert words.entries[5] == Word("Westen", 500, ("west",))
    assert (words.name_at(5), words.name_at(6)) == ("Westen", FREE_SLOT)
    assert Words.from_dicts(words.to_dicts(), 7).entries == words.entries


def test_a_new_name_may_differ_in_letters_only():
    words = Words(["left", "right"])
    words.rename(0, "LEFT")
    words.rename(0, "LEFT")
    assert words.entries[0] == Word("LEFT", 0, ("left",))


def test_a_phrase_says_one_word_and_is_none():
    words = Words(["left", "right"], 4)
    words.count_as(0, " go  left")
    words.count_as(1, "starboard")
    assert (words.slot_of("Go left"), words.slot_of("starboard")) == (0, 1)
    words.count_as(1, "GO LEFT")
    assert [one.phrases for one in words.entries] == [(), ("starboard", "GO LEFT")]
    assert Words.from_dicts(words.to_dicts(), 4).entries == words.entries
    words.rename(1, "starboard")
    assert words.entries[1] == Word("starboard", 0, ("right",), ("GO LEFT",))
    assert words.add("go left") == 2
    assert [one.phrases for one in words.entries] == [(), (), ()]
    with pytest.raises(WordError, match=r"^phrase 'LEFT': it is a word itself; allowed is a text that is none"):
        words.count_as(1, "LEFT")


def test_the_newest_phrases_are_kept():
    words = Words(["left"])
    for number in range(PHRASES_KEPT + 2):
        words.count_as(0, f"phrase {number}")
    assert (words.entries[0].phrases[0], len(words.entries[0].phrases)) == ("phrase 2", PHRASES_KEPT)


def test_a_phrase_that_cannot_be_shown_is_refused():
    with pytest.raises(WordError, match="cannot be shown"):
        Words([Word("left", phrases=("go\x07",))])


def test_words_of_an_older_run_have_no_phrases():
    older = [{"word": "left", "added_at_frame": 0, "renamed_from": []}]
    assert Words.from_dicts(older).entries == (Word("left"),)


def test_one_word_alone_is_said_or_not():
    left, free = Words(["a {left}"], 2)
    assert (left.positive.format(degree=""), left.zero) == ("a {left}", "not a {{left}}")
    assert FREE_SLOT in free.positive
    assert len(Words(["a", "b", "c"])[:2]) == 2
    with pytest.raises(IndexError):
        Words(["a"])[1]


def test_equal_texts_are_written_in_one_way():
    assert clean("  go   left ") == "go left"
    assert clean("e\u0301t\u00e9") == "\u00e9t\u00e9"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        ("   ", "it is empty"),
        ("a\nb", "cannot be shown"),
        ("a\x07", "cannot be shown"),
        ("\u202eleft", "cannot be shown"),
        ("\ud800", "cannot be shown"),
        ("x" * (LONGEST_WORD + 1), f"{LONGEST_WORD + 1} characters; allowed are 1 to {LONGEST_WORD}"),
        ("LINKS", "it is there already"),
        ("\uff4cinks", "it is there already"),
        (3, "allowed is a text"),
    ],
)
def test_what_is_no_word_is_refused(text: str, reason: str):
    words = Words(["links"], 2)
    with pytest.raises(WordError, match=reason):
        words.add(text)
    assert words.names == ("links",)


@pytest.mark.parametrize(
    ("words", "slots", "reason"),
    [
        ([], None, "allowed are 1 to 12 words"),
        ([f"w{number}" for number in range(MOST_WORDS + 1)], None, "allowed are 1 to 12 words"),
        (["a", "b"], 1, r"instructor\.max_words=1: allowed are 2 \(its words\) to 12"),
        (["a"], 13, r"instructor\.max_words=13"),
        (["a", "A"], None, r"instructor\.words: word 'A': it is there already"),
    ],
)
def test_what_are_no_words_of_an_instructor_is_refused(words: list[str], slots: int | None, reason: str):
    with pytest.raises(WordError, match=reason):
        Words(words, slots)


def test_a_full_list_takes_no_more():
    with pytest.raises(WordError, match="all 1 places are taken"):
        Words(["a"]).add("b")


@pytest.mark.parametrize("values", [3, ["a"], [{"word": "a"}], [{"word": 3, "added_at_frame": 0, "renamed_from": []}]])
def test_damaged_values_are_no_words(values: object):
    with pytest.raises(ValueError, match="word"):
        Words.from_dicts(values)
