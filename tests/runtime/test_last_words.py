"""A child process leaves a message that its parent hears."""

from ibe_rl.runtime.last_words import LastWords, leave


def test_the_first_words_are_heard_and_nothing_stays():
    last_words = LastWords()
    assert last_words.heard() is None
    leave(last_words.folder, "the cable broke")
    assert last_words.heard() == "the cable broke"
    folder = last_words.folder
    del last_words
    assert not folder.exists()
