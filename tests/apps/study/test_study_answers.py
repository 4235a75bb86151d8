"""Nothing is lost and nothing counts twice."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from ibe_rl.apps.study.answers import FILE, FINISHED, SCREENED_OUT, TIMED_OUT, WITHDRAWN, Answer, Answers
from ibe_rl.types import ConfigError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / FILE


@pytest.fixture
def store(path: Path):
    answers = Answers(path)
    yield answers
    answers.close()


def answer(page: str = "trial/1", attempt: int = 1, **value) -> Answer:
    return Answer(page, attempt, value or {"x": 0.5}, 1200, 0)


def test_the_first_answer_to_a_page_stays(store: Answers) -> None:
    person = store.begin(("ibe",), "hash", pilot=False)
    assert store.keep(person, answer(x=0.25))
    assert not store.keep(person, answer(x=0.75))
    assert store.keep(person, answer(attempt=2, x=1.0))
    assert [one.value["x"] for one in store.answers_of(person)] == [0.25, 1.0]


def test_a_recruited_person_takes_part_once(store: Answers) -> None:
    person = store.begin(("none",), "hash", False, "prolific", "abc", {"session": "s"})
    assert store.of_recruit("prolific", "abc") == person
    assert store.of_recruit("sona", "abc") is None
    assert store.recruit_fields(person) == {"session": "s"}
    with pytest.raises(sqlite3.IntegrityError):
        store.begin(("none",), "hash", False, "prolific", "abc")
    assert len(store.people()) == 1  # the second one left nothing


def test_secrets_cannot_be_guessed(store: Answers) -> None:
    tokens = {store.begin(("none",), "hash", False).token for _ in range(50)}
    assert len(tokens) == 50
    assert min(map(len, tokens)) == 32
    assert store.person("1") is None
    assert store.person("") is None


def test_who_withdraws_is_deleted(store: Answers, path: Path) -> None:
    person = store.begin(("none",), "hash", False, "prolific", "their-prolific-id")
    store.keep(person, answer(text="their own words"))
    store.withdraw(person)
    assert store.answers_of(person) == []
    assert store.person(person.token) is None
    assert store.of_recruit("prolific", "their-prolific-id") is None
    assert [one.ended for one in store.people()] == [WITHDRAWN]
    for part in path.parent.iterdir():
        assert b"their" not in part.read_bytes()


def test_a_place_is_given_back_and_may_be_taken_again(store: Answers) -> None:
    quick, slow = store.begin(("none",), "hash", False), store.begin(("ibe",), "hash", False)
    store.end(quick, FINISHED)
    assert store.release(60.0) == 0
    assert store.held(pilots=False) == ([("none",)], [("ibe",)])
    assert store.release(-1.0) == 1  # whoever has not answered for a minute to come
    assert store.held(pilots=False) == ([("none",)], [])
    assert [one.ended for one in store.people()] == [FINISHED, TIMED_OUT]
    store.keep(slow, answer())
    assert store.held(pilots=False)[1] == [("ibe",)]


def test_an_answer_and_the_end_that_it_brings_are_kept_together(store: Answers) -> None:
    person = store.begin(("none",), "hash", False)
    store.keep(person, answer(page="debriefing"), FINISHED)
    assert store.person(person.token).ended == FINISHED  # type: ignore[union-attr]
    assert not store.keep(person, answer(page="debriefing"), SCREENED_OUT)
    assert store.person(person.token).ended == FINISHED  # type: ignore[union-attr]


def test_recruiting_is_stopped_until_it_is_resumed(path: Path, store: Answers) -> None:
    assert store.recruiting
    store.recruiting = False
    again = Answers(path)
    assert not again.recruiting
    again.recruiting = True
    again.close()
    assert store.recruiting


def test_the_newest_page_of_each_person(store: Answers) -> None:
    first, second = store.begin(("none",), "hash", False), store.begin(("ibe",), "hash", False)
    store.keep(first, answer(page="consent"))
    assert store.newest_pages() == {first.number: "consent"}
    assert second.number not in store.newest_pages()


def test_how_somebody_left_is_noted_once(store: Answers) -> None:
    person = store.begin(("none",), "hash", False)
    store.end(person, SCREENED_OUT)
    store.end(person, FINISHED)
    assert [one.ended for one in store.people()] == [SCREENED_OUT]


def test_pilots_are_apart(store: Answers) -> None:
    store.begin(("none",), "hash", pilot=True)
    assert not store.begun()
    assert store.people() == []
    assert len(store.people(pilots=True)) == 1
    assert store.held(pilots=False) == ([], [])
    assert store.held(pilots=True) == ([], [("none",)])
    store.begin(("none",), "hash", pilot=False)
    assert store.begun()


def test_an_answer_outlives_the_program_that_is_killed(path: Path) -> None:
    script = (
        "import os, signal, sys\nfrom pathlib import Path\n"
        "from ibe_rl.apps.study.answers import Answer, Answers\n"
        "store = Answers(Path(sys.argv[1])); person = store.begin(('ibe',), 'hash', False)\n"
        "[store.keep(person, Answer(f'trial/{n}', 1, {'n': n}, 1, 0)) for n in range(20)]\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    ended = subprocess.run([sys.executable, "-c", script, str(path)], env={**os.environ}, timeout=120, check=False)
    assert ended.returncode == -signal.SIGKILL
    store = Answers(path)
    assert sorted(one.value["n"] for one in store.answers_of(store.people()[0])) == list(range(20))
    store.close()


def test_another_file_is_refused(path: Path) -> None:
    path.write_text("these are notes, and no answers at all" * 40)
    with pytest.raises(ConfigError, match="allowed is the file that holds a study's answers"):
        Answers(path)
