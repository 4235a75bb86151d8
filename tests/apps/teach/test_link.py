"""The link between the trainer and the game: newest values only, and neither side ever waits for the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client
from typing import Any

import pytest
from view_data import eventually

from ibe_rl.apps.teach.link import Address, GameEnd, TrainerEnd


@pytest.fixture(autouse=True)
def threads(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Nothing runs on when both ends have been closed, and nothing has been printed."""
    before = set(threading.enumerate())
    yield
    assert eventually(lambda: set(threading.enumerate()) <= before), threading.enumerate()
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def trainer() -> Iterator[TrainerEnd]:
    made = TrainerEnd()
    yield made
    made.close()


class Game:
    """What the game's side hears, in the order in which it does."""

    def __init__(self, address: Address):
        self.heard: list[tuple[str, Any]] = []
        self.lost = threading.Event()
        self.go_on = threading.Event()
        hear = {kind: self._hearer(kind) for kind in ("first", "second", "wait")}
        self.end = GameEnd(address, hear, self.lost.set)

    def _hearer(self, kind: str) -> Any:
        def hear(value: Any) -> None:
            self.heard.append((kind, value))
            if kind == "wait":
                self.go_on.wait(120)

        return hear


def test_what_is_sent_arrives(trainer: TrainerEnd):
    game = Game(trainer.address)
    trainer.tell("first", {"a": [1, 2]})
    assert eventually(lambda: game.heard == [("first", {"a": [1, 2]})])


def test_before_the_other_side_is_there_the_newest_of_each_kind_waits_in_the_order_of_the_kinds(trainer: TrainerEnd):
    for number in range(1_000):
        trainer.tell("second", number)
        trainer.tell("first", -number)
    game = Game(trainer.address)
    assert eventually(lambda: game.heard == [("second", 999), ("first", -999)])


def test_a_slow_other_side_gets_the_newest_and_holds_nobody_up(trainer: TrainerEnd):
    game = Game(trainer.address)
    trainer.tell("wait", None)
    assert eventually(lambda: game.heard)
    start = time.monotonic()
    for number in range(2_000):
        trainer.tell("first", (number, b"x" * 10_000))
    assert time.monotonic() - start < 60
    assert len(trainer._newest) <= 1
    game.go_on.set()
    assert eventually(lambda: game.heard[-1][1] is not None and game.heard[-1][1][0] == 1_999)
    numbers = [value[0] for kind, value in game.heard if kind == "first"]
    assert numbers == sorted(set(numbers))
    assert len(numbers) < 100, "what fits into the pipe and no more"


def test_wait_for_returns_when_it_has_been_said_and_not_before(trainer: TrainerEnd):
    game = Game(trainer.address)
    game.end.say("something else")
    assert not trainer.wait_for("bye", 0.05)
    threading.Timer(0.1, lambda: game.end.say("bye")).start()
    assert trainer.wait_for("bye", 60)
    assert trainer.wait_for("bye", 0)


def test_the_other_side_never_comes():
    trainer = TrainerEnd()
    trainer.tell("first", 1)
    start = time.monotonic()
    assert not trainer.wait_for("bye", 0.05)
    trainer.close()
    assert time.monotonic() - start < 30


def test_what_was_sent_before_the_end_arrives_and_then_the_loss():
    trainer = TrainerEnd()
    game = Game(trainer.address)
    trainer.tell("first", 1)
    trainer.close()
    assert game.lost.wait(60)
    assert game.heard in ([("first", 1)], [])
    for _ in range(3):
        game.end.say("to nobody")
    trainer.close()
    trainer.tell("first", 2)


def test_the_game_has_gone(trainer: TrainerEnd):
    connection = Client(trainer.address.path, authkey=trainer.address.key)
    connection.close()
    for number in range(100):
        trainer.tell("first", number)
        time.sleep(0.001)
    assert not trainer.wait_for("bye", 0.05)
    trainer.close()


def test_who_has_not_the_key_is_refused_and_keeps_nobody_out(trainer: TrainerEnd):
    for key in (b"another", bytes(32)):
        with pytest.raises(AuthenticationError):
            GameEnd(Address(trainer.address.path, key), {}, lambda: None)
    Client(trainer.address.path).close()
    stranger = Client(trainer.address.path)
    stranger.send({"first": "garbage"})
    stranger.close()
    game = Game(trainer.address)
    trainer.tell("first", 1)
    assert eventually(lambda: game.heard == [("first", 1)])


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_game_that_cannot_hear_any_more_is_told_so(trainer: TrainerEnd, capfd: pytest.CaptureFixture[str]):
    """Whatever is wrong with it: it must not wait any longer for a trainer that it does not hear."""
    game = Game(trainer.address)
    trainer.tell("of no kind", 1)
    assert game.lost.wait(60)
    capfd.readouterr()
