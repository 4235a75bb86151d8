"""The trainer's end of the lesson, and the whole of it from the trainer to a page and back."""

from __future__ import annotations

import json
import pickle
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import numpy as np
import pytest
from clients import Client, eventually
from on_stage import Told, begun, explainer_state, greedy, make_classroom, make_lander

from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.apps.teach import classroom
from ibe_rl.apps.teach.classroom import (
    PORT,
    Classroom,
    choose_port,
    open_classroom,
    page_invitation,
)
from ibe_rl.apps.teach.lesson import Lesson, Stage
from ibe_rl.apps.teach.lesson_plan import LessonPlan
from ibe_rl.apps.teach.understanding import vocabulary
from ibe_rl.config.settings import CollectConfig, EnvConfig, PredictorConfig, TrainConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.ibe import ClusterMapping, Meaning
from ibe_rl.ibe.delay import Delay
from ibe_rl.ibe.meaning_lines import NOT_INFERRED
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.instructors.recorded import read_lesson
from ibe_rl.runtime.ports import HOST, free_port
from ibe_rl.types import CANNOT_TELL, ConfigError
from ibe_rl.vocabulary.listener import Refreshed

# ---- where it is


def test_a_port_that_was_asked_for_is_taken_or_refused():
    free = free_port(0, 0)
    assert choose_port(HumanConfig(port=free)) == free
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=rf"instructor.port={port}: taken, allowed is a free port"):
            choose_port(HumanConfig(port=port))


def test_where_the_usual_port_is_taken_another_one_is_chosen(monkeypatch: pytest.MonkeyPatch):
    with socket.create_server((HOST, 0)) as taken:
        usual = taken.getsockname()[1]
        monkeypatch.setattr(classroom, "PORT", usual)
        port = choose_port(HumanConfig())
        assert port not in (None, usual)
    assert choose_port(HumanConfig()) == usual


@pytest.mark.parametrize("host", ["192.0.2.1", "no.such.host.invalid", "a b", ""])
def test_a_host_that_this_machine_has_not_is_refused(host: str):
    with pytest.raises(ConfigError, match=f"instructor.host={host}: allowed is an address of this machine"):
        choose_port(HumanConfig(host=host))


def test_the_invitation():
    assert page_invitation(HOST, PORT) == f"teach it here: http://127.0.0.1:{PORT}/"
    assert page_invitation("localhost", 1) == "teach it here: http://localhost:1/"  # as asked for
    assert page_invitation("localhost", 1, moved=True).splitlines() == [
        "teach it here: http://localhost:1/",
        f"  port {PORT} is taken, so this is on 1",
    ]
    for host, shown in (("0.0.0.0", "0.0.0.0"), ("::", "[::]")):  # noqa: S104 - that is what is warned of
        first, warning = page_invitation(host, PORT).splitlines()
        assert first == f"teach it here: http://{shown}:{PORT}/"
        assert warning.startswith(f"  warning: instructor.host={host}: whoever can reach this port can instruct")
    assert page_invitation("::1", PORT) == f"teach it here: http://[::1]:{PORT}/"


# ---- what pages are told


def test_the_vocabulary_as_a_page_shows_it():
    shown = json.loads(json.dumps(vocabulary(2_000, explainer_state(), LANDER_TASK), allow_nan=False))
    assert (shown["frame"], shown["horizon_steps"]) == (2_000, 5)
    first = shown["clusters"][0]
    assert first.keys() == {"id", "expression", "mean_instruction", "phrase", "share", "colour", "known"}
    assert [one["expression"] for one in shown["clusters"]] == [-1, 0, 1]
    assert [one["share"] for one in shown["clusters"]] == pytest.approx([1 / 3] * 3)
    assert len({one["phrase"] for one in shown["clusters"]}) == 3
    assert np.shape([one["colour"] for one in shown["clusters"]]) == (3, 3)
    assert shown["meaning"] == [NOT_INFERRED]


