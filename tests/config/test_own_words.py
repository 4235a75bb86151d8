"""The words of an instructor reach the environment, and only so."""

from dataclasses import fields
from types import SimpleNamespace

import pytest

from ibe_rl.config.limits import setting
from ibe_rl.config.own_words import OwnWords, hand_on_words
from ibe_rl.types import ConfigError
from ibe_rl.words import MOST_WORDS


def test_the_environment_gets_the_words_of_the_instructor():
    values = SimpleNamespace(env=OwnWords(), instructor=OwnWords(words=["a", "b"], max_words=3))
    hand_on_words(values)
    hand_on_words(values)
    assert values.env == values.instructor


def test_words_of_the_environment_alone_are_refused():
    values = SimpleNamespace(env=OwnWords(words=["a"]), instructor=OwnWords())
    with pytest.raises(ConfigError, match=r"env\.words=\['a'\]: allowed is instructor\.words"):
        hand_on_words(values)


def test_settings_without_an_instructor_stay_as_they_are():
    hand_on_words(SimpleNamespace(env=OwnWords()))


def test_there_are_as_many_places_as_words_can_be():
    [places] = [item for item in fields(OwnWords) if item.name == "max_words"]
    assert places.metadata == setting(None, low=1, high=MOST_WORDS).metadata
