"""What the view says in words."""

from dataclasses import replace

from view_data import TASK, developed, explain, flights, refreshed

from ibe_rl.ibe import Meaning
from ibe_rl.ibe.meaning_lines import NOT_INFERRED
from ibe_rl.task import Phrases
from ibe_rl.types import CANNOT_TELL, DOES_NOT_KNOW
from ibe_rl.view import sentences, wording
from ibe_rl.vocabulary.refresh import Refresh


def test_words_that_all_phrases_begin_with_are_left_out() -> None:
    words = TASK.phrases
    assert wording.short(["falling straight down", "falling far left"], words) == ["straight down", "far left"]
    [falling] = words
    other = replace(falling, zero="standing still")
    assert wording.short(["standing still"], [other]) == ["standing still"]


def test_the_table_names_clusters_by_their_ids_and_says_what_they_were_called() -> None:
    refresh = developed()[1]
    assert refresh.change is not None
    lines = sentences.vocabulary_table(refresh, TASK.phrases, spoken=int(refresh.mapping.ids[2])).splitlines()
    assert len(lines) == 2 + 8
    before = sentences.phrases_before(refresh, TASK.phrases)
    now = sentences.cluster_phrases(refresh.mapping, TASK.phrases)
    for row, name in enumerate(refresh.mapping.ids.tolist()):
        cells = [cell.strip(" *") for cell in lines[2 + row].strip("|").split("|")]
        link = f"[#{name}](recording://said/{name})"
        assert cells[0] == (f"→ {link}" if row == 2 else link)
        assert cells[1] == now[name]
        assert cells[4] == ("new" if name not in before else "" if before[name] == now[name] else before[name])
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
    assert wording.verdict_line(60, "going up", "going up") == "said 60 steps ago: going up: it did"
    assert wording.verdict_line(20, "going up", "staying") == "said 20 steps ago: going up: it was staying"
    assert wording.verdict_line(1, "going up", "going up") == "said 1 step ago: going up: it did"
    assert (wording.span_name(1), wording.span_name(2)) == ("next step", "next 2 steps")


def test_what_is_unknown_is_not_a_number_in_words() -> None:
    refresh = developed()[1]
    assert refresh.change is not None
    unknown = replace(refresh, change=replace(refresh.change, staleness=float("nan")))
    assert sentences.moved(unknown)[-1] == "their staleness is unknown"


def test_a_vocabulary_that_stays_is_not_said_to_stand_on_what_the_other_one_would() -> None:
    refresh = developed()[1]
    assert "Best " in sentences.standing(refresh, TASK, None)
    assert "Best " not in sentences.standing(replace(refresh, taken=False), TASK, None)


def test_that_the_agent_does_not_know_is_said_in_full() -> None:
    """Also where all phrases begin with as many words as it has."""
    words = [Phrases("it is going to stay", "it is going to go {degree}down", "it is going to go up", ((0.2, ""),))]
    assert wording.shared_words(words) == 4
    said = ["it is going to stay", DOES_NOT_KNOW, CANNOT_TELL]
    assert wording.short(said, words) == ["stay", DOES_NOT_KNOW, CANNOT_TELL]


def unknown(refresh: Refresh, **known: bool) -> Refresh:
    meaning = Meaning(**({"negative": False, "positive": False} | known), reason="nobody did it")
    return replace(refresh, mapping=replace(refresh.mapping, meanings=(meaning,)))


def test_a_word_without_a_known_meaning_is_not_in_the_table() -> None:
    table = sentences.vocabulary_table(unknown(refreshed(), negative=True), TASK.phrases)
    assert f"| {CANNOT_TELL} | - | " in table
    assert "to the right" not in table
    assert "to the left" in table
    none = sentences.vocabulary_table(unknown(refreshed()), TASK.phrases)
    assert "left" not in none


def test_a_vocabulary_says_what_it_is_worth() -> None:
    scored = replace(refreshed(), scores_of_numbers=[{"motion_auc": 0.044, "echo_auc": 0.61}])
    told, meaning = sentences.worth(scored, TASK)
    assert told == (
        "AUC of its words for the direction of motion: .04, reversed (chance .50, repeating the last instruction .61)"
    )
    assert meaning == NOT_INFERRED
    known = sentences.worth(unknown(scored, negative=True, positive=True), TASK)
    assert known[-1].startswith("env.task.explained=[x] says that x rises with +1")
    told, meaning = sentences.worth(unknown(scored), TASK)
    assert meaning == "I cannot tell what “falling to the right” means: nobody did it"
    assert all(line in sentences.standing(unknown(scored), TASK, None) for line in (told, meaning))


def test_neither_a_number_without_a_meaning_nor_a_confidence_that_is_none_is_shown() -> None:
    one = explain(flights()[1], refreshed())[0]
    number = f"(expression {one.expression[0]:+.2f}"
    assert wording.said_lines("up", one).endswith(f"{number}, confidence {one.confidence:.0%})")
    assert wording.said_lines("up", replace(one, calibrated=False)).endswith(f"{number})")
    two = replace(one, expression=(1.0, -0.5))  # no room for both
    assert wording.said_lines("up", two).endswith(f"** (confidence {one.confidence:.0%})")
    assert wording.said_lines("up", replace(two, calibrated=False)).endswith("**")
    unknown = wording.said_lines("up", replace(one, meant=False, known=False))
    assert unknown.endswith(f"next {one.horizon_steps} steps: **{CANNOT_TELL}**")


def test_a_long_label_of_the_picture_has_two_lines() -> None:
    short, long = (
        "says: now up, later down",
        "says: now moderately to the left and slower, later slightly to the left and faster",
    )
    assert wording.in_lines(short) == short
    assert wording.in_lines(long).splitlines() == [
        "says: now moderately to the left and slower,",
        "later slightly to the left and faster",
    ]


def test_what_it_could_not_tell_is_not_judged() -> None:
    assert wording.verdict_line(60, CANNOT_TELL, "going up") == "60 steps ago it could not tell"
    assert "no known word for" in wording.verdict_line(60, "going up", CANNOT_TELL)
