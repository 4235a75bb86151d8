"""A person instructs the first environment; the web page is ``ibe_rl.apps.teach``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import CollectConfig
from ibe_rl.instructors.mixed import (
    MixedConfig,
    MixedInstructor,
    Teacher,
    beside_others,
    check_mixed,
    habits_stand_in,
)
from ibe_rl.task import Task
from ibe_rl.types import ConfigError


@dataclass
class HumanConfig(MixedConfig):
    """A person in a browser instructs the first environment; all environments step at its pace."""

    kind: str = "human"
    hold_steps: int | None = setting(0, low=0)  # how long an instruction holds; None: until the episode ends
    speed: float | None = setting(1.0, low=0.05, high=1_000.0)  # initial, 1 is real time; None: unthrottled
    group_phrases: bool = False  # a typed text counts as the word it is most similar to (extra phrases)
    host: str = "127.0.0.1"  # address of the page; anyone who can reach it can instruct
    port: int | None = setting(None, low=1, high=65535)  # None: 8765, or a free one
    wait_for_teacher: bool = True  # training begins when the first page is open; False: at once
    wait_at_most_s: float | None = setting(
        600.0, low=0.0
    )  # then it begins without a teacher; None: as long as it takes


class Human:
    """The person at the page."""

    kind, settings, live = "human", HumanConfig, True
    stand_in = staticmethod(habits_stand_in)

    @staticmethod
    def check(config: HumanConfig, collect: CollectConfig, task: Task) -> None:
        """Refuse what ``check_mixed`` refuses, and groups of phrases without the extra, or where there are no words.

        Raises:
            ConfigError: naming the key, the value and what is allowed.
        """
        check_mixed(config, collect, task)
        asked = "instructor.group_phrases=true"
        if config.group_phrases and task.words is None:
            raise ConfigError(f"{asked}: allowed beside instructor.words, which are not set")
        if config.group_phrases and find_spec("wordllama") is None:
            raise ConfigError(f"{asked}: needs wordllama; install the extra ibe_rl[phrases]")

    @staticmethod
    def make(config: HumanConfig, task: Task, seed: int, person: Teacher | None = None) -> MixedInstructor:  # noqa: ARG004 - it draws nothing
        """See ``ibe_rl.instructors``.

        Raises:
            ConfigError: if there is no person.
        """
        if person is None:
            raise ConfigError("instructor=human: nobody teaches here; allowed is any other instructor")
        return beside_others(person, config, task)
