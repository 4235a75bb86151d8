"""Kinds of instructor over any environment's rule."""

from __future__ import annotations

from pathlib import Path

from ibe_rl.config.settings import CollectConfig, FlawedConfig, HumanConfig, InstructorConfig, RecordedConfig
from ibe_rl.instructors.cloned import Habits
from ibe_rl.instructors.flawed import Flawed, corrupted
from ibe_rl.instructors.mixed import Beside
from ibe_rl.instructors.recorded import LessonWriter, Recorded, RecordedEpisode, read_lesson
from ibe_rl.instructors.rule import Oracle, Silent
from ibe_rl.storage.run_folder import LESSON, REPLACED
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Instructor


def make_instructor(
    config: InstructorConfig, task: Task, seed: int = 0, person: Instructor | None = None
) -> Instructor:
    """Make the instructor that ``config`` asks for.

    Args:
        config: one of the kinds.
        task: of the environment.
        seed: of the draws of those that draw.
        person: who instructs the first environment, for the kind "human".

    Raises:
        ConfigError: for an unknown kind, or a recording that cannot be read.
    """
    if isinstance(config, FlawedConfig):
        return Flawed(Oracle(task.rule), task.instruction_values, config, seed)
    if isinstance(config, RecordedConfig):
        return Beside(Recorded(_lesson(config, task), task.instruction_size), _others(config.others, task))
    if isinstance(config, HumanConfig) and person is not None:
        return Beside(person, _others(config.others, task))
    return _others(config.kind, task)


def _others(kind: str, task: Task) -> Instructor:
    if kind == "oracle":
        return Oracle(task.rule)
    if kind == "silent":
        return Silent(task.instruction_size)
    if kind == "habits":
        return Habits(task.instruction_size)
    raise ConfigError(f"instructor.kind={kind}: allowed is one of oracle, silent, flawed, recorded, human")


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
    return read_lesson(path, task.instruction_size)


def check_instructor(config: InstructorConfig, collect: CollectConfig, task: Task) -> None:
    """Refuse, before anything is made, an instructor that could not work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not isinstance(config, HumanConfig | RecordedConfig):
        return
    if collect.processes != 1:
        raise ConfigError(
            f"collect.processes={collect.processes} with instructor={config.kind}: allowed is 1, one game is watched"
        )
    if collect.engine == "ray":
        raise ConfigError(f"collect.engine=ray with instructor={config.kind}: allowed is processes, on this machine")
    if task.instruction_size != 1:
        raise ConfigError(f"instructor={config.kind}: allowed is an environment whose instruction is one number")
    if config.others == "habits" and collect.envs_per_process == 1:
        raise ConfigError("instructor.others=habits with collect.envs_per_process=1: allowed is more than 1")
    if isinstance(config, RecordedConfig):
        _lesson(config, task)


def stand_in(config: InstructorConfig) -> InstructorConfig:
    """Who instructs where no person can be: in evaluations, and in whatever is flown after the training."""
    if isinstance(config, HumanConfig | RecordedConfig):
        return InstructorConfig("silent" if config.others == "silent" else "oracle")
    return config


__all__ = [
    "Beside",
    "Flawed",
    "Habits",
    "LessonWriter",
    "Oracle",
    "Recorded",
    "RecordedEpisode",
    "Silent",
    "check_instructor",
    "corrupted",
    "make_instructor",
    "read_lesson",
    "stand_in",
]
