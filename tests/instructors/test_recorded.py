"""A session on disk: it comes back as it was, and whatever else stands in the file is refused."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ibe_rl.envs import LANDER_TASK
from ibe_rl.instructors import make_instructor
from ibe_rl.instructors.recorded import LessonWriter, Recorded, RecordedConfig, RecordedEpisode, read_lesson
from ibe_rl.storage.run_folder import LESSON
from ibe_rl.types import ConfigError

FIRST = RecordedEpisode(0, [[0.0], [1.0], [-0.25]], [0, 1, 1], ["nobody", "person", "held"], [0, 3, 3])
SECOND = RecordedEpisode(1, [[-1.0], [0.0]], [1, 1], ["oracle", "person"], [4, 5])
GOOD: dict[str, Any] = {"episode": 0, "instructions": [[1.0]], "given": [1], "by": ["person"], "heard": [0]}
ONE, SILENT_ONE = np.ones((1, 9), np.float32), (0.0, 0.0)


def write(path: Path, *episodes: RecordedEpisode) -> Path:
    writer = LessonWriter(path)
    for episode in episodes:
        writer.write(episode)
    return path


def test_a_session_comes_back_as_it_was(tmp_path: Path):
    path = write(tmp_path / "lesson.jsonl", FIRST, SECOND)
    assert read_lesson(path, 1) == [FIRST, SECOND]


def test_each_episode_is_on_the_disk_before_the_next(tmp_path: Path):
    path = write(tmp_path / "lesson.jsonl", FIRST)
    assert read_lesson(path, 1) == [FIRST]
    write(path, SECOND)
    assert read_lesson(path, 1) == [FIRST, SECOND]


def test_an_instruction_can_have_several_numbers(tmp_path: Path):
    both = RecordedEpisode(0, [[1.0, -1.0], [0.0, 0.5]], [1, 1], ["person", "held"], [1, 1])
    path = write(tmp_path / "lesson.jsonl", both)
    assert read_lesson(path, 2) == [both]
    with pytest.raises(ConfigError, match=r"an instruction is not 1 number\(s\)"):
        read_lesson(path, 1)


def test_a_last_line_that_was_cut_off_is_left_out(tmp_path: Path):
    path = write(tmp_path / "lesson.jsonl", FIRST, SECOND)
    whole = path.read_text()
    second_starts = whole.index("\n") + 1
    for end in range(second_starts, len(whole)):  # wherever it was cut; without its newline it may not be all
        path.write_text(whole[:end])
        assert read_lesson(path, 1) == [FIRST]
    path.write_text("")
    assert read_lesson(path, 1) == []


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"episode": 1}, "episode 1 instead of 0"),
        ({"episode": False}, "episode False instead of 0"),
        ({"episode": 0.0}, r"episode 0\.0 instead of 0"),
        ({"given": []}, "not the same number of steps of everything"),
        ({"by": ["person", "person"]}, "not the same number of steps of everything"),
        ({"heard": []}, "not the same number of steps of everything"),
        ({"instructions": [[1.0, 1.0]]}, r"an instruction is not 1 number\(s\) from -1 to 1"),
        ({"instructions": [[]]}, "an instruction is not 1 number"),
        ({"instructions": [[1.01]]}, "an instruction is not 1 number"),
        ({"instructions": [[-(10**400)]]}, "an instruction is not 1 number"),
        ({"instructions": [[float("nan")]]}, "an instruction is not 1 number"),
        ({"instructions": [[float("-inf")]]}, "an instruction is not 1 number"),
        ({"instructions": [[True]]}, "an instruction is not 1 number"),
        ({"instructions": [["1"]]}, "an instruction is not 1 number"),
        ({"instructions": ["1"]}, "an instruction is not 1 number"),
        ({"instructions": [1.0]}, "not an episode with instructions, given, by and heard"),
        ({"given": [2]}, "given is neither 0 nor 1"),
        ({"given": [True]}, "given is neither 0 nor 1"),
        ({"given": [0]}, "an instruction in silence"),
        ({"by": ["teacher"]}, "by is not one of person, held, oracle, nobody, or heard not a number"),
        ({"heard": ["1"]}, ".* or heard not a number"),
        ({"heard": [1.5]}, ".* or heard not a number"),
        ({"by": [["person"]]}, "not an episode with instructions, given, by and heard"),
        ({"by": {"person": 1}}, "not an episode with instructions, given, by and heard"),
        ({"heard": 7}, "not an episode with instructions, given, by and heard"),
        ({"instructions": "", "given": "", "by": "", "heard": ""}, "not an episode"),
        ({"instructions": {}, "given": [], "by": [], "heard": []}, "not an episode"),
        ({"colour": "red"}, "not an episode with instructions, given, by and heard"),
    ],
)
def test_what_no_session_has_left_is_refused(changed: dict[str, Any], expected: str, tmp_path: Path):
    path = tmp_path / "lesson.jsonl"
    path.write_text(json.dumps(GOOD | changed) + "\n")
    with pytest.raises(ConfigError, match=rf"lesson\.jsonl, line 1: {expected}.*; allowed is what a person's session"):
        read_lesson(path, 1)


@pytest.mark.parametrize("line", ["", "null", "[]", "3", "{}", "{", "person", "[" * 100_000, '{"episode": 0}'])
def test_a_line_that_is_no_episode_is_refused_with_its_number(line: str, tmp_path: Path):
    path = write(tmp_path / "lesson.jsonl", FIRST)
    with path.open("a") as stream:
        stream.write(line + "\n")
    with pytest.raises(ConfigError, match=r"lesson\.jsonl, line 2: not an episode with instructions"):
        read_lesson(path, 1)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path):
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\n")
    for name in ("bytes", "missing", "."):
        with pytest.raises(ConfigError, match=rf"{tmp_path}.*: allowed is the record of a person's session \("):
            read_lesson(tmp_path / name, 1)


def test_a_folder_without_a_session_is_refused(tmp_path: Path):
    with pytest.raises(ConfigError, match=rf"instructor\.recording={tmp_path}: allowed is .* \(it has no {LESSON}\)"):
        make_instructor(RecordedConfig(recording=str(tmp_path)), LANDER_TASK)


def said(recorded: Recorded, asked: bool = True) -> tuple[float, float]:
    instruction, given = recorded.instruct(ONE, np.array([asked]))
    assert (instruction.shape, given.shape, instruction.dtype, given.dtype) == ((1, 1), (1, 1), np.float32, np.float32)
    return float(instruction[0, 0]), float(given[0, 0])


def begin(recorded: Recorded, whether: bool = True) -> None:
    recorded.reset(np.array([whether]))


def test_a_session_is_repeated_step_by_step_and_then_there_is_silence():
    recorded = Recorded([FIRST, SECOND], 1)
    assert said(recorded) == SILENT_ONE  # nothing has begun
    begin(recorded)
    assert [said(recorded) for _ in range(5)] == [(0, 0), (1, 1), (-0.25, 1), SILENT_ONE, SILENT_ONE]
    begin(recorded, False)
    assert said(recorded) == SILENT_ONE
    begin(recorded)
    assert [said(recorded) for _ in range(3)] == [(-1, 1), (0, 1), SILENT_ONE]
    begin(recorded)
    assert [said(recorded) for _ in range(3)] == [SILENT_ONE] * 3


def test_an_episode_that_ends_sooner_does_not_shift_the_next():
    recorded = Recorded([FIRST, SECOND], 1)
    begin(recorded)
    said(recorded)
    begin(recorded)
    assert said(recorded) == (-1, 1)


def test_who_is_not_asked_hears_nothing_of_it():
    recorded = Recorded([FIRST], 1)
    begin(recorded)
    assert [said(recorded, asked) for asked in (True, False, False, True, True)][-2:] == [(1, 1), (-0.25, 1)]


def test_what_was_said_can_be_changed_by_whoever_heard_it():
    for episodes in ([SECOND], []):
        recorded = Recorded(episodes, 1)
        begin(recorded)
        for array in recorded.instruct(ONE, np.array([True])):
            array[:] = 7
        recorded._episode = -1
        begin(recorded)
        assert said(recorded) in ((-1, 1), SILENT_ONE)


def test_an_episode_without_a_step_is_one():
    recorded = Recorded([RecordedEpisode(0, [], [], [], []), SECOND], 1)
    begin(recorded)
    assert said(recorded) == SILENT_ONE
    begin(recorded)
    assert said(recorded) == (-1, 1)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(["person", 0, 1]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=6,
)
ALMOST = st.fixed_dictionaries(
    {
        "episode": st.just(0) | VALUES,
        "instructions": st.lists(st.lists(st.sampled_from([0, 1, -1.0, 0.5]), max_size=2), max_size=2) | VALUES,
        "given": st.lists(st.sampled_from([0, 1]), max_size=2) | VALUES,
        "by": st.lists(st.sampled_from(["person", "nobody"]), max_size=2) | VALUES,
        "heard": st.lists(st.integers(), max_size=2) | VALUES,
    }
)


def read_and_repeat(path: Path) -> None:
    """Either it is refused, or it can be repeated to its end; no other error passes."""
    episodes: list[RecordedEpisode] = []
    with suppress(ConfigError):
        episodes = read_lesson(path, 1)
    recorded = Recorded(episodes, 1)
    for episode in episodes:
        begin(recorded)
        for _ in range(len(episode.instructions) + 1):
            assert abs(said(recorded)[0]) <= said(recorded)[1] <= 1


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz") / "lesson.jsonl"


@settings(deadline=None, max_examples=300)
@given(text=st.text() | st.text().map(lambda text: text + "\n"), raw=st.binary())
@example(text="\r\n", raw=b"\xed\xa0\x80\n")
def test_any_text_is_refused_or_is_a_session(file: Path, text: str, raw: bytes):
    for content in (text.encode("utf-8", "surrogatepass"), raw):
        file.write_bytes(content)
        read_and_repeat(file)


@pytest.mark.slow
@settings(deadline=None, max_examples=500)
@given(fields=ALMOST)
@example(fields={"episode": 0, "instructions": "", "given": "", "by": "", "heard": ""})
@example(fields={"episode": 0, "instructions": [[10**400]], "given": [1], "by": ["person"], "heard": [0]})
def test_anything_like_an_episode_is_refused_or_can_be_repeated(file: Path, fields: dict[str, Any]):
    file.write_text(json.dumps(fields) + "\n")
    read_and_repeat(file)
