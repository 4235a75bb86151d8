"""A person's session on disk, one line of JSON per episode, and the instructor that replays it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.config.limits import MISSING
from ibe_rl.config.settings import CollectConfig
from ibe_rl.instructors.mixed import MixedConfig, MixedInstructor, beside_others, check_mixed, habits_stand_in
from ibe_rl.instructors.taught import MARKED_BEFORE, NOT_TAUGHT, SPEAKERS, Told, told_of
from ibe_rl.storage.run_folder import LESSON, REPLACED, WORD_LIST
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError

LAST_STEP = 2**31 - 1
NO_EPISODE = "not an episode with instructions, given, by and heard"


@dataclass(frozen=True)
class RecordedEpisode:
    """The instructions of an episode.

    Attributes:
        episode: number, from 0.
        instructions: ``d`` numbers per step, 0 in silence.
        given: per step 1, or 0 in silence.
        by: per step one of ``SPEAKERS``.
        heard: per step the page's number of the newest key press or release that took effect.
        marks: explanations that the person calls wrong: step of this episode at which that was heard, episode and step
            of the explanation.
        words: per step the word that was said, None in silence; empty where instructions are numbers.
    """

    episode: int
    instructions: Sequence[Sequence[float]]
    given: Sequence[int]
    by: Sequence[str]
    heard: Sequence[int]
    marks: Sequence[Sequence[int]] = field(default_factory=list)
    words: Sequence[str | None] = field(default_factory=list)


class LessonWriter:
    """Appends episodes to a file as they end.

    Args:
        path: a new file.
    """

    def __init__(self, path: Path):
        self._path = path

    def write(self, episode: RecordedEpisode) -> None:
        """Append an episode."""
        with self._path.open("a") as stream:
            stream.write(json.dumps(asdict(episode)) + "\n")


def read_lesson(path: Path, instruction_size: int) -> list[RecordedEpisode]:
    """Read a session; a last line that a killed run left incomplete is skipped.

    Raises:
        ConfigError: if the file cannot be read, or a line is not an episode.
    """
    try:
        lines = path.read_text().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: allowed is the record of a person's session ({error})") from None
    return [_episode(line, number, instruction_size, path) for number, line in enumerate(lines[:-1])]


def _episode(line: str, number: int, size: int, path: Path) -> RecordedEpisode:
    try:
        episode = RecordedEpisode(**json.loads(line))
        wrong = _wrong(episode, number, size) or _wrong_marks(episode, number)
    except (ValueError, TypeError, RecursionError):
        wrong = NO_EPISODE
    if wrong:
        raise ConfigError(f"{path}, line {number + 1}: {wrong}; allowed is what a person's session has left")
    return episode


def _wrong(episode: RecordedEpisode, number: int, size: int) -> str | None:
    """What is wrong with an episode, or None; may raise TypeError for values of other types."""
    columns = (episode.instructions, episode.given, episode.by, episode.heard)
    if {type(column) for column in columns} != {list}:
        return NO_EPISODE
    if type(episode.episode) is not int or episode.episode != number:
        return f"episode {episode.episode} instead of {number}"
    if len({len(column) for column in columns}) > 1:
        return "not the same number of steps of everything"
    if not all(len(one) == size and all(map(_in_range, one)) for one in episode.instructions):
        return f"an instruction is not {size} number(s) from -1 to 1"
    if not all(type(one) is int and one in (0, 1) for one in episode.given):
        return "given is neither 0 nor 1"
    if any(any(said) and not given for said, given in zip(episode.instructions, episode.given, strict=True)):
        return "an instruction in silence"
    if not set(episode.by) <= set(SPEAKERS) or not all(type(one) is int for one in episode.heard):
        return f"by is not one of {', '.join(SPEAKERS)}, or heard not a number"
    return None


def _wrong_marks(recorded: RecordedEpisode, number: int) -> str | None:
    """What is wrong with the marks and words of an episode, or None; may raise TypeError."""
    marks, steps = recorded.marks, len(recorded.by)
    if len(recorded.words) not in (0, steps) or not all(one is None or type(one) is str for one in recorded.words):
        return "words are not one for each step, or null"
    whole = all(len(one) == 3 and all(type(part) is int for part in one) for one in marks)
    fits = whole and all(
        0 <= at < steps and max(0, number - MARKED_BEFORE) <= episode <= number and 0 <= step <= LAST_STEP
        for at, episode, step in marks
    )
    return None if fits else f"marks are not [step, this episode or one of {MARKED_BEFORE} before, step of it]"


def _in_range(value: Any) -> bool:
    return type(value) in (int, float) and -1 <= value <= 1


@dataclass
class RecordedConfig(MixedConfig):
    """Replays a person's session in the first environment; see ``ibe_rl.instructors.human``."""

    kind: str = "recorded"
    recording: str = MISSING  # folder of the run in which the person taught


