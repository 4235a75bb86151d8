"""The lesson on the real lander: what is taken from the desk is what the agent sees and what is written down."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from on_stage import HORIZON_STEPS, Theatre, explainer_state, make_lander, speaks
from tensordict import TensorDictBase

from ibe_rl.apps.teach import lesson as module
from ibe_rl.apps.teach.lesson import FRAME_S, told
from ibe_rl.apps.teach.messages import HandOver, Name, Press, Release, Wrong
from ibe_rl.apps.teach.session import NOBODY, ORACLE, PAST, PERSON
from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.envs.lander_task import X
from ibe_rl.instructors.mixed import MixedInstructor
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.instructors.recorded import Recorded, read_lesson
from ibe_rl.instructors.taught import NOT_TAUGHT, told_of
from ibe_rl.task.words import Words
from ibe_rl.types import Array

ROW, OTHER = np.array([True]), np.array([False])


@pytest.fixture
def theatre(tmp_path: Path) -> Theatre:
    return Theatre(tmp_path)


def states(*x: float) -> Array:
    """A state ``(1, S)`` for each of the positions."""
    made = np.zeros((len(x), 1, len(LANDER_TASK.state_names)), np.float32)
    made[:, 0, X] = x
    return made


def rolled_out(theatre: Theatre, steps: int = 400) -> TensorDictBase:
    """Fly at random, through several episodes."""
    torch.manual_seed(0)
    return make_vector_env([theatre.stage], theatre.lesson, seed=3).rollout(steps, break_when_any_done=False)[0]


def written(path: Path) -> list[tuple[list[float], int, str, int]]:
    """Every step of a record."""
    episodes = read_lesson(path, 1)
    return [step for one in episodes for step in zip(one.instructions, one.given, one.by, one.heard, strict=True)]


@pytest.mark.parametrize("hold_steps", [0, 4, None])
def test_what_is_taken_is_what_the_agent_sees_and_what_is_written(tmp_path: Path, hold_steps: int | None):
    theatre, random = Theatre(tmp_path, hold_steps), np.random.default_rng(1)
    for sequence, step in enumerate(sorted(random.choice(390, 60, replace=False).tolist()), 1):
        value = float(random.choice(LANDER_TASK.instruction_values))
        episode = int(random.integers(0, 4))  # most of them are not about the episode that it is
        theatre.clock.says[step] = [random.choice([Press(sequence, episode, value), Release(sequence, episode)])]
    batch = rolled_out(theatre)
    theatre.lesson.finish()
    taken = theatre.desk.taken
    given = [one.by != "nobody" for one in taken]
    instruction = [one.value or 0.0 for one in taken]
    assert {one.by for one in taken} >= {"person", "nobody"}
    assert written(tmp_path / "lesson.jsonl") == [
        ([value], int(said), one.by, one.heard) for value, said, one in zip(instruction, given, taken, strict=True)
    ]
    seen = len(batch)  # the agent has not yet acted upon what was said last
    np.testing.assert_array_equal(batch["instruction"][:, 0], instruction[:seen])
    np.testing.assert_array_equal(batch["instruction_given"][:, 0], given[:seen])
    assert len(taken) - seen in (0, 1)
    ends = int(batch["next", "done"][:-1].sum())
    assert ends > 2
    assert len(read_lesson(tmp_path / "lesson.jsonl", 1)) == ends + 1
    assert [one["steps"] for one in theatre.pages.of("ended")] == np.diff(
        np.flatnonzero(batch["next", "done"][:, 0]), prepend=-1
    ).tolist()[:ends]


def test_a_row_that_is_not_asked_leaves_time_standing(theatre: Theatre):
    theatre.lesson.reset(ROW)
    nothing = theatre.lesson.instruct(states(0)[0], OTHER)
    assert (nothing[0].tolist(), nothing[1].tolist()) == ([[0]], [[0]])
    theatre.clock.says[0] = [Press(1, 0, -1.0)]
    for row, steps in ((OTHER, 0), (ROW, 1), (OTHER, 1), (OTHER, 1)):
        said = theatre.lesson.instruct(states(0)[0], row)
        assert theatre.clock.steps == len(theatre.desk.taken) == steps
        assert (said[0].tolist(), said[1].tolist()) == ([[-steps]], [[steps]])
    frames = len(theatre.pages.of("frame"))
    theatre.lesson.reset(OTHER)
    assert len(theatre.pages.of("scene")) == 1
    assert len(theatre.pages.of("frame")) == frames == 1


def test_the_shapes_that_are_returned(theatre: Theatre):
    theatre.lesson.reset(ROW)
    instruction, given = theatre.lesson.instruct(states(0)[0], ROW)
    assert (instruction.shape, given.shape, instruction.dtype, given.dtype) == ((1, 1), (1, 1), np.float32, np.float32)


def test_beside_others_only_the_first_waits(theatre: Theatre):
    env = make_vector_env(
        [theatre.stage, make_lander()], MixedInstructor(theatre.lesson, Oracle(LANDER_TASK.rule)), seed=3
    )
    theatre.clock.says[2] = [HandOver(True)]
    batch = env.rollout(20, break_when_any_done=False)
    assert theatre.clock.steps == 21
    np.testing.assert_array_equal(batch["instruction"][1], LANDER_TASK.rule(batch["state"][1].numpy()))
    assert batch["instruction_given"][0, :, 0].tolist() == [0, 0] + 18 * [1]


def test_handed_over_the_rule_instructs(theatre: Theatre):
    theatre.lesson.reset(ROW)
    theatre.clock.says |= {0: [HandOver(True)], 3: [HandOver(False), Press(1, 0, 1.0)]}
    places = states(-0.8, 0.8, 0.0, 0.8)
    said = [theatre.lesson.instruct(state, ROW)[0] for state in places]
    np.testing.assert_array_equal(said[:3], LANDER_TASK.rule(places[:3]))
    assert said[3].tolist() == [[1.0]]
    theatre.lesson.finish()
    assert [step[2] for step in written(theatre.record)] == [ORACLE, ORACLE, ORACLE, PERSON]
    assert len({value.item() for value in said[:3]}) > 1


def test_a_press_about_the_episode_before_is_not_applied(theatre: Theatre):
    theatre.lesson.reset(ROW)
    theatre.clock.says |= {
        0: [Press(1, 0, 1.0)],
        2: [Press(2, 0, -1.0)],  # arrives when the next episode has begun
        3: [Press(3, 1, 0.0)],
        4: [Release(4, 0)],  # of the key that was held down then
    }
    theatre.lesson.instruct(states(0)[0], ROW)
    theatre.lesson.instruct(states(0)[0], ROW)
    theatre.lesson.reset(ROW)
    given = [theatre.lesson.instruct(states(0)[0], ROW)[1].item() for _ in range(3)]
    assert given == [0, 1, 1]
    assert theatre.clock.became.count(PAST) == 2
    theatre.lesson.finish()
    first, second = read_lesson(theatre.record, 1)
    assert (first.instructions, second.instructions) == ([[1.0], [1.0]], [[0.0], [0.0], [0.0]])
    assert second.heard == [2, 3, 4]


def test_a_press_between_two_steps_counts_at_one_step(theatre: Theatre):
    theatre.lesson.reset(ROW)
    theatre.clock.says[1] = [Press(1, 0, 1.0), Release(2, 0), Press(1, 0, 1.0), Press(2, 0, 1.0)]
    said = [theatre.lesson.instruct(states(0)[0], ROW)[1].item() for _ in range(4)]
    assert said == [0, 1, 0, 0]


def test_pictures_come_no_faster_than_a_screen_shows_them(theatre: Theatre, monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    theatre.lesson.reset(ROW)
    shown = []
    for _ in range(100):
        theatre.lesson.instruct(states(0)[0], ROW)
        if len(theatre.pages.of("frame")) > len(shown):
            shown.append(now[0])
        now[0] += FRAME_S / 4.9
    assert len(shown) == pytest.approx(20, abs=1)
    assert np.diff(shown).min() >= FRAME_S
    theatre.lesson.reset(ROW)
    theatre.lesson.instruct(states(0)[0], ROW)
    assert theatre.pages.posts[-1][0] == "frame"
    assert theatre.pages.of("frame")[-1]["step"] == 0, "the first picture of an episode is always shown"


def test_a_picture_tells_what_was_said_before_it(theatre: Theatre, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "FRAME_S", 0.0)
    theatre.clock.says |= {1: [Press(5, 0, 1.0)], 2: [HandOver(True)]}
    theatre.lesson.reset(ROW)
    for x in (0.1, 0.2, 0.3, 0.9):
        theatre.lesson.instruct(states(x)[0], ROW)
    frames = theatre.pages.of("frame")
    assert [frame["step"] for frame in frames] == [0, 1, 2, 3]
    assert [frame["instruction"] for frame in frames[:3]] == [None, None, 1.0]
    assert frames[3]["instruction"] == LANDER_TASK.rule(states(0.3)[0]).item()
    assert [frame["by"] for frame in frames] == ["nobody", "nobody", "person", "oracle"]
    assert [frame["heard"] for frame in frames] == [0, 0, 5, 5]
    assert all(frame["shapes"] for frame in frames)
    json.dumps(theatre.pages.posts, allow_nan=False)


def test_the_explanation_carries_a_path(tmp_path: Path):
    speaker, _ = speaks(every_s=0.0)
    theatre = Theatre(tmp_path, speaker=speaker)
    theatre.lesson.reset(ROW)
    state, _ = theatre.stage.reset(seed=4)
    theatre.lesson.instruct(state[None], ROW)
    assert theatre.pages.of("explanation") == []
    speaker.speak_with(explainer_state())
    theatre.lesson.reset(ROW)
    theatre.lesson.instruct(state[None], ROW)
    speaker.wait()
    [said] = theatre.pages.of("explanation")
    assert np.shape(said["path"]) == (HORIZON_STEPS + 1, 2)
    assert LANDER_TASK.scene_path is not None
    np.testing.assert_allclose(said["path"][0], LANDER_TASK.scene_path(state), atol=0.01)
    assert said["episode"] == 1
    json.dumps(theatre.pages.posts, allow_nan=False)


def test_a_mark_is_written_down_and_told(theatre: Theatre):
    theatre.lesson.reset(ROW)
    assert theatre.lesson.told == NOT_TAUGHT
    theatre.clock.says |= {1: [Wrong(0, 0)], 2: [Press(1, 1, 1.0), Wrong(0, 1)]}
    told = []
    for begins in (False, False, True, False):
        if begins:
            theatre.lesson.reset(ROW)
        theatre.lesson.instruct(states(0)[0], ROW)
        told.append(theatre.lesson.told)
    assert told == [told_of(NOBODY), told_of(NOBODY, (1, 0)), told_of(PERSON, (2, 1)), told_of(PERSON)]
    theatre.lesson.finish()
    first, second = read_lesson(theatre.record, 1)
    assert (first.marks, second.marks) == ([[1, 0, 0]], [[0, 0, 1]])
    replayed = Recorded([first, second], 1)
    again = []
    for begins in (True, False, True, False):
        if begins:
            replayed.reset(ROW)
        replayed.instruct(states(0)[0], ROW)
        again.append(replayed.told)
    assert again == told


def test_words_are_said_shown_and_written_down(tmp_path: Path):
    theatre = Theatre(tmp_path, words=Words(["links", "halt"], 3))
    theatre.lesson.reset(ROW)
    theatre.clock.says |= {1: [Press(1, 0, "halt")], 2: [Name(1, "hold")], 3: [Release(2, 0)]}
    said = [theatre.lesson.instruct(states(0)[0], ROW)[0][0].tolist() for _ in range(4)]
    assert said == [[0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 0]]
    theatre.lesson.finish()
    [episode] = read_lesson(theatre.record, 3)
    assert episode.words == [None, "hold", "hold", None]
    assert told(np.array([0, 1, 0]), theatre.stage.env.task) == (1.0, "hold")
    assert told(np.zeros(3), theatre.stage.env.task) == (None, None)


def test_the_farewell_writes_the_unfinished_episode_and_nothing_comes_after_it(theatre: Theatre):
    theatre.lesson.reset(ROW)
    theatre.lesson.instruct(states(0)[0], ROW)
    assert not theatre.record.exists()
    theatre.lesson.finish()
    left = theatre.record.read_text()
    assert len(written(theatre.record)) == 1
    theatre.lesson.instruct(states(0)[0], ROW)
    theatre.lesson.reset(ROW)
    theatre.lesson.instruct(states(0)[0], ROW)
    theatre.lesson.finish()
    assert theatre.record.read_text() == left


def test_a_farewell_in_mid_flight_leaves_a_record_that_can_be_read(theatre: Theatre):
    """It comes from another thread, while the game flies what is left of a batch as fast as it goes."""

    def farewell() -> None:
        while theatre.clock.steps < 250:
            time.sleep(0)
        theatre.lesson.finish()

    goodbye = threading.Thread(target=farewell)
    goodbye.start()
    batch = rolled_out(theatre, 600)
    goodbye.join()
    episodes = read_lesson(theatre.record, 1)
    assert 250 <= sum(len(one.given) for one in episodes) <= len(batch)
