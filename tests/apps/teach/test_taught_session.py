"""Ten episodes instructed by the keyboard, in a browser: what was sent is what the agent was trained on."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browsers import browsing
from pages import SMALL, opened, taught
from processes import call

from ibe_rl.instructors.recorded import RecordedEpisode, read_lesson
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import LESSON, TRAJECTORIES

EPISODES = 10
KEYS = ("ArrowLeft", "ArrowRight", "ArrowDown")


@dataclass
class Session:
    """A session that has ended: its folder, what the page sent, and what the training printed."""

    folder: Path
    sent: list[dict[str, Any]]
    printed: str


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Keys held for a while, short taps, and silence, at four times real time."""
    folder = tmp_path_factory.mktemp("session") / "run"
    chance = np.random.default_rng(0)
    with taught(folder, "instructor.speed=4", "refresh_every_frames=1000") as training, browsing() as browser:
        page = opened(browser, training.address)
        while page.evaluate("lesson.now.frame.episode") < EPISODES:
            key = str(chance.choice(KEYS))
            page.keyboard.down(key)
            time.sleep(chance.choice([0.0, 0.05, 0.2]))
            page.keyboard.up(key)
            time.sleep(chance.choice([0.0, 0.02, 0.1]))
        sent = page.evaluate("lesson.sent")
        printed = training.stop()
    return Session(folder, sent, printed)


@pytest.fixture(scope="module")
def lesson(session: Session) -> list[RecordedEpisode]:
    return read_lesson(session.folder / LESSON, 1)


def meant(sent: Sequence[dict[str, Any]], episode: int, before: int, heard: int) -> float | None:
    """What a step says after the messages up to number ``heard`` have come, those up to ``before`` a step earlier."""
    about = [one for one in sent if one["episode"] == episode and one["sequence"] <= heard]
    new = [one["value"] for one in about if one["sequence"] > before and one["kind"] == "press"]
    if new:
        return new[-1]
    return about[-1].get("value") if about else None


def test_every_step_says_what_the_page_had_sent(session: Session, lesson: list[RecordedEpisode]):
    steps = spoken = before = 0
    for episode in lesson:
        for step, heard in enumerate(episode.heard):
            said = episode.instructions[step][0] if episode.given[step] else None
            assert said == meant(session.sent, episode.episode, before, heard)
            before, steps, spoken = heard, steps + 1, spoken + (said is not None)
    assert len(lesson) > EPISODES
    assert 0.2 < spoken / steps < 0.95
    assert {"press", "release"} == {one["kind"] for one in session.sent}
    assert {one["value"] for one in session.sent if one["kind"] == "press"} == {-1, 0, 1}


def test_it_is_trained_on_exactly_that(session: Session, lesson: list[RecordedEpisode]):
    """The record has one step more where time was up: nobody acted in the state after the last action."""
    log = TrajectoryLog.open(session.folder / TRAJECTORIES)
    episodes = log.read(range(len(log.index)))
    assert len(episodes) >= EPISODES
    for rolled_out, said in zip(episodes, lesson, strict=False):
        assert 0 <= len(said.given) - len(rolled_out) <= 1
        instructions = np.array(said.instructions, np.float32)[: len(rolled_out)]
        np.testing.assert_array_equal(rolled_out.instructions, instructions)
        np.testing.assert_array_equal(rolled_out.given, np.array(said.given, bool)[: len(rolled_out)])


def test_it_ends_in_order(session: Session):
    assert "stopping in order" in session.printed
    assert "Traceback" not in session.printed
    assert (session.folder / "summary.json").is_file()


def test_the_record_teaches_the_same_agent_once_more(session: Session, tmp_path: Path):
    frames = TrajectoryLog.open(session.folder / TRAJECTORIES).frames
    overrides = [one for one in SMALL if one != "instructor=human"]
    again = [f"instructor.recording={session.folder}", f"stop_after_frames={frames}", f"run_dir={tmp_path / 'again'}"]
    call("train", *overrides, "instructor=recorded", "refresh_every_frames=1000", *again)
    logs = [TrajectoryLog.open(folder / TRAJECTORIES) for folder in (session.folder, tmp_path / "again")]
    for first, second in zip(*(log.read(range(len(log.index))) for log in logs), strict=True):
        np.testing.assert_array_equal(first.states, second.states)
        np.testing.assert_array_equal(first.actions, second.actions)
        np.testing.assert_array_equal(first.instructions, second.instructions)
    weights = [torch.load(newest(folder), weights_only=True) for folder in (session.folder, tmp_path / "again")]
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])


def newest(folder: Path) -> Path:
    return sorted((folder / "checkpoints").glob("policy_*"))[-1]
