"""Who instructs, and what of it counts at which step."""

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ibe_rl.apps.teach.messages import CountAs, HandOver, Message, Name, Pause, Press, Release, Sit, Speed, Typed, Wrong
from ibe_rl.apps.teach.session import (
    ACCEPTED,
    HELD,
    NOBODY,
    ORACLE,
    PAST,
    PERSON,
    REPEATED,
    UNKNOWN_VALUE,
    WATCHING,
    Said,
    TeachingSession,
)
from ibe_rl.task.words import Words

VALUES = (-1.0, 0.0, 1.0)
ANN, BOB = 1, 2


def desk(hold_steps: int | None = 0) -> TeachingSession:
    made = TeachingSession(VALUES, hold_steps, 1.0)
    made.join(ANN)
    made.begin(0)
    return made


def taken(at: TeachingSession, steps: int) -> list[float | None]:
    return [at.take().value for _ in range(steps)]


def test_a_press_counts_at_each_step_until_it_is_released():
    at = desk()
    assert at.take() == Said(None, NOBODY, 0)
    assert at.hear(ANN, Press(1, 0, -1.0)) == ACCEPTED
    assert [at.take(), at.take()] == [Said(-1.0, PERSON, 1)] * 2
    assert at.hear(ANN, Release(2, 0)) == ACCEPTED
    assert at.take() == Said(None, NOBODY, 2)


def test_a_tap_between_two_steps_counts_at_one():
    at = desk()
    at.hear(ANN, Press(1, 0, 1.0))
    at.hear(ANN, Release(2, 0))
    assert taken(at, 3) == [1.0, None, None]


def test_of_two_presses_between_two_steps_the_later_counts():
    at = desk()
    at.hear(ANN, Press(1, 0, 1.0))
    at.hear(ANN, Press(2, 0, 0.0))
    assert at.take() == Said(0.0, PERSON, 2)


def test_straight_down_is_not_silence():
    at = desk()
    at.hear(ANN, Press(1, 0, 0.0))
    assert at.take() == Said(0.0, PERSON, 1)


@pytest.mark.parametrize(("hold_steps", "then"), [(0, [None] * 4), (2, [1.0, 1.0, None, None]), (None, [1.0] * 4)])
def test_what_was_said_holds_on_for_so_long(hold_steps: int | None, then: list[float | None]):
    at = desk(hold_steps)
    at.hear(ANN, Press(1, 0, 1.0))
    assert at.take().by == PERSON
    at.hear(ANN, Release(2, 0))
    said = [at.take() for _ in range(4)]
    assert [one.value for one in said] == then
    assert [one.by for one in said] == [NOBODY if value is None else HELD for value in then]
    at.begin(1)
    assert taken(at, 2) == [None, None]


def test_a_press_about_the_episode_before_does_not_count_in_the_next():
    at = desk()
    at.hear(ANN, Press(1, 0, 1.0))
    at.begin(1)
    assert at.take() == Said(None, NOBODY, 1)
    assert at.hear(ANN, Press(2, 0, -1.0)) == PAST
    assert at.take() == Said(None, NOBODY, 2)
    assert at.hear(ANN, Press(3, 1, -1.0)) == ACCEPTED
    assert at.take() == Said(-1.0, PERSON, 3)


def test_a_message_that_comes_twice_counts_once():
    at = desk()
    assert at.hear(ANN, Press(1, 0, 1.0)) == ACCEPTED
    assert at.hear(ANN, Release(2, 0)) == ACCEPTED
    assert at.hear(ANN, Press(1, 0, 1.0)) == REPEATED
    assert at.hear(ANN, Press(2, 0, 1.0)) == REPEATED
    assert taken(at, 2) == [1.0, None]


def test_only_the_environments_values_can_be_said():
    at = desk()
    assert at.hear(ANN, Press(1, 0, 0.5)) == UNKNOWN_VALUE
    assert at.hear(ANN, Press(1, 0, 1.0)) == ACCEPTED


def test_the_first_page_instructs_and_the_others_watch():
    at = desk()
    at.join(BOB)
    assert at.chair == ANN
    for message in (Press(1, 0, 1.0), Pause(True), Speed(None), HandOver(True), Sit()):
        assert at.hear(BOB, message) == WATCHING
    assert at.take() == Said(None, NOBODY, 0)
    assert not at.controls.paused


