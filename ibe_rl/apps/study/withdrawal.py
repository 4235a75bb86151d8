"""Deletes somebody who asks for it after the last page."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.folder import open_study
from ibe_rl.types import ConfigError


def withdraw_participant(folder: Path, participant: str) -> str:
    """Delete the answers of somebody who withdraws after the end, and their ID; also while the study is served.

    Args:
        folder: of the study.
        participant: the ID or the code that they came with, or what follows ``p=`` in their link to a bundle.

    Raises:
        ConfigError: if nobody came with it.
    """
    recruiter = open_study(folder).settings.recruiter
    path = folder / FILE
    if not path.exists():
        raise ConfigError(f"study={folder}: nobody has taken part yet")
    with contextlib.closing(Answers(path)) as answers:
        person = answers.of_recruit(recruiter, participant) or answers.person(participant)
        if person is None:
            raise ConfigError(
                f"participant={participant}: nobody with this ID takes part; allowed is one of {recruiter}"
            )
        answers.withdraw(person)
    return f"participant {person.number}: deleted; that somebody withdrew is kept as a count"
