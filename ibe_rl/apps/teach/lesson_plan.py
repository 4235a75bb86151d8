"""Opens the lesson in the process that steps the environments, and forwards the trainer's messages to its pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from ibe_rl.agents import Agent
from ibe_rl.apps.teach.clock import Clock
from ibe_rl.apps.teach.lesson import Lesson, Stage
from ibe_rl.apps.teach.link import Address, GameEnd
from ibe_rl.apps.teach.live_explainer import LiveExplainer
from ibe_rl.apps.teach.phrase_groups import load_nearest
from ibe_rl.apps.teach.server import Server, words_fields
from ibe_rl.apps.teach.session import TeachingSession
from ibe_rl.apps.teach.summary_page import write_lesson_page
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors.recorded import LessonWriter
from ibe_rl.vocabulary.words import words_of

STEPS_PER_SECOND = 50.0
"""Used where an environment does not declare its speed (gymnasium's ``render_fps``)."""
BYE, SEATED, WORDS_NAMED = "bye", "seated", "words"
"""What this process tells the trainer: it has ended, a page is there, and the words as the person has named them."""
Games = MutableSequence[gymnasium.Env[Any, Any]]


@dataclass(frozen=True)
class LessonPlan:
    """Picklable factory of the lesson, called in the process that steps the environments.

    Attributes:
        host: address that the page is served on.
        port: port that the page is served on.
        hold_steps: see ``HumanConfig``.
        speed: see ``HumanConfig``.
        group_phrases: see ``HumanConfig``.
        address: where the trainer listens.
        make_agent: makes an agent whose ``greedy`` takes the trainer's weights.
        make_predictor: makes a predictor with environments of its own.
        record: the file of all instructions.
        about: what a page needs to know from the beginning.
    """

    host: str
    port: int
    hold_steps: int | None
    speed: float | None
    group_phrases: bool
    address: Address
    make_agent: Callable[[], Agent]
    make_predictor: Callable[[], Any]
    record: Path
    about: Mapping[str, Any]

    def __call__(self, games: Games) -> Lesson:
        """Make the first of the ``games`` the one that is taught, and serve its page."""
        games[0] = stage = Stage(games[0])
        values = task_of(stage).instruction_values
        task = task_of(stage)
        if task.words is not None and (named := words_of(self.record.parent, len(task.words))):
            task.words.become(named)  # of a run that goes on
        nearest = load_nearest() if self.group_phrases else None
        desk = TeachingSession(values, self.hold_steps, self.speed, task.words, nearest)
        server = Server(desk, self.host, self.port)
        clock = Clock(desk, float(stage.metadata.get("render_fps") or STEPS_PER_SECOND))
        speaker = LiveExplainer(self.make_agent().greedy, self.make_predictor(), task)
        lesson = Lesson(stage, desk, server, speaker, clock, LessonWriter(self.record))
        server.post("about", {**self.about, "values": list(values)})
        if task.words is not None:
            server.post("words", words_fields(task.words))
        self._listen(lesson, desk, server, speaker, clock)
        return lesson

    def _listen(
        self, lesson: Lesson, desk: TeachingSession, server: Server, speaker: LiveExplainer, clock: Clock
    ) -> None:
        """Forward the trainer's messages to the pages."""

        def farewell(news: Mapping[str, Any]) -> None:
            lesson.finish()
            if news["summary"]:
                summary = {**news["summary"], "films": list(lesson.outcomes.films.values())}
                server.post("summary", summary)
                write_lesson_page(self.record.parent, summary)
            server.post("farewell", {"text": news["text"]})
            server.close()
            trainer.say(BYE)

        def lost() -> None:
            clock.hurry()
            lesson.finish()
            server.post("farewell", {"text": "The training process has ended."})
            server.close()

        hear: dict[str, Callable[[Any], None]] = {
            "policy": speaker.learn,
            "explainer": speaker.speak_with,
            "vocabulary": lambda fields: server.post("vocabulary", fields),
            "figures": lambda fields: server.post("figures", fields),
            "understood": lambda text: server.post("understood", {"text": text}),
            "hurry": lambda _: clock.hurry(),
            "farewell": farewell,
        }
        trainer = GameEnd(self.address, hear, lost)
        desk.when_seated(lambda: trainer.say(SEATED))
        if desk.words is not None:
            words = desk.words
            server.renamed = lambda: trainer.say((WORDS_NAMED, words.to_dicts()))
