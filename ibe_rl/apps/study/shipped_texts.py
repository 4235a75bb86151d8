"""The texts that come along, copied into a study and told what that study is."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import Any

import yaml

from ibe_rl.apps.paper.names import AT_END
from ibe_rl.apps.study.folder import TEXTS
from ibe_rl.apps.study.schedule import episodes_needed
from ibe_rl.apps.study.settings import StudySettings

TO_FILL_IN = "[["
"""Begins what only the lab itself can say in a text."""
_PARTS = "parts.yaml"
_SECONDS = {"page": 25.0, "trial": 25.0, "question": 7.0}
"""How long people take, for what the consent says of it; generous."""


def copy_texts(folder: Path, settings: StudySettings, about: Mapping[str, Any], arms_each: int) -> None:
    """Copy the texts of all languages into a study.

    Args:
        folder: of the study.
        settings: of it.
        about: what it was made from: ``until`` and ``ahead_s``, how long after the clip that is.
        arms_each: arms that a person goes through.
    """
    numbers = _numbers_of(settings, about, episodes_needed(settings, arms_each))
    for language in files(__package__).joinpath(TEXTS).iterdir():
        parts = yaml.safe_load(language.joinpath(_PARTS).read_text(encoding="utf-8"))
        contact = settings.contact or parts["no_contact"]
        chosen = parts[about["until"] or AT_END] | parts["practice" if settings.trials.practice else "no_practice"]
        asked = {name: Template(text).substitute(numbers) for name, text in chosen.items()}
        words = {**numbers, **asked, "title": settings.title, "contact": contact}
        _copy_language(language, folder / TEXTS / language.name, settings.trials.task, words)


def _copy_language(source: Traversable, to: Path, task: str, words: Mapping[str, str]) -> None:
    """Texts of a language; of those for one task, ``NAME.TASK.md``, the ones for this task."""
    to.mkdir(parents=True, exist_ok=True)
    for one in source.iterdir():
        if one.is_dir():
            _copy_language(one, to / one.name, task, words)
            continue
        name, *tasks, ending = one.name.split(".")
        if tasks in ([], [task]) and one.name != _PARTS:
            text = Template(one.read_text(encoding="utf-8")).safe_substitute(words)
            (to / f"{name}.{ending}").write_text(text, encoding="utf-8")


def _numbers_of(settings: StudySettings, about: Mapping[str, Any], seen: int) -> dict[str, str]:
    """The numbers that texts tell."""
    practice, scales = settings.trials.practice, len(settings.scales)
    took_s = (6 + scales) * _SECONDS["page"] + seen * _SECONDS["trial"] + 8 * scales * _SECONDS["question"]
    minutes = max(5, 5 * round(took_s / 300))
    numbers = {"minutes": str(minutes), "practice": str(practice), "trials": str(seen - practice)}
    return {**numbers, "ahead_s": f"{about['ahead_s']:.1f}"}


def to_fill_in(folder: Path) -> list[str]:
    """Texts of a study in which something is left that only the lab can say."""
    texts = sorted((folder / TEXTS).rglob("*.md"))
    return [str(one.relative_to(folder)) for one in texts if TO_FILL_IN in one.read_text(encoding="utf-8")]
