"""What a page shows, without what would give the answer away."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markdown_it import MarkdownIt

from ibe_rl.apps.study.answers import Answers, Person
from ibe_rl.apps.study.episode_file import PLAYED, sides_of
from ibe_rl.apps.study.folder import INFORMATION, Study
from ibe_rl.apps.study.recruiters import way_out
from ibe_rl.apps.study.schedule import CONSENT, NONE, PRACTICE, SCALE, TRIAL, Page
from ibe_rl.apps.study.settings import ALWAYS, ASK_WHAT_IF, LANDING, NEVER, WHICH_AGENT
from ibe_rl.apps.study.sitting import position, questions_of

_MARKDOWN = MarkdownIt("commonmark", {"html": False}).disable("image")


def about(study: Study) -> dict[str, Any]:
    """What all pages need: title, contact, language, recruiter, words."""
    settings = study.settings
    named = {name: getattr(settings, name) for name in ("title", "contact", "language", "recruiter")}
    return {**named, "words": study.words}


def shown_now(study: Study, answers: Answers, person: Person) -> dict[str, Any]:
    """What a person sees now: the page to answer, or how they left and where they go."""
    at = position(study, answers, person)
    if at.page is None:
        ended = at.ended or ""
        fields = answers.recruit_fields(person)
        return {"ended": ended, **way_out(study.settings.recruiter, ended, study.settings.completion_codes, fields)}
    return {
        "page": at.page.name,
        "kind": at.page.kind,
        "attempt": at.attempt,
        "done": at.done,
        "of": at.of,
        **content_of(study, at.page),
    }


def content_of(study: Study, page: Page) -> dict[str, Any]:
    """The text, the questions, or the recordings of a page."""
    trials = study.settings.trials
    content: dict[str, Any] = {"block": page.block, "html": _html(study, page)}
    content["lead"] = study.leads.get(page.block if page.kind == SCALE else page.kind, "")
    asked = questions_of(study, page)
    content["questions"] = [{"text": one.text, "options": list(one.options), "optional": one.optional} for one in asked]
    if page.kind == TRIAL:
        content |= {"task": trials.task, "confidence": trials.confidence}
    if page.episode >= 0:
        content["recordings"] = recordings_of(study.stimuli[page.episode], trials.task, page.arm)
    return content


def feedback_on(study: Study, page: Page) -> dict[str, Any] | None:
    """What really happened in a trial, for after its answer; None where the study does not show it.

    ``at`` is a place in the picture, ``choice`` the index of an option; ``frames`` are what came after those shown.
    """
    when, task = study.settings.trials.feedback, study.settings.trials.task
    if page.kind != TRIAL or when == NEVER or (when != ALWAYS and page.block != PRACTICE):
        return None
    one = study.stimuli[page.episode]
    truth = "at" if task == LANDING else "choice"
    return {truth: one["truth"][truth], "frames": [] if task == WHICH_AGENT else one.get("later", [])}


def recordings_of(episode: Mapping[str, Any], task: str, arm: str) -> list[dict[str, Any]]:
    """The recordings that an episode shows, each with the explanations of an arm, and nothing that comes after."""
    shown = (*PLAYED, "told") if task == ASK_WHAT_IF else PLAYED
    return [
        {**{name: side[name] for name in shown}, "said": None if arm == NONE else side["explanations"][arm]}
        for side in sides_of(episode, task)
    ]


def _html(study: Study, page: Page) -> str:
    names = (INFORMATION, CONSENT) if page.kind == CONSENT else (page.kind,)
    return "".join(str(_MARKDOWN.render(study.texts[name])) for name in names if name in study.texts)
