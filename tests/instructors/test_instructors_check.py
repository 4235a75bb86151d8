"""What no instructor can work with is refused before anything is made."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from by_hand import TASK, WORDS

from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.instructors import check_instructor, stand_in
from ibe_rl.instructors.flawed import FlawedConfig
from ibe_rl.instructors.habits import HabitsConfig
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.instructors.mixed import OTHER_KINDS
from ibe_rl.instructors.recorded import LessonWriter, RecordedConfig, RecordedEpisode
from ibe_rl.storage.run_folder import LESSON
from ibe_rl.task.words import Words
from ibe_rl.types import ConfigError

ONE_GAME = CollectConfig(processes=1, envs_per_process=2)
TWO_NUMBERS = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 0), explained_band=(1.0, 1.0), explained_range=())
PEOPLE = pytest.mark.parametrize("config", [HumanConfig(), RecordedConfig(recording="a_run")], ids=lambda one: one.kind)


@pytest.mark.parametrize("config", [InstructorConfig("oracle"), InstructorConfig("silent"), FlawedConfig(wrong=0.5)])
def test_what_needs_no_person_works_everywhere(config: InstructorConfig):
    check_instructor(config, CollectConfig(processes=2, envs_per_process=1), TWO_NUMBERS)


@PEOPLE
def test_a_person_needs_a_single_process(config: InstructorConfig):
    with pytest.raises(ConfigError, match=rf"^collect\.processes=2 with instructor={config.kind}: allowed is 1, one"):
        check_instructor(config, CollectConfig(processes=2), TASK)


@PEOPLE
def test_a_person_says_one_number(config: InstructorConfig):
    expected = rf"^instructor={config.kind}: allowed is an environment whose instruction is one number"
    with pytest.raises(ConfigError, match=expected):
        check_instructor(config, ONE_GAME, TWO_NUMBERS)


@pytest.mark.parametrize("others", OTHER_KINDS)
def test_a_person_can_be_beside_anybody(others: str):
    check_instructor(HumanConfig(others=others), ONE_GAME, TASK)


def test_phrases_are_grouped_where_there_are_words_and_a_model(monkeypatch: pytest.MonkeyPatch):
    grouping = HumanConfig(group_phrases=True)
    with pytest.raises(ConfigError, match=r"^instructor\.group_phrases=true: allowed beside instructor\.words"):
        check_instructor(grouping, ONE_GAME, TASK)
    in_words = replace(TASK, phrases=Words(["left", "hold", "right"]))
    check_instructor(grouping, ONE_GAME, in_words)
    monkeypatch.setitem(sys.modules, "wordllama", None)
    with pytest.raises(ConfigError, match=r"needs wordllama; install the extra ibe_rl\[phrases\]"):
        check_instructor(grouping, ONE_GAME, in_words)


def test_a_recording_has_to_be_there_and_whole(tmp_path: Path):
    config = RecordedConfig(recording=str(tmp_path))
    with pytest.raises(ConfigError, match=rf"^instructor\.recording={tmp_path}: allowed is the folder of a run in"):
        check_instructor(config, ONE_GAME, TASK)
    LessonWriter(tmp_path / LESSON).write(RecordedEpisode(0, [[1.0]], [1], ["person"], [0]))
    check_instructor(config, ONE_GAME, TASK)
    with (tmp_path / LESSON).open("a") as stream:
        stream.write("{}\n")
    with pytest.raises(ConfigError, match=rf"{LESSON}, line 2: not an episode"):
        check_instructor(config, ONE_GAME, TASK)


def test_a_recording_of_a_resumed_run_is_refused(tmp_path: Path):
    for folder in (tmp_path, tmp_path / "replaced" / "1"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "lesson.jsonl").touch()
    with pytest.raises(ConfigError, match=r"^instructor\.recording=.*: it was resumed.* taught in one sitting"):
        check_instructor(RecordedConfig(recording=str(tmp_path)), ONE_GAME, TASK)


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        (InstructorConfig("oracle"), InstructorConfig("oracle")),
        (InstructorConfig("silent"), InstructorConfig("silent")),
        (FlawedConfig(wrong=0.3), FlawedConfig(wrong=0.3)),
        (HumanConfig(others="oracle"), HabitsConfig(run="runs/this", otherwise="oracle")),
        (HumanConfig(), HabitsConfig(run="runs/this", otherwise="silent")),
        (RecordedConfig(recording="a_run", others="silent"), HabitsConfig(run="runs/this", otherwise="silent")),
        (RecordedConfig(recording="a_run", others="habits"), HabitsConfig(run="runs/this", otherwise="silent")),
        (HabitsConfig(run="another"), HabitsConfig(run="another")),
    ],
)
def test_where_no_person_can_be_somebody_stands_in(config: InstructorConfig, expected: InstructorConfig):
    assert stand_in(config, Path("runs/this")) == expected
