"""Answers that arrive in the same moment are written to disk together: one wait for all of them, not one each."""

from __future__ import annotations

import asyncio

from ibe_rl.apps.study.answers import Answer, Answers, Person
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.messages import BadAnswerError
from ibe_rl.apps.study.sitting import take


class JointWriter:
    """Takes answers, see ``sitting.take``; each is on disk before it is confirmed.

    Args:
        study: that is served.
        answers: of it.
    """

    def __init__(self, study: Study, answers: Answers):
        self._study, self._answers = study, answers
        self._waiting: list[tuple[Person, Answer, asyncio.Future[str]]] = []

    async def take(self, person: Person, answer: Answer) -> str:
        """Keep an answer, with all others that the server reads before it writes.

        Returns:
            What became of it; it is on disk.

        Raises:
            BadAnswerError: if it does not answer the page where the person is.
        """
        loop = asyncio.get_running_loop()
        future: asyncio.Future[str] = loop.create_future()
        if not self._waiting:
            loop.call_soon(self._write)
        self._waiting.append((person, answer, future))
        return await future

    def _write(self) -> None:
        waiting, self._waiting = self._waiting, []
        outcomes: list[str | Exception] = []
        try:
            with self._answers.transaction():
                outcomes = [self._taken(person, answer) for person, answer, _ in waiting]
        except Exception as error:
            outcomes = [error] * len(waiting)
        for (_, _, future), outcome in zip(waiting, outcomes, strict=True):
            if not future.cancelled():
                future.set_exception(outcome) if isinstance(outcome, Exception) else future.set_result(outcome)

    def _taken(self, person: Person, answer: Answer) -> str | Exception:
        """One answer; what is wrong with it keeps no other from disk."""
        now = self._answers.person(person.token)
        if now is None:
            return BadAnswerError("nobody takes part under this address")
        try:
            return take(self._study, self._answers, now, answer)
        except Exception as error:
            return error
