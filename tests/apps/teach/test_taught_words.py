"""Taught by keyboard in a browser with words that are swapped, then renamed: the agent speaks as its teacher does."""

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from browsers import browsing
from pages import opened, taught, until
from playwright.sync_api import Page
from processes import call
from sklearn.metrics import roc_auc_score

from ibe_rl.envs.lander_task import X
from ibe_rl.evaluation.runs import open_trained
from ibe_rl.instructors.recorded import read_lesson
from ibe_rl.instructors.taught import taught_episodes, taught_rows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import LESSON, TRAJECTORIES

SWAPPED, FOREIGN = ("right", "hold", "left"), ("по-лево", "hold", "يمين")
"""What the teacher calls a movement to the left, hardly any, and one to the right; and later."""
HORIZON_STEPS = 20
SETTINGS = (
    *("instructor.words=[right,hold,left]", "instructor.max_words=4", "instructor.speed=3"),
    "instructor.group_phrases=true",
    *(
        f"mapping.horizon_steps={HORIZON_STEPS}",
        "mapping.spans_steps=[]",
        "mapping.top_fraction=1.0",
        "first_refresh_episodes=30",
    ),
    *("refresh_every_frames=1000", "total_frames=1_000_000"),
)
MOVES = """(() => {
  const last = trail.slice(-8);
  return last.length < 8 ? 0 : (last.at(-1)[0] - last[0][0]) / now.scene.size[0];
})()"""
LISTEN = """() => {
  const before = hear.explanation;
  lesson.heard = [];
  hear.explanation = (one) => { lesson.heard.push(one.said); before(one); };
}"""
EPISODES_AHEAD = 20
LEARNT = "lesson.now.vocabulary !== null && lesson.heard.length > 12 && performance.now() - outcomeAt < 300"


def taught_so_far(folder: Path) -> list[str]:
    """The record of each episode so far."""
    return (folder / LESSON).read_text().splitlines()


def teach(page: Page, until_true: str, enough: Callable[[], bool] = lambda: True, seconds: float = 240.0) -> None:
    """Call each movement as it is seen: key 1 to the left, key 3 to the right, key 2 in between."""
    held, end = None, time.monotonic() + seconds
    while not (page.evaluate(until_true) and enough()):
        assert time.monotonic() < end, f"not in {seconds} s: {until_true}"
        moved = page.evaluate(MOVES)
        key = "1" if moved < -0.01 else "3" if moved > 0.01 else "2"
        if key != held:
            if held:
                page.keyboard.up(held)
            page.keyboard.down(key)
            held = key
    if held:
        page.keyboard.up(held)


@pytest.fixture(scope="module")
def lesson(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, set[str], set[str]]:
    """The folder of the run, and what the agent said before and after the words were renamed."""
    folder = tmp_path_factory.mktemp("words") / "run"
    with taught(folder, *SETTINGS) as training, browsing() as browser:
        page = opened(browser, training.address)
        page.evaluate(LISTEN)
        teach(page, LEARNT)
        page.evaluate("() => document.getElementById('wrong').click()")
        marked = len(taught_so_far(folder))
        before = set(page.evaluate("lesson.heard"))
        page.fill("#typed", "hold it")
        page.keyboard.press("Enter")
        until(page, "lesson.now.words.phrases[1].length === 1")
        page.click("#naming summary")
        for slot, word in enumerate(FOREIGN):
            page.fill(f"#names input:nth-child({slot + 1})", word)
            page.keyboard.press("Enter")
            until(page, f"lesson.now.words.words[{slot}] === '{word}'")
        page.locator("#names input").first.blur()
        page.evaluate("() => { lesson.heard = []; }")
        # the game is ahead of the trainer, whose log loses these episodes when it stops
        teach(page, "lesson.heard.length > 8", lambda: len(taught_so_far(folder)) > marked + EPISODES_AHEAD)
        after = set(page.evaluate("lesson.heard.slice(3)"))
        training.stop()
        until(page, "lesson.now.summary !== null")
        assert page.locator("#summary").is_visible()
    return folder, before, after


def test_the_agent_calls_a_movement_what_its_teacher_calls_it(lesson: tuple[Path, set[str], set[str]]):
    """Of movements that happened: it may recognise one by velocities or angles, which a made-up change of x lacks."""
    folder, _, _ = lesson
    run = open_trained(str(folder))
    log = TrajectoryLog.open(folder / TRAJECTORIES)
    states = [episode.states for episode in log.read(range(len(log.index)))]
    changes = np.concatenate([each[HORIZON_STEPS:] - each[:-HORIZON_STEPS] for each in states])
    sideways = changes[np.abs(changes[:, X]) > 0.05]
    said = run.mapping.express(sideways)
    assert roc_auc_score(sideways[:, X] > 0, said[:, 2] - said[:, 0]) > 0.8


def test_it_speaks_in_these_words_only_and_at_once_in_the_new_ones(lesson: tuple[Path, set[str], set[str]]):
    _, before, after = lesson
    for said, words, others in ((before, SWAPPED, FOREIGN[::2]), (after, FOREIGN, SWAPPED[::2])):
        assert said
        assert all(any(word in one for word in words) or one.startswith("I ") for one in said), said
        assert not any(word in one for word in others for one in said), said


def test_the_words_and_the_mark_are_logged(lesson: tuple[Path, set[str], set[str]]):
    folder, _, _ = lesson
    words = json.loads((folder / "words.json").read_text())
    assert [one["word"] for one in words] == list(FOREIGN)
    assert words[0]["renamed_from"] == ["right"]
    assert [one["phrases"] for one in words] == [[], ["hold it"], []]
    recorded = read_lesson(folder / LESSON, 4)
    said = {word for one in recorded for word in one.words}
    assert {*SWAPPED, *FOREIGN[::2]} <= said
    assert sum(len(one.marks) for one in recorded) == 1
    log = TrajectoryLog.open(folder / TRAJECTORIES)
    assert taught_episodes(log, taught_rows(log).tolist())[1] == 1  # as the vocabulary hears of it
    instructions = np.concatenate([one.instructions for one in log.read(range(len(log.index)))])
    assert instructions.shape[1] == 4
    assert set(instructions.sum(axis=1)) <= {0.0, 1.0}
    assert "по-лево" in (folder / "lesson.html").read_text()


def test_it_is_explained_with_the_habits_of_its_teacher(
    lesson: tuple[Path, set[str], set[str]], capsys: pytest.CaptureFixture[str]
):
    folder, _, _ = lesson
    call("explain", f"run={folder}", "viewer=off")
    printed = capsys.readouterr().out
    assert "The instructions (m*) are the habits of the person who taught, from " in printed
    assert "falling" not in printed  # the designer's word


def test_a_run_that_goes_on_keeps_its_words(lesson: tuple[Path, set[str], set[str]], tmp_path: Path):
    folder = tmp_path / "run"
    shutil.copytree(lesson[0], folder)
    before = json.loads((folder / "summary.json").read_text())["frames"]
    settings = folder / ".hydra" / "config.yaml"
    settings.write_text(settings.read_text().replace("wait_for_teacher: true", "wait_for_teacher: false"))
    call("train", f"resume={folder}", f"stop_after_frames={before + 256}")
    assert json.loads((folder / "summary.json").read_text())["frames"] == before + 256
    assert [one["word"] for one in json.loads((folder / "words.json").read_text())] == list(FOREIGN)
    log = TrajectoryLog.open(folder / TRAJECTORIES)
    assert len(taught_rows(log)) == len(log.index)  # all of them, of one environment