def test_the_vocabulary_has_no_word_without_a_known_meaning():
    known = explainer_state().mapping
    assert isinstance(known, ClusterMapping)
    one_way = replace(known, meanings=(Meaning(positive=False, reason="nobody did it"),))
    shown = vocabulary(2_000, replace(explainer_state(), mapping=one_way), LANDER_TASK)
    assert [one["known"] for one in shown["clusters"]] == [True, True, False]
    assert shown["clusters"][2]["phrase"] == CANNOT_TELL
    assert shown["meaning"][0].endswith("nobody did it, but I cannot tell what “falling to the right” means")


def learnt(frames: int) -> Refreshed:
    """A refresh, as far as a page hears of it."""
    said, nothing = explainer_state(), cast(Any, None)
    late = {"person": Delay(22, 18, 25)}
    refresh: Any = SimpleNamespace(standing=said.mapping, delays=late, word_notices=[])
    refresh.windows_by_instruction = {"+1": 200, "-1": 3}
    return Refreshed(frames, 1, refresh, nothing, [], [], said, came_true=1.0)


def test_a_page_is_told_only_what_is_a_number(trainer: Classroom, monkeypatch: pytest.MonkeyPatch):
    link = Told()
    monkeypatch.setattr(trainer, "_link", link)
    row = {"frames": 128, "train/success_rate": float("nan"), "train/loss": float("inf"), "ibe/skipped": 1.0}
    begun(trainer, greedy()).batch(128, row)
    assert link.newest["figures"] == {"frames": 128, "skipped": 1.0, "curve": []}
    for frames in range(1, 1_001):
        trainer.batch(frames, {"frames": frames, "train/success_rate": 0.5})
    curve = link.newest["figures"]["curve"]
    assert 150 < len(curve) <= 400
    assert curve[0] == (1, 0.5)


def test_what_the_settings_ask_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    env = make_lander()
    cfg = TrainConfig(instructor=HumanConfig(hold_steps=3))
    cfg.env, cfg.collect, cfg.agent, cfg.predictor = EnvConfig(), CollectConfig(), DQNConfig(), PredictorConfig()
    cfg.env.id = LANDER_ID
    made = open_classroom(cfg, env, PORT, tmp_path, "http://there")
    made.close()
    assert isinstance(made.open_lesson, LessonPlan)
    assert made.open_lesson.about["live_view"] == "http://there"
    assert (made.open_lesson.hold_steps, made.open_lesson.record) == (3, tmp_path / "lesson.jsonl")
    assert capsys.readouterr().out.startswith("teach it here: ")


# ---- the whole of it


