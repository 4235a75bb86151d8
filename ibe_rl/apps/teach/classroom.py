"""The trainer's end of the lesson: where it is served, and what the trainer sends to its pages."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium

from ibe_rl.agents import Agent, make_agent
from ibe_rl.apps.teach.lesson_plan import BYE, SEATED, WORDS_NAMED, LessonPlan
from ibe_rl.apps.teach.link import TrainerEnd
from ibe_rl.apps.teach.live_explainer import weights_of
from ibe_rl.apps.teach.understanding import lateness_message, lesson_summary, not_yet, understanding_line, vocabulary
from ibe_rl.collect.collector import OpenLesson
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.envs.worded import has_rule
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.predict.simulator import Simulator
from ibe_rl.runtime.ports import HOST, asked_port, free_port
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import LESSON
from ibe_rl.task import Task
from ibe_rl.task.words import Words
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.listener import Listener, Refreshed
from ibe_rl.vocabulary.words import save_words, words_of

PORT = 8765
FAREWELL_S = 3.0


class Classroom(Listener):
    """Sends the trainer's events to the lesson without blocking; only ``farewell`` waits a moment.

    Args:
        config: settings of the page.
        port: port that the page is served on.
        record: the file of all instructions.
        task: the environment's task.
        make_agent: see ``LessonPlan``.
        make_predictor: see ``LessonPlan``.
        about: see ``LessonPlan``.
    """

    def __init__(
        self,
        config: HumanConfig,
        port: int,
        record: Path,
        task: Task,
        make_agent: Callable[[], Agent],
        make_predictor: Callable[[], Any],
        about: Mapping[str, Any],
    ):
        self._config, self._task, self._folder = config, task, record.parent
        self._link = TrainerEnd({WORDS_NAMED: self._name_words})
        self._log: TrajectoryLog | None = None
        self._learnt: Refreshed | None = None
        self._first_refresh_episodes = 0
        self._curve: list[tuple[float, float]] = []
        self.open_lesson: OpenLesson = LessonPlan(
            host=config.host,
            port=port,
            hold_steps=config.hold_steps,
            speed=config.speed,
            group_phrases=config.group_phrases,
            address=self._link.address,
            make_agent=make_agent,
            make_predictor=make_predictor,
            record=record,
            about=about,
        )

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        named, self._task = self._task.words, run.task
        self._policy, self._log, self._first_refresh_episodes = (
            run.agent.greedy,
            run.log,
            run.cfg.first_refresh_episodes,
        )
        if named is not None and self._task.words is not None:
            self._task.words.become(words_of(self._folder, len(named)) or named)
            save_words(self._folder, self._task.words)

    def _name_words(self, words: Any) -> None:
        """Take over the words as the person has named them; later ones were added now. Runs in the link's thread."""
        own = self._task.words
        assert own is not None
        new = Words.from_dicts(words, len(own)).entries
        frame = self._log.frames if self._log else 0
        later = [replace(one, added_at_frame=frame) for one in new[len(own.names) :]]
        own.become(Words([*new[: len(own.names)], *later], len(own)))
        save_words(self._folder, own)
        if self._learnt is not None:
            self._tell_vocabulary(self._learnt)

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """Send the new weights and the training metrics."""
        self._link.tell("policy", weights_of(self._policy))
        known = {name: value for name, value in row.items() if math.isfinite(value)}
        if "train/success_rate" in known:
            self._curve.append((known["frames"], known["train/success_rate"]))
        figures = {name.partition("/")[2] or name: value for name, value in known.items()}
        self._link.tell("figures", {**figures, "curve": self._curve[:: 1 + len(self._curve) // 200]})
        if self._learnt is None and self._log is not None:
            self._link.tell("understood", not_yet(self._log.episodes_ended, self._first_refresh_episodes))

    def refreshed(self, event: Refreshed) -> None:
        """Send a new vocabulary."""
        self._link.tell("explainer", event.explainer)
        self._learnt = event
        self._tell_vocabulary(event)

    def _tell_vocabulary(self, event: Refreshed) -> None:
        """Send what has been learnt, in the words as they are called now."""
        late = lateness_message(event.refresh.delays)
        self._link.tell("vocabulary", vocabulary(event.frames, event.explainer, self._task) | {"delay": late})
        self._link.tell("understood", understanding_line(event.refresh, self._task))

    def skipped(self, frames: int, reason: str) -> None:
        """Say why there is no new vocabulary."""
        self._link.tell("understood", f"I cannot learn your words now: {reason}.")

    def wait_for_teacher(self, stop: Callable[[], bool], say: Callable[[str], None]) -> None:
        """Return when the first page is open, time is up, or ``stop`` says so."""
        if not self._config.wait_for_teacher:
            return
        limit_s = math.inf if self._config.wait_at_most_s is None else self._config.wait_at_most_s
        until, polling_s = time.monotonic() + limit_s, 0.2
        at_most = "" if math.isinf(limit_s) else f"{limit_s:g} s at most; "
        if self._link.wait_for(SEATED, min(polling_s, limit_s)):
            return
        say(f"training waits for its teacher to open the page ({at_most}instructor.wait_for_teacher=false: not at all)")
        while not stop() and time.monotonic() < until:
            if self._link.wait_for(SEATED, polling_s):
                say("the teacher is there, training begins")
                return
        if not stop():
            say(f"nobody has come in {limit_s:g} s: training begins without a teacher, who may still come")

    def hurry(self) -> None:
        """Never pace the environment again."""
        self._link.tell("hurry", None)

    def farewell(self) -> None:
        """Tell the pages that training is over; returns when they know, or after a moment."""
        learnt = self._learnt.refresh if self._learnt else None
        summary = lesson_summary(self._log, self._task, learnt) if self._log is not None else None
        self._link.tell("farewell", {"text": "Training has ended.", "summary": summary})
        self._link.wait_for(BYE, FAREWELL_S)

    def close(self) -> None:
        """Close the link."""
        self._link.close()


def open_classroom(
    cfg: TrainConfig, env: gymnasium.Env[Any, Any], port: int, folder: Path, live_view: str | None
) -> Classroom:
    """Make the classroom that the settings ask for, and print where its page is.

    Args:
        cfg: settings of the run.
        env: one of its environments.
        port: from ``choose_port``.
        folder: folder of the run.
        live_view: address of the live rerun view, None without one.
    """
    assert isinstance(cfg.instructor, HumanConfig)
    task = task_of(env)
    about = {
        "name": task.name,
        "run": folder.name,
        "total_frames": cfg.total_frames,
        "hold_steps": cfg.instructor.hold_steps,
        "others": cfg.collect.envs_per_process - 1,
        "others_instructed_by": cfg.instructor.others,
        "oracle": has_rule(task),
        "live_view": live_view,
    }
    print(page_invitation(cfg.instructor.host, port, moved=cfg.instructor.port is None and port != PORT))  # noqa: T201 - talks to a person
    return Classroom(
        cfg.instructor,
        port,
        folder / LESSON,
        task,
        partial(
            make_agent,
            *(cfg.agent, task.observation_size, env.action_space, cfg.total_frames, task.state_names, task.parts),
        ),
        partial(
            Simulator.make,
            cfg.predictor,
            make_snapshot_env=partial(make_snapshot_env, cfg.env),
            rule=task.rule,
            seed=cfg.seed,
        ),
        about,
    )


def page_invitation(host: str, port: int, moved: bool = False) -> str:
    """The line that invites a person to teach; ``moved`` if the default port was taken."""
    shown = f"[{host}]" if ":" in host else host
    lines = [f"teach it here: http://{shown}:{port}/"]
    if moved:
        lines.append(f"  port {PORT} is taken, so this is on {port}")
    if host not in (HOST, "localhost", "::1"):
        lines.append(f"  warning: instructor.host={host}: whoever can reach this port can instruct")
    return "\n".join(lines)


def choose_port(config: HumanConfig) -> int:
    """Choose the port that the page is served on.

    Raises:
        ConfigError: if this machine has no such host, or the port asked for is taken.
    """
    allowed = f"instructor.host={config.host}: allowed is an address of this machine"
    if not config.host:  # a socket takes "" for all addresses
        raise ConfigError(f"{allowed} (0.0.0.0 for all of them)")
    try:
        free = free_port(PORT, host=config.host)
    except OSError as error:
        raise ConfigError(f"{allowed} ({error.strerror or error})") from None
    return asked_port("instructor.port", config.port, host=config.host) or free