def test_the_chair_of_a_page_that_leaves_is_free_and_what_it_pressed_released():
    at = desk(hold_steps=None)
    at.join(BOB)
    at.hear(ANN, Press(1, 0, 1.0))
    at.hear(ANN, Pause(True))
    assert at.take().value == 1.0
    at.leave(ANN)
    assert at.chair is None
    assert not at.controls.paused
    assert at.take() == Said(None, NOBODY, 0)
    assert at.hear(ANN, Sit()) == WATCHING
    assert at.hear(BOB, Sit()) == ACCEPTED
    assert at.hear(BOB, Press(1, 0, -1.0)) == ACCEPTED
    assert at.take() == Said(-1.0, PERSON, 1)


def test_whoever_comes_to_an_empty_chair_sits_down():
    at = desk()
    at.leave(ANN)
    at.join(BOB)
    assert at.chair == BOB
    at.leave(ANN)
    assert at.chair == BOB


def test_handed_over_the_oracle_speaks_and_what_was_said_before_is_forgotten():
    at = desk(hold_steps=None)
    at.hear(ANN, Press(1, 0, 1.0))
    at.take()
    at.hear(ANN, Release(2, 0))
    at.hear(ANN, HandOver(True))
    assert at.take() == Said(None, ORACLE, 2)
    at.hear(ANN, HandOver(False))
    assert at.take() == Said(None, NOBODY, 2)


def test_each_control_leaves_the_others():
    at = desk()
    for message in (Pause(True), Speed(None), HandOver(True)):
        assert at.hear(ANN, message) == ACCEPTED
    assert (at.controls.paused, at.controls.speed, at.controls.oracle) == (True, None, True)
    at.hear(ANN, Pause(False))
    assert (at.controls.paused, at.controls.speed, at.controls.oracle) == (False, None, True)


def test_a_control_wakes_who_waits():
    at = desk()
    woken = threading.Event()

    def wait() -> None:
        with at.changed:
            ready.set()
            at.changed.wait(60)
        woken.set()

    ready = threading.Event()
    threading.Thread(target=wait, daemon=True).start()
    assert ready.wait(60)
    at.hear(ANN, Speed(2.0))
    assert woken.wait(60)


def test_a_word_is_said_by_its_name_and_keeps_its_slot_when_it_is_renamed():
    at = TeachingSession((), 0, 1.0, Words(["links", "rechts"], 3))
    at.join(ANN)
    at.begin(0)
    assert at.hear(ANN, Press(1, 0, "Rechts")) == ACCEPTED
    assert at.hear(ANN, Name(1, "derecha")) == ACCEPTED
    assert at.take() == Said(1, PERSON, 1)
    assert at.hear(ANN, Press(2, 0, "rechts")) == at.hear(ANN, Press(3, 0, 1.0)) == UNKNOWN_VALUE
    assert at.hear(ANN, Name(2, "faster")) == ACCEPTED
    assert at.hear(ANN, Press(4, 0, "faster")) == ACCEPTED
    assert taken(at, 1) == [2]
    assert at.hear(ANN, Name(3, "slower")).startswith("word 'slower': all 3 places are taken")
    assert at.hear(BOB, Name(0, "left")) == WATCHING
    assert at.words is not None
    assert at.words.names == ("links", "derecha", "faster")


def test_a_typed_text_says_the_most_similar_word_until_it_is_corrected():
    at = TeachingSession((), 0, 1.0, Words(["left", "right"], 3), lambda text, _: 0 if "left" in text else None)
    at.join(ANN)
    at.begin(0)
    assert at.hear(ANN, Typed("more left")) == at.hear(ANN, Press(1, 0, "More left")) == ACCEPTED
    assert taken(at, 1) == [0]
    assert at.hear(ANN, CountAs("more left", 1)) == at.hear(ANN, Press(2, 0, "more left")) == ACCEPTED
    assert taken(at, 1) == [1]
    assert at.hear(ANN, CountAs("more left", 2)) == at.hear(ANN, Press(3, 0, "more left")) == ACCEPTED
    assert taken(at, 1) == [2]
    assert at.words is not None
    assert [one.phrases for one in at.words.entries] == [()] * 3
    assert at.hear(ANN, Typed("up")).startswith("word 'up': all 3 places are taken")
    assert at.hear(ANN, CountAs("right", 0)).startswith("phrase 'right': it is a word itself")


