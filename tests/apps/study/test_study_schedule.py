"""What a person goes through, from the settings."""

from __future__ import annotations

from collections import Counter

import pytest

from ibe_rl.apps.study.assignment import orders_of
from ibe_rl.apps.study.schedule import ATTENTION, TRANSFER, TRIAL, Page, episodes_needed, pages_of
from ibe_rl.apps.study.settings import NONE, PRACTICE, StudySettings, TrialSettings
from ibe_rl.types import ConfigError


def study(**trials) -> StudySettings:
    return StudySettings(trials=TrialSettings(**{"practice": 1, "each_arm": 3, "attention_checks": 0, **trials}))


def trials(pages: list[Page]) -> list[Page]:
    return [page for page in pages if page.kind == TRIAL]


def test_the_way_through() -> None:
    settings = study(each_arm=2, transfer=1)
    pages = pages_of(settings, ("ibe",), 4, number=0)
    assert [page.name for page in pages] == [
        *("consent", "demographics", "instructions", "comprehension", "trial/practice/1"),
        *("trial/1/1", "trial/1/2", "trial/transfer/1", "scale/satisfaction", "scale/trust", "comment"),
        "debriefing",
    ]
    shown = {page.name: (page.arm, page.episode) for page in trials(pages)}
    assert shown["trial/practice/1"] == ("ibe", 0)
    assert shown["trial/transfer/1"][0] == NONE
    assert sorted(episode for _, episode in shown.values()) == [0, 1, 2, 3]


def test_what_is_not_asked_for_is_not_there() -> None:
    settings = study(practice=0)
    settings.demographics, settings.scales = False, []
    names = [page.name for page in pages_of(settings, ("none",), 3, number=0)]
    assert "demographics" not in names
    assert not [name for name in names if name.startswith(("scale", "attention", "trial/practice", "trial/transfer"))]


def test_no_episode_is_seen_twice_and_each_is_equally_often_in_each_arm() -> None:
    settings, orders = study(transfer=3), orders_of(["none", "ibe"], within=True)
    seen: Counter[tuple[str, int]] = Counter()
    for number in range(1, 13):
        pages = trials(pages_of(settings, orders[number % 2], episodes_needed(settings, 2), number))
        assert len({page.episode for page in pages}) == len(pages) == 10
        seen.update((page.block, page.episode) for page in pages if page.block != PRACTICE)
    assert {block for block, _ in seen} == {"none", "ibe", TRANSFER}
    assert set(seen.values()) == {4}
    assert len(seen) == 27


def test_the_same_person_has_the_same_pages_and_others_another_order() -> None:
    settings = study(each_arm=12)
    assert pages_of(settings, ("ibe",), 13, 4) == pages_of(settings, ("ibe",), 13, 4)
    orders = {tuple(page.episode for page in trials(pages_of(settings, ("ibe",), 13, n))) for n in range(20)}
    assert len(orders) > 15


@pytest.mark.parametrize("checks", [0, 1, 3, 20])
def test_attention_is_checked_between_trials_that_count(checks: int) -> None:
    settings = study(each_arm=6, practice=3, attention_checks=checks)
    pages = pages_of(settings, ("ibe",), 9, number=1)
    at = [index for index, page in enumerate(pages) if page.kind == ATTENTION]
    assert len(at) == min(checks, 6)
    names = [pages[index].name for index in at]
    assert names == [f"attention/{number}" for number in range(1, len(at) + 1)]
    for index in at:
        assert pages[index + 1].name.startswith("trial/1")


def test_the_instructions_show_words_where_there_are_any_and_practice_goes_through_the_arms() -> None:
    pages = pages_of(study(practice=3), ("none", "ibe"), 9, number=1)
    assert [page.arm for page in pages if page.kind == "instructions"] == ["ibe"]
    assert [page.arm for page in pages if page.block == PRACTICE] == ["none", "ibe", "none"]


@pytest.mark.parametrize(("practice", "episodes", "example"), [(1, 5, 4), (1, 4, 0), (0, 3, -1), (0, 4, 3)])
def test_the_example_is_an_episode_to_spare(practice: int, episodes: int, example: int) -> None:
    pages = pages_of(study(practice=practice), ("ibe",), episodes, number=1)
    assert [page.episode for page in pages if page.kind == "instructions"] == [example]


def test_too_few_episodes_are_refused() -> None:
    with pytest.raises(ConfigError, match="4 episodes needed, 3 are in stimuli/"):
        pages_of(study(), ("ibe",), 3, number=0)
