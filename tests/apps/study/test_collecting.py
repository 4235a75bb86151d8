"""What an endpoint collected is taken once, through the checks of the server; the rest is counted and named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from own_study import right_value, write_study

from ibe_rl.apps.study.answers import FILE, Answers, Person
from ibe_rl.apps.study.bundle import make_bundle
from ibe_rl.apps.study.collecting import Collection, collect_answers, collect_lines
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.sitting import schedule_of
from ibe_rl.types import ConfigError

TRIALS = {"practice": 0, "each_arm": 1, "attention_checks": 0}


class House:
    """A study that was laid out for two, and its file of answers."""

    def __init__(self, folder: Path):
        make_bundle(folder, str(folder.parent / "out"), "https://collect.example.org", people=2)
        self.study: Study = open_study(folder)
        self.answers = Answers(folder / FILE)
        self.places: list[Person] = self.answers.people(laid_out=True)

    def messages(self, place: int) -> list[dict[str, Any]]:
        """What the page sends when all is answered rightly."""
        person = self.places[place]
        said = [(page.name, right_value(self.study, page)) for page in schedule_of(self.study, person)]
        return [message(person.token, f"{place}-{number}", *one) for number, one in enumerate(said)]

    def collect(self, *given: Any) -> Collection:
        lines = [one if isinstance(one, bytes) else json.dumps(one).encode() for one in given]
        return collect_lines(self.study, self.answers, lines)

    def ended(self) -> list[tuple[int, str | None]]:
        return [(one.number, one.ended) for one in self.answers.people()]


def message(place: str, name: str, page: str, value: dict[str, Any], attempt: int = 1) -> dict[str, Any]:
    answer = {"page": page, "attempt": attempt, "value": value, "took_ms": 900, "hidden_ms": 0}
    return {"id": name, "place": place, "answer": answer}


@pytest.fixture
def house(tmp_path: Path):
    there = House(write_study(tmp_path / "study", trials=TRIALS))
    yield there
    there.answers.close()


def test_answers_are_taken_once(house: House) -> None:
    said, other = house.messages(0), house.messages(1)[:2]
    became = house.collect(*said[:3], said[2], other[0], *said[3:], other[1], other[1])
    assert dict(+became.counts) == {"taken": len(said) + 2, "repeated": 2}
    assert became.refused == {}
    assert house.ended() == [(1, "finished"), (2, None)]
    kept = house.answers.answers_of(house.places[0])
    assert {(one.page, json.dumps(one.value), one.took_ms) for one in kept} == {
        (one["answer"]["page"], json.dumps(one["answer"]["value"]), 900) for one in said
    }
    again = house.collect(*said, *house.messages(1)[:3])
    assert dict(+again.counts) == {"answered before": len(said) + 2, "taken": 1}
    assert len(house.answers.answers_of(house.places[0])) == len(said)


def test_the_first_of_two_answers_to_a_page_stays(house: House) -> None:
    first, *_ = house.messages(0)
    no = message(house.places[0].token, "another", "consent", {"agrees": False})
    assert dict(+house.collect(first, no).counts) == {"taken": 1, "answered before": 1}
    assert house.ended() == [(1, None)]


def test_a_check_that_was_not_passed_leads_back(house: House) -> None:
    token, said = house.places[0].token, house.messages(0)
    way = [*said[:3], message(token, "x", "comprehension", {"choices": [0]})]
    way.append(message(token, "y", "instructions", {}, attempt=2))
    early = message(token, "z", "demographics", {"choices": [None, None]}, attempt=2)
    became = house.collect(*way, early, message(token, "w", "comprehension", {"choices": [0]}, attempt=2))
    assert became.counts["taken"] == 6
    assert became.refused == {6: "the page to answer is comprehension, attempt 2"}
    assert house.ended() == [(1, "screened_out")]


def test_who_withdraws_is_deleted_wherever_they_say_it(house: House) -> None:
    said, other = house.messages(0), house.messages(1)
    house.collect(*said[:2], other[0])
    leave = {"id": "w", "place": house.places[0].token, "withdraw": True}
    became = house.collect(*said[:2], leave, said[2], other[1])
    assert (became.withdrew, dict(+became.counts)) == (1, {"of people who withdrew": 3, "taken": 1})
    assert house.ended() == [(1, "withdrawn"), (2, None)]
    assert house.answers.answers_of(house.places[0]) == []
    again = house.collect(*said[:2], leave)
    assert (again.withdrew, dict(+again.counts), again.refused) == (0, {"of people who withdrew": 2}, {})
    later = house.collect(said[0])
    assert later.refused == {1: "nobody has this place; it is of another study, or they have withdrawn"}


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b'{"id": "torn', "no JSON"),
        (b"\xff\xfe", "no JSON"),
        (b"[" * 100_000, "no JSON"),
        (b"[]", "allowed are id, place, and answer or withdraw"),
        (b'{"id": 3, "place": "x"}', "allowed are id, place, and answer or withdraw"),
        (b'{"id": "a", "place": "\\ud800"}', "allowed are id, place, and answer or withdraw"),
        (b'{"id": "a", "place": "x"}', "allowed are page, attempt, value, took_ms and hidden_ms"),
        (b'{"id": "a", "place": "x", "answer": {"page": NaN}}', "no JSON"),
        (json.dumps(message("x", "a", "consent", {})).encode(), "nobody has this place"),
    ],
)
def test_a_foreign_line_is_named(house: House, line: bytes, why: str) -> None:
    first = house.messages(0)[0]
    became = house.collect(b"", line, first)
    assert list(became.refused) == [2]
    assert became.refused[2].startswith(why)
    assert became.counts["taken"] == 1


def test_what_does_not_fit_is_named_and_may_come_again(house: House) -> None:
    first, second, *_ = house.messages(0)
    wrong = message(house.places[0].token, "v", "consent", {"agrees": "yes"})
    became = house.collect(wrong, second, first, second)
    assert became.refused == {1: "agrees does not fit", 2: "the page to answer is consent, attempt 1"}
    assert dict(+became.counts) == {"taken": 2}


def test_ten_lines_are_named(house: House) -> None:
    told = str(house.collect(*[b"?"] * 12, house.messages(0)[0])).splitlines()
    assert told[0] == "answers: 1 taken, 0 repeated, 0 answered before, 0 of people who withdrew"
    assert told[1:4] == ["people who withdrew: 0", "lines refused: 12", "  line 1: no JSON"]
    assert (len(told), told[-1]) == (14, "  and 2 more")


def test_the_command(house: House, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none.jsonl: allowed is the file of the endpoint \(No such file"):
        collect_answers(house.study.folder, tmp_path / "none.jsonl")
    path = tmp_path / "answers.jsonl"
    path.write_text("\n\n".join(map(json.dumps, house.messages(0))))
    assert collect_answers(house.study.folder, path).startswith("answers: 8 taken, 0 repeated")
    (house.study.folder / "texts/en/consent.md").write_text("# Other")
    with pytest.raises(ConfigError, match=r"consent.md changed after the first person had begun"):
        collect_answers(house.study.folder, path)
