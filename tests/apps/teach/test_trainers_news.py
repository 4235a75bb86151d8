"""What the trainer tells the pages of a lesson, and what it waits for before it begins."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from by_hand import STEPS, add
from by_hand import TASK as LIFT
from on_stage import Told, begun, explainer_state, greedy, make_classroom

from ibe_rl.apps.teach.classroom import Classroom
from ibe_rl.envs import LANDER_TASK
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task.words import Words
from ibe_rl.vocabulary.listener import Refreshed


class Page(Told):
    """Instead of the link: a page that opens after so many looks."""

    def __init__(self, opens_after: float = math.inf) -> None:
        super().__init__()
        self._left = opens_after
        self.looks = 0

    def wait_for(self, line: str, timeout_s: float) -> bool:
        assert (line, timeout_s <= 0.2) == ("seated", True)
        self.looks += 1
        return self.looks > self._left

    def close(self) -> None:
        pass


@pytest.fixture
def enter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Classroom]:
    """Makes the trainer's end, with something else in place of the link."""

    def make(link: Told, **settings: Any) -> Classroom:
        made = make_classroom(tmp_path, **settings)
        made.close()
        monkeypatch.setattr(made, "_link", link)
        return made

    return make


def waits(trainer: Classroom, stops_after: float = math.inf) -> list[str]:
    """What is said while it waits."""
    said: list[str] = []
    asked = iter(range(10**9))
    trainer.wait_for_teacher(lambda: next(asked) >= stops_after, said.append)
    return said


def test_training_waits_for_the_first_page(enter: Callable[..., Classroom]):
    page = Page(opens_after=3)
    first, last = waits(enter(page))
    assert page.looks == 4
    assert "600 s at most; instructor.wait_for_teacher=false" in first
    assert last == "the teacher is there, training begins"


def test_nothing_is_said_where_the_teacher_is_there_already(enter: Callable[..., Classroom]):
    assert waits(enter(Page(opens_after=0))) == []


def test_it_does_not_wait_if_asked_not_to(enter: Callable[..., Classroom]):
    page = Page()
    assert (waits(enter(page, wait_for_teacher=False)), page.looks) == ([], 0)


def test_it_begins_without_a_teacher_when_time_is_up(enter: Callable[..., Classroom]):
    assert waits(enter(Page(), wait_at_most_s=0.0))[1].startswith("nobody has come in 0 s: training begins without")


def test_it_waits_as_long_as_it_takes_and_until_it_is_asked_to_stop(enter: Callable[..., Classroom]):
    page = Page()
    [first] = waits(enter(page, wait_at_most_s=None), stops_after=5)
    assert page.looks == 6
    assert "at most" not in first


def test_before_the_first_vocabulary_it_says_what_it_waits_for(enter: Callable[..., Classroom], tmp_path: Path):
    link, log = Told(), TrajectoryLog(tmp_path / "trajectories", 10_000, LIFT.contexts)
    add(log, 1.0, 1.0)
    begun(enter(link), greedy(), log).batch(128, {"frames": 128})
    assert link.newest["understood"].endswith("once I have seen 100 episodes; so far 1.")
    enter(link).skipped(128, "too few words")
    assert link.newest["understood"] == "I cannot learn your words now: too few words."


def test_the_words_of_the_page_are_those_of_the_run(enter: Callable[..., Classroom], tmp_path: Path):
    """Those of the run folder when a run goes on, the frame of those that are added, and all of them on disk."""
    log = TrajectoryLog(tmp_path / "trajectories", 10_000, LIFT.contexts)
    add(log, 1.0, 1.0)
    worded = [replace(LANDER_TASK, phrases=Words(["left", "hold"], 4)) for _ in range(3)]
    trainer = begun(enter(Told(), task=worded[0]), greedy(), log, worded[1])
    named = Words(["left", "hold"], 4)
    named.rename(0, "לשמאל")
    named.add("faster")
    trainer._name_words(named.to_dicts())
    assert worded[1].words is not None
    assert worded[1].words.names == ("לשמאל", "hold", "faster")
    saved = json.loads((tmp_path / "words.json").read_text())
    assert [(one["added_at_frame"], list(one["renamed_from"])) for one in saved] == [
        (0, ["left"]),
        (0, []),
        (STEPS, []),
    ]
    begun(enter(Told(), task=worded[2]), greedy(), log, worded[2])
    assert worded[2].words is not None
    assert worded[2].words.names == ("לשמאל", "hold", "faster")


def test_what_was_learnt_is_told_again_in_the_new_words(enter: Callable[..., Classroom], tmp_path: Path):
    link, worded = Told(), replace(LANDER_TASK, phrases=Words(["left", "hold", "right"]))
    trainer = begun(enter(link, task=worded), greedy(), TrajectoryLog(tmp_path / "log", 10_000, ("a",)), worded)
    mapping = replace(explainer_state().mapping, expressions=np.eye(3), mean_instructions=np.eye(3))
    refresh: Any = SimpleNamespace(standing=mapping, delays={}, windows_by_instruction={}, word_notices=[])
    said, nothing = replace(explainer_state(), mapping=mapping, words=worded.phrases), cast(Any, None)
    trainer.refreshed(Refreshed(9, 1, refresh, nothing, [], [], said, came_true=1.0))
    phrases = [one["phrase"] for one in link.newest["vocabulary"]["clusters"]]
    named = Words(["left", "hold", "right"])
    named.rename(2, "rechts")
    trainer._name_words(named.to_dicts())
    renamed = [one["phrase"] for one in link.newest["vocabulary"]["clusters"]]
    assert renamed == [one.replace("right", "rechts") for one in phrases] != phrases
    assert "'rechts'" in link.newest["understood"]


def test_the_farewell_sums_up_what_the_person_said(enter: Callable[..., Classroom], tmp_path: Path):
    class Gone(Told):
        def wait_for(self, line: str, _timeout_s: float) -> bool:
            return line == "bye"

    link = Gone()
    trainer = enter(link)
    trainer.farewell()  # nothing has begun
    assert link.newest["farewell"] == {"text": "Training has ended.", "summary": None}
    log = TrajectoryLog(tmp_path / "trajectories", 10_000, LANDER_TASK.contexts)
    begun(trainer, greedy(), log).farewell()
    assert link.newest["farewell"]["summary"]["understood"] == "I have not learnt a vocabulary."
