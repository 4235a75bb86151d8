"""Simulated people: how somebody of a stated skill, carelessness and trust in the words answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.questions import Question
from ibe_rl.apps.study.schedule import ATTENTION, COMMENT, COMPREHENSION, CONSENT, TRIAL, Page
from ibe_rl.apps.study.settings import LANDING, NONE, WHICH_AGENT
from ibe_rl.apps.study.sitting import questions_of
from ibe_rl.types import ConfigError

AGENTS_SHOWN = 2
UNWRITTEN = "-"
"""What is written where something has to be."""
CONFIDENT, UNCONFIDENT, CONFIDENCE_SPREAD = 75.0, 40.0, 15.0
"""Confidence in percent after an answer that was thought about, after a guess, and its standard deviation."""
PEOPLE_DIFFER = 0.3
"""Standard deviation between people of the logarithm of their noise and pace."""


@dataclass(frozen=True)
class Participant:
    """A simulated person.

    Attributes:
        noise: standard deviation of a landing place, in widths of the picture; for choices, probability of choosing
            another one.
        lapse: share of the pages answered at random.
        reliance: 0 ignores the words, 1 believes all: weight of what the observers say with the arm's explanations
            against what they say without.
        drop_out: probability of leaving at each page.
        pace_s: median time of an answer.
    """

    noise: float = 0.1
    lapse: float = 0.05
    reliance: float = 0.5
    drop_out: float = 0.0
    pace_s: float = 12.0


def draw_people(
    count: int,
    seed: int,
    noise: float = 0.1,
    lapse: float = 0.05,
    reliance: tuple[float, float] = (0.0, 1.0),
    drop_out: float = 0.0,
    pace_s: float = 12.0,
) -> list[Participant]:
    """People who differ: noise and pace log-normally around their medians, reliance evenly between two limits.

    Args:
        count: of people.
        seed: of the lot.
        noise: median, 0 to 1.
        lapse: of all, 0 to 1.
        reliance: lowest and highest, each 0 to 1.
        drop_out: of all, 0 to 1.
        pace_s: median, above 0.

    Raises:
        ConfigError: naming the argument, its value and what is allowed.
    """
    if count < 1:
        raise ConfigError(f"people={count}: allowed is 1 or more")
    if not 0 <= reliance[0] <= reliance[1] <= 1:
        raise ConfigError(f"reliance={reliance}: allowed are two numbers from 0 to 1, the lower one first")
    for name, value in (("noise", noise), ("lapse", lapse), ("drop_out", drop_out)):
        if not 0 <= value <= 1:
            raise ConfigError(f"{name}={value}: allowed is a number from 0 to 1")
    if not pace_s > 0:
        raise ConfigError(f"pace_s={pace_s}: allowed is a number above 0")
    random = np.random.default_rng(seed)
    differ = np.exp(PEOPLE_DIFFER * random.standard_normal((count, 2)))
    believed = random.uniform(*reliance, size=count)
    return [
        Participant(min(1.0, noise * noisier), lapse, float(trust), drop_out, pace_s * slower)
        for (noisier, slower), trust in zip(differ.tolist(), believed, strict=True)
    ]


def answer_trial(
    person: Participant, stimulus: Mapping[str, Any], arm: str, task: str, random: np.random.Generator
) -> dict[str, float | int]:
    """What a person answers in a trial.

    Args:
        person: who answers.
        stimulus: a file of ``stimuli/``; the person knows its ``observers``, not its ``truth``.
        arm: whose explanations are shown.
        task: ``landing``, or one that asks for a choice.
        random: the lot.

    Returns:
        ``at`` as a share of the picture's width or ``choice``, and ``confidence`` in percent.
    """
    guesses = random.random() < person.lapse
    alone = stimulus["observers"][NONE]
    told = stimulus["observers"].get(arm, alone)
    if task == LANDING:
        answer: dict[str, float | int] = {"at": _place(person, alone["at"], told["at"], guesses, random)}
    else:
        options = AGENTS_SHOWN if task == WHICH_AGENT else len(stimulus["phrases"])
        answer = {"choice": _choice(person, alone["choice"], told["choice"], options, guesses, random)}
    sure = random.normal(UNCONFIDENT if guesses else CONFIDENT, CONFIDENCE_SPREAD)
    return {**answer, "confidence": round(min(100.0, max(0.0, sure)))}


def answer_page(
    person: Participant, study: Study, page: Page, attempt: int, random: np.random.Generator
) -> dict[str, Any]:
    """What a person answers to any page of a study; see ``messages`` for the fields.

    Args:
        person: who answers.
        study: opened; what is right in a check is known to a person who does not lapse.
        page: that is shown.
        attempt: at this page; from the second on a check is taken seriously.
        random: the lot.
    """
    asked = questions_of(study, page)
    if page.kind == CONSENT:
        return {"agrees": True}
    if page.kind == COMMENT:
        return {"text": ""}
    if page.kind == TRIAL:
        trials = study.settings.trials
        answer = answer_trial(person, study.stimuli[page.episode], page.arm, trials.task, random)
        return answer if trials.confidence else {name: one for name, one in answer.items() if name != "confidence"}
    careless = attempt == 1 and random.random() < person.lapse
    if page.kind == ATTENTION:
        return {"choice": _option(asked[0], careless, random)}
    return {"choices": _options(asked, page.kind == COMPREHENSION and careless, random)} if asked else {}


def time_s(person: Participant, random: np.random.Generator) -> float:
    """How long a person takes for an answer: log-normal around the pace, in s."""
    return float(person.pace_s * np.exp(PEOPLE_DIFFER * random.standard_normal()))


def _place(person: Participant, alone: float, told: float, guesses: bool, random: np.random.Generator) -> float:
    if guesses:
        return float(random.random())
    place = (1 - person.reliance) * alone + person.reliance * told + person.noise * random.standard_normal()
    return float(min(1.0, max(0.0, place)))


def _choice(
    person: Participant, alone: int, told: int, options: int, guesses: bool, random: np.random.Generator
) -> int:
    if guesses:
        return int(random.integers(options))
    choice = told if random.random() < person.reliance else alone
    if options > 1 and random.random() < person.noise:
        return int((choice + random.integers(1, options)) % options)
    return int(choice)


def _options(asked: Sequence[Question], careless: bool, random: np.random.Generator) -> list[Any]:
    written = {True: None, False: UNWRITTEN}
    return [_option(one, careless, random) if one.options else written[one.optional] for one in asked]


def _option(question: Question, careless: bool, random: np.random.Generator) -> int:
    """The right option; any option where none is right, or without care."""
    if question.right is None or careless:
        return int(random.integers(len(question.options)))
    return question.right
