"""The pages that a person goes through, in order; the same seed and arms give the same pages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ibe_rl.apps.study.assignment import Order
from ibe_rl.apps.study.settings import NONE, PRACTICE, StudySettings
from ibe_rl.types import ConfigError

CONSENT, DEMOGRAPHICS, INSTRUCTIONS, COMPREHENSION = "consent", "demographics", "instructions", "comprehension"
TRIAL, ATTENTION, SCALE, COMMENT, DEBRIEFING = "trial", "attention", "scale", "comment", "debriefing"
TRANSFER = "transfer"


@dataclass(frozen=True)
class Page:
    """One page.

    Attributes:
        name: unique in the schedule, such as ``trial/1/3``; answers are kept under it. It is seen by people, so it
            does not name the arm.
        kind: what it shows.
        block: of a trial: ``PRACTICE``, an arm, or ``TRANSFER``; of a scale its name.
        arm: whose explanations a trial or an example shows; ``NONE`` for none.
        episode: index of a trial's or an example's episode; -1 elsewhere.
    """

    name: str
    kind: str
    block: str = ""
    arm: str = NONE
    episode: int = -1


def episodes_needed(settings: StudySettings, arms_of_a_person: int) -> int:
    """How many episodes a person sees, none of them twice."""
    trials = settings.trials
    return trials.practice + arms_of_a_person * trials.each_arm + trials.transfer


def pages_of(settings: StudySettings, arms: Order, episodes: int, number: int) -> list[Page]:
    """A person's pages.

    The first episodes are for practice, the same for all, with the arms in turn. The others are cut into one set for
    each block. Which set belongs to which block moves on by one from person to person, so an episode is equally often
    seen in each block. The order within a block is drawn by lot. The example of the instructions is an episode that
    nobody is asked about; if there is none to spare, it is the first of practice.

    Args:
        settings: of the study.
        arms: of the person, a block each.
        episodes: that there are.
        number: of the person; seeds the lot.

    Raises:
        ConfigError: if there are too few episodes.
    """
    trials, needed = settings.trials, episodes_needed(settings, len(arms))
    if episodes < needed:
        raise ConfigError(f"trials: {needed} episodes needed, {episodes} are in stimuli/; allowed are fewer trials")
    random = np.random.default_rng([settings.seed, number])
    sizes = [trials.each_arm] * len(arms) + [trials.transfer]
    pages = [Page(CONSENT, CONSENT)]
    pages += [Page(DEMOGRAPHICS, DEMOGRAPHICS)] if settings.demographics else []
    told = next((arm for arm in arms if arm != NONE), NONE)
    example = needed if episodes > needed else 0 if trials.practice else -1
    pages += [Page(INSTRUCTIONS, INSTRUCTIONS, arm=told, episode=example), Page(COMPREHENSION, COMPREHENSION)]
    pages += [
        Page(f"{TRIAL}/{PRACTICE}/{place + 1}", TRIAL, PRACTICE, arms[place % len(arms)], place)
        for place in range(trials.practice)
    ]
    rest = np.roll(np.arange(trials.practice, needed), -number * trials.each_arm)
    blocks = [*((str(number), arm, arm) for number, arm in enumerate(arms, start=1)), (TRANSFER, TRANSFER, NONE)]
    for (called, block, arm), seen in zip(blocks, np.split(rest, np.cumsum(sizes)[:-1]), strict=True):
        pages += [
            Page(f"{TRIAL}/{called}/{place}", TRIAL, block, arm, episode)
            for place, episode in enumerate(random.permutation(seen).tolist(), start=1)
        ]
    _put_in(pages, settings.trials.attention_checks, random)
    pages += [Page(f"{SCALE}/{name}", SCALE, name) for name in settings.scales]
    return [*pages, Page(COMMENT, COMMENT), Page(DEBRIEFING, DEBRIEFING)]


def _put_in(pages: list[Page], checks: int, random: np.random.Generator) -> None:
    """Put attention checks between the trials that count, as far apart as they can be, but for a lot."""
    counted = [index for index, page in enumerate(pages) if page.kind == TRIAL and page.block != PRACTICE]
    for check, span in reversed([*enumerate(np.array_split(counted, checks), start=1)] if checks else []):
        if len(span):
            pages.insert(int(random.choice(span)), Page(f"{ATTENTION}/{check}", ATTENTION))