class Recorded:
    """Replays a session: the same instruction at the same step of the same episode, silence beyond its end.

    Args:
        episodes: of the session.
        instruction_size: d.

    Attributes:
        told: see ``ibe_rl.instructors.mixed.Teacher``.
    """

    kind, settings, resumable = "recorded", RecordedConfig, False
    stand_in = staticmethod(habits_stand_in)

    def __init__(self, episodes: Sequence[RecordedEpisode], instruction_size: int):
        self._said = [_table(one, instruction_size) for one in episodes]
        self._told = [_told(one) for one in episodes]
        self._episode, self._step, self._silence = -1, 0, np.zeros((1, instruction_size + 1), np.float32)
        self.told = NOT_TAUGHT

    @classmethod
    def make(cls, config: RecordedConfig, task: Task, seed: int) -> MixedInstructor:  # noqa: ARG003 - it draws nothing
        """See ``ibe_rl.instructors``."""
        return beside_others(cls(_lesson(config, task), task.instruction_size), config, task)

    @staticmethod
    def check(config: RecordedConfig, collect: CollectConfig, task: Task) -> None:
        """See ``check_mixed``; also reads the recording."""
        check_mixed(config, collect, task)
        _lesson(config, task)

    def reset(self, rows: Array) -> None:
        """Continue with the next episode."""
        if rows[0]:
            self._episode, self._step = self._episode + 1, 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        said = self._silence
        if rows[0]:
            recorded = self._said[self._episode] if 0 <= self._episode < len(self._said) else self._silence[:0]
            told = self._told[self._episode] if 0 <= self._episode < len(self._said) else []
            self.told = told[self._step] if self._step < len(told) else told_of("nobody")
            said, self._step = recorded[self._step : self._step + 1], self._step + 1
        said = said if len(said) else self._silence
        return said[:, :-1].copy(), said[:, -1:].copy()


def _table(episode: RecordedEpisode, size: int) -> Array:
    instructions = np.array(episode.instructions, np.float32).reshape(-1, size)
    return np.column_stack([instructions, np.array(episode.given, np.float32)]).astype(np.float32)


def _told(episode: RecordedEpisode) -> list[Told]:
    """Who spoke at each step, and what they marked."""
    marks = {at: (episode.episode - about + 1, step) for at, about, step in episode.marks}
    return [told_of(by, marks.get(step, (0, 0))) for step, by in enumerate(episode.by)]


def _lesson(config: RecordedConfig, task: Task) -> list[RecordedEpisode]:
    path = Path(config.recording) / LESSON
    if not path.is_file():
        raise ConfigError(
            f"instructor.recording={config.recording}: allowed is the folder of a run in which a person taught "
            f"(it has no {LESSON})"
        )
    if any(path.parent.glob(f"{REPLACED}/*/{LESSON}")):
        raise ConfigError(
            f"instructor.recording={config.recording}: it was resumed, so its episodes are not those of one session; "
            f"allowed is a run that was taught in one sitting"
        )
    if task.words is None and (path.parent / WORD_LIST).exists():
        raise ConfigError(
            f"instructor.recording={config.recording}: this session was taught in words; allowed are its "
            f"instructor.words and instructor.max_words ({path.parent / WORD_LIST})"
        )
    return read_lesson(path, task.instruction_size)
