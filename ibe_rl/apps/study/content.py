"""What a page shows, without what would give the answer away."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markdown_it import MarkdownIt

from ibe_rl.apps.study.answers import Answers, Person
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.recruiters import way_out
from ibe_rl.apps.study.schedule import NONE, PRACTICE, TRIAL, Page
from ibe_rl.apps.study.settings import ALWAYS, NEVER
from ibe_rl.apps.study.sitting import position, questions_of

_MARKDOWN = MarkdownIt("commonmark", {"html": False})


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
    """The text, the questions, or the episode of a page."""
    content: dict[str, Any] = {"block": page.block}
    if page.kind in study.texts:
        content["html"] = _MARKDOWN.render(study.texts[page.kind])
    if page.kind == TRIAL:
        content |= {"task": study.settings.trials.task, "confidence": study.settings.trials.confidence}
        content["episode"] = _unspoilt(study.stimuli[page.episode], page.arm)
    asked = questions_of(study, page)
    content["questions"] = [{"text": one.text, "options": list(one.options), "optional": one.optional} for one in asked]
    return content


def feedback_on(study: Study, page: Page) -> dict[str, Any] | None:
    """What really happened in a trial, for after its answer; None where the study does not show it."""
    when = study.settings.trials.feedback
    if page.kind != TRIAL or when == NEVER or (when != ALWAYS and page.block != PRACTICE):
        return None
    one = study.stimuli[page.episode]
    return {"truth": one["truth"], "frames": one.get("later", [])}


def _unspoilt(stimulus: Mapping[str, Any], arm: str) -> dict[str, Any]:
    """An episode with the explanations of an arm, and without its end."""
    hidden = ("truth", "later", "explanations", "seed", "context", "name")
    shown = {name: value for name, value in stimulus.items() if name not in hidden}
    return {**shown, "said": None if arm == NONE else stimulus["explanations"][arm]}