@pytest.fixture
def trainer(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Iterator[Classroom]:
    made = make_classroom(tmp_path)
    yield made
    made.close()
    for game in Game.playing:
        game.end()
    Game.playing.clear()
    ours = ("classroom", "link", "link lines")
    assert eventually(lambda: not any(one.name in ours for one in threading.enumerate()))
    assert capfd.readouterr().err == ""


class Game:
    """The process that plays: steps the first game in a thread until it is asked to end."""

    playing: ClassVar[list[Game]] = []

    def __init__(self, trainer: Classroom):
        plan = pickle.loads(pickle.dumps(trainer.open_lesson))  # noqa: S301 - our own
        games: list[Any] = [make_lander(), make_lander()]
        self.lesson: Lesson = plan(games)
        assert isinstance(games[0], Stage)
        assert not isinstance(games[1], Stage)
        self.port, self.steps, self._over = plan.port, 0, threading.Event()
        self._env = make_vector_env(games[:1], self.lesson, seed=3)
        self._thread = threading.Thread(target=self._play)
        self._thread.start()
        self.playing.append(self)

    def _play(self) -> None:
        while not self._over.is_set():
            self._env.rollout(20, break_when_any_done=False)
            self.steps += 1

    def paused(self) -> Client:
        """A page that has stopped it after a step or more."""
        page = Client(self.port)
        page.until("frame", lambda frame: frame["step"] > 0)
        page.say("pause", on=True)
        page.until("controls", lambda controls: controls["paused"])
        return page

    def goes_on(self) -> bool:
        """Whether it steps, in a while."""
        before = self.steps
        return eventually(lambda: self.steps > before + 1)

    def stands(self) -> bool:
        """Whether it ends up making no more steps."""
        return eventually(self._stands)

    def _stands(self) -> bool:
        before = self.steps
        time.sleep(0.3)
        return self.steps == before

    def end(self) -> None:
        self._over.set()
        self._thread.join(60)
        assert not self._thread.is_alive()


def test_a_page_teaches_and_hears_what_has_been_learnt(trainer: Classroom, tmp_path: Path):
    game = Game(trainer)
    page = Client(game.port)
    about = page.until("about")
    assert (about["name"], about["values"]) == ("lander", [-1.0, 0.0, 1.0])
    heard = None
    for sequence in range(1, 200):  # episodes may end in between
        episode = page.until("frame")["episode"]
        page.say("press", sequence=sequence, episode=episode, value=1.0)
        heard = page.until("frame", lambda frame, sequence=sequence: frame["heard"] == sequence)
        if heard["by"] == "person":
            break
    assert heard is not None
    assert heard["instruction"] == 1.0
    begun(trainer, greedy(4)).batch(128, {"frames": 128, "train/success_rate": 0.25})
    trainer.refreshed(learnt(128))
    assert page.until("figures")["success_rate"] == 0.25
    vocabulary_shown = page.until("vocabulary")
    assert (vocabulary_shown["frame"], vocabulary_shown["delay"]["steps"]) == (128, 22)
    assert "I have not heard '-1' in good episodes yet. You are about 22" in page.until("understood")["text"]
    assert len(page.until("explanation")["path"]) == 6
    trainer.hurry()
    trainer.farewell()
    assert page.until("farewell")["text"] == "Training has ended."
    assert page.closing()[0] == 1001
    game.end()
    episodes = read_lesson(tmp_path / "lesson.jsonl", 1)
    assert any("person" in one.by and [1.0] in one.instructions for one in episodes)


def test_hurry_makes_a_paused_lesson_go_on(trainer: Classroom):
    game = Game(trainer)
    game.paused()
    assert game.stands()
    trainer.hurry()
    assert game.goes_on()
    game.end()
    trainer.farewell()


def test_a_trainer_that_has_gone_leaves_no_game_that_waits(trainer: Classroom, tmp_path: Path):
    game = Game(trainer)
    page = game.paused()
    assert game.stands()
    trainer.close()
    assert page.until("farewell")["text"] == "The training process has ended."
    assert game.goes_on()
    game.end()
    assert read_lesson(tmp_path / "lesson.jsonl", 1)


def test_a_game_that_has_gone_does_not_keep_the_trainer_long(trainer: Classroom, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(classroom, "FAREWELL_S", 0.2)
    begun(trainer, greedy()).batch(1, {"frames": 1.0})
    start = time.monotonic()
    trainer.farewell()
    assert 0.2 <= time.monotonic() - start < 30
    trainer.close()


def test_a_port_that_is_taken_meanwhile(trainer: Classroom):
    assert isinstance(trainer.open_lesson, LessonPlan)
    with socket.create_server((HOST, trainer.open_lesson.port)), pytest.raises(OSError, match="address already in use"):
        Game(trainer)


def test_the_farewell_ends_a_lesson_whose_pages_do_not_answer(trainer: Classroom, monkeypatch: pytest.MonkeyPatch):
    """The game says goodbye: the trainer does not wait as long as it would without."""
    monkeypatch.setattr(classroom, "FAREWELL_S", 60.0)
    game = Game(trainer)
    pages = [Client(game.port, max_queue=1) for _ in range(3)]
    assert eventually(lambda: game.steps > 20)
    trainer.hurry()
    start = time.monotonic()
    trainer.farewell()
    assert time.monotonic() - start < 30
    assert len(pages) == 3