def test_without_groups_a_typed_text_is_a_word():
    at = TeachingSession((), 0, 1.0, Words(["left"], 3))
    at.join(ANN)
    assert at.hear(ANN, Typed("go left")) == ACCEPTED
    assert at.words is not None
    assert at.words.names == ("left", "go left")


def test_numbers_have_no_names():
    at = desk()
    assert at.hear(ANN, Typed("left")) == "instructions are numbers here, and have no names"
    assert at.hear(ANN, Name(0, "left")) == "instructions are numbers here, and have no names"
    assert at.hear(ANN, Press(1, 0, "left")) == UNKNOWN_VALUE


def test_each_mark_is_heard_at_one_step_and_not_long_after():
    at = desk()
    at.begin(20)
    assert [at.hear(ANN, Wrong(episode, 7)) for episode in (20, 19, 19, 10, 9, 21)] == [ACCEPTED] * 4 + [PAST] * 2
    assert [at.take().wrong for _ in range(4)] == [Wrong(20, 7), Wrong(19, 7), Wrong(10, 7), None]
    at.hear(ANN, Wrong(10, 7))
    at.begin(21)
    assert at.take().wrong is None


def test_whoever_waits_for_a_teacher_is_called_once():
    at, called = TeachingSession(VALUES, 0, 1.0), []
    at.when_seated(lambda: called.append(1))
    assert called == []
    at.join(ANN)
    at.join(BOB)
    at.leave(ANN)
    at.hear(BOB, Sit())
    assert called == [1]
    at.when_seated(lambda: called.append(2))
    assert called == [1, 2]


STEP, BEGIN, SEE, TWICE = "step", "begin", "see", "twice"
ACTS = st.lists(
    st.sampled_from([*VALUES, None, STEP, STEP, STEP, BEGIN, SEE, TWICE]).map(lambda act: (ANN, act))
    | st.sampled_from([1.0, None, SEE]).map(lambda act: (BOB, act)),
    max_size=60,
)
"""Who does what: says a value or releases it (None), sees the newest episode, sends the last message once more."""


class Account:
    """The plainest account of a lesson: all that came about the episode since the step before, in order."""

    def __init__(self) -> None:
        self.desk = desk()
        self.desk.join(BOB)
        self.episode = 0
        self.seen, self.sequence = {ANN: 0, BOB: 0}, {ANN: 0, BOB: 0}
        self.came: list[float | None] = [None]  # the first is what was down at the step before
        self.newest: Message | None = None

    def step(self, _: int) -> None:
        pressed = [value for value in self.came[1:] if value is not None]
        meant = pressed[-1] if pressed else self.came[-1]
        assert self.desk.take() == Said(meant, NOBODY if meant is None else PERSON, self.sequence[ANN])
        self.came = self.came[-1:]

    def begin(self, _: int) -> None:
        self.episode += 1
        self.desk.begin(self.episode)
        self.came = [None]

    def see(self, who: int) -> None:
        self.seen[who] = self.episode

    def twice(self, who: int) -> None:
        if self.newest is not None:
            assert self.desk.hear(who, self.newest) == REPEATED

    def say(self, who: int, value: float | None) -> None:
        self.sequence[who] += 1
        about = self.sequence[who], self.seen[who]
        message: Message = Release(*about) if value is None else Press(*about, value)
        became = self.desk.hear(who, message)
        if who == BOB:
            assert became == WATCHING
            return
        self.newest = message
        assert became == (ACCEPTED if self.seen[who] == self.episode else PAST)
        if became == ACCEPTED:
            self.came.append(value)


@settings(max_examples=300)
@given(ACTS)
def test_whatever_happens_each_instruction_counts_for_its_episode_and_once(acts: list[tuple[int, float | str | None]]):
    account = Account()
    for who, act in acts:
        if isinstance(act, str):
            getattr(account, act)(who)
        else:
            account.say(who, act)
