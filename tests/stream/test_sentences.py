"""What the view says in words."""

from dataclasses import replace

from view_data import TASK, developed, refreshed

from ibe_rl.data import DOES_NOT_KNOW
from ibe_rl.stream import sentences
from ibe_rl.task import Phrases


def test_words_that_all_phrases_begin_with_are_left_out() -> None:
    words = TASK.phrases
    assert sentences.short(["falling straight down", "falling far left"], words) == ["straight down", "far left"]
    [falling] = words
    other = replace(falling, zero="standing still")
    assert sentences.short(["standing still"], [other]) == ["standing still"]


def test_the_table_names_clusters_by_their_ids_and_says_what_they_were_called() -> None:
    refresh = developed()[1]
    assert refresh.change is not None
    lines = sentences.vocabulary_table(refresh, TASK.phrases, spoken=int(refresh.mapping.ids[2])).splitlines()
    assert len(lines) == 2 + 8
    before = sentences.phrases_before(refresh, TASK.phrases)
    now = sentences.phrases_of(refresh.mapping, TASK.phrases)
    for row, name in enumerate(refresh.mapping.ids.tolist()):
        cells = [cell.strip(" *") for cell in lines[2 + row].strip("|").split("|")]
        assert cells[0] == (f"→ #{name}" if row == 2 else f"#{name}")
        assert cells[2] == now[name]
        assert cells[3] == ("new" if name not in before else "" if before[name] == now[name] else before[name])
    assert {name for name in now if name not in before} == set(refresh.change.transition.emerged)


def test_the_first_vocabulary_has_nothing_before() -> None:
    assert sentences.phrases_before(refreshed(), TASK.phrases) == {}
    assert sentences.transitions(refreshed(), TASK.phrases) == []
    assert sentences.moved(refreshed()) == []
    assert "new" not in sentences.vocabulary_table(refreshed(), TASK.phrases)


def test_each_cluster_that_changed_has_its_line() -> None:
    refresh = developed()[1]
    assert refresh.change is not None
    lines = sentences.transitions(refresh, TASK.phrases)
    for name in refresh.change.transition.emerged:
        assert any(line.startswith(f"#{name} emerged: ") for line in lines)
    for name in refresh.change.transition.vanished:
        assert any(line.startswith(f"#{name} vanished: ") for line in lines)
    assert sum(" was " in line for line in lines) == len(lines) - len(refresh.change.transition.emerged) - len(
        refresh.change.transition.vanished
    )
    assert sentences.transitions(replace(refresh, taken=False), TASK.phrases) == []


def test_a_verdict_says_what_happened_where_it_was_not_what_was_said() -> None:
    assert sentences.judged(60, "going up", "going up") == "said 60 steps ago: going up: it did"
    assert sentences.judged(20, "going up", "staying") == "said 20 steps ago: going up: it was staying"


def test_what_cannot_be_told_is_not_a_number_in_words() -> None:
    refresh = developed()[1]
    assert refresh.change is not None
    unknown = replace(refresh, change=replace(refresh.change, staleness=float("nan")))
    assert sentences.moved(unknown)[-1] == "their staleness cannot be told"


def test_a_vocabulary_that_stays_is_not_said_to_stand_on_what_the_other_one_would() -> None:
    refresh = developed()[1]
    assert "Best " in sentences.standing(refresh, TASK.phrases, None)
    assert "Best " not in sentences.standing(replace(refresh, taken=False), TASK.phrases, None)


def test_that_the_agent_does_not_know_is_said_in_full() -> None:
    """Also where all phrases begin with as many words as it has."""
    words = [Phrases("it is going to stay", "it is going to go {degree}down", "it is going to go up", ((0.2, ""),))]
    assert sentences.shared_words(words) == 4
    assert sentences.short(["it is going to stay", DOES_NOT_KNOW], words) == ["stay", DOES_NOT_KNOW]
