"""What of a vocabulary is a person's, as a refresh tells it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PersonsShare:
    """What of the training data of a vocabulary a person said.

    Attributes:
        episodes: of the person, among the best.
        windows: of these, those that begin with an instruction of theirs.
        weight: how often each counts; the others count once.
        only: whether nothing else was used.
        marked: explanations in taught episodes that the person called wrong; those windows are left out.
    """

    episodes: int
    windows: int
    weight: int
    only: bool
    marked: int
