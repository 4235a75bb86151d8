"""The folder of a study: read whole, checked, and hashed into the protocol that is kept with every answer.

study.yaml              settings, see ``settings``
texts/LANGUAGE/*.md     consent, instructions, debriefing; information, if there is one, stands above the consent
texts/LANGUAGE/*.yaml   words, comprehension, demographics, attention, and a file for each scale in scales/
stimuli/*.json          episodes, see ``stimuli``
answers.sqlite          what people answered
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.assignment import Order, mixed_orders, orders_of
from ibe_rl.apps.study.episode_file import arms_of, read_episode
from ibe_rl.apps.study.questions import Question, read_questions
from ibe_rl.apps.study.schedule import episodes_needed
from ibe_rl.apps.study.settings import ARMS, MIXED, NONE, WITHIN, StudySettings, read_settings
from ibe_rl.apps.study.words import read_words
from ibe_rl.types import ConfigError

STUDY_YAML, TEXTS, STIMULI, SCALES, WORDS_YAML = "study.yaml", "texts", "stimuli", "scales", "words.yaml"
INFORMATION = "information"
TEXT_PAGES = ("consent", "instructions", "debriefing")
QUESTIONS = ("comprehension", "demographics", "attention")
PROTOCOL = "protocol.json"
"""The hashes of all files as they were when the first person began."""
HASH_DIGITS = 16


@dataclass(frozen=True, eq=False)  # each opening is another one
class Study:
    """An opened study.

    Attributes:
        folder: of it.
        settings: of study.yaml.
        texts: page to its Markdown.
        questions: ``comprehension``, ``demographics``, ``attention`` and each scale to what is asked there.
        leads: the same names to what is shown above the questions.
        words: key to a word of the pages, see ``words``.
        stimuli: the episodes, see ``stimuli.Stimulus``.
        files: path in the folder to the hash of what it holds.
    """

    folder: Path
    settings: StudySettings
    texts: dict[str, str]
    questions: dict[str, list[Question]]
    leads: dict[str, str]
    words: dict[str, str]
    stimuli: Sequence[dict[str, Any]]
    files: dict[str, str]

    @cached_property
    def protocol(self) -> str:
        """One hash of everything that a person sees and that decides what counts."""
        return _hash(json.dumps(self.files, sort_keys=True).encode())

    @cached_property
    def orders(self) -> list[Order]:
        """The orders of arms that are given out."""
        if self.settings.design == MIXED:
            return mixed_orders(self.settings.arms, NONE)
        return orders_of(self.settings.arms, self.settings.design == WITHIN)


def open_study(folder: Path) -> Study:
    """Read and check a study.

    Raises:
        ConfigError: naming the file, the key, the value and what is allowed.
    """
    if not (folder / STUDY_YAML).is_file():
        raise ConfigError(f"study={folder}: it has no {STUDY_YAML}; allowed is a folder that `study make` made")
    settings = read_settings(_yaml(folder / STUDY_YAML), str(folder / STUDY_YAML))
    texts = folder / TEXTS / settings.language
    if not texts.is_dir():
        there = sorted(one.name for one in (folder / TEXTS).glob("*") if one.is_dir())
        raise ConfigError(f"{folder / STUDY_YAML}: language={settings.language}: allowed is one of {', '.join(there)}")
    asked = {name: texts / f"{name}.yaml" for name in QUESTIONS}
    asked |= {name: texts / SCALES / f"{name}.yaml" for name in settings.scales}
    written = {name: _yaml(path) for name, path in asked.items()}
    told = [*TEXT_PAGES, *([INFORMATION] if (texts / f"{INFORMATION}.md").exists() else [])]
    study = Study(
        folder,
        settings,
        {name: _text(texts / f"{name}.md") for name in told},
        {name: read_questions(values, str(asked[name])) for name, values in written.items()},
        {name: values.get("lead", "") for name, values in written.items()},
        read_words(_yaml(texts / WORDS_YAML), str(texts / WORDS_YAML)),
        [
            {**read_episode(_text(path), settings.trials.task, str(path)), "name": path.stem}
            for path in sorted((folder / STIMULI).glob("*.json"))
        ],
        _files(folder, [texts, folder / STIMULI]),
    )
    _check_stimuli(study)
    return study


def hold_protocol(study: Study, answers: Answers) -> None:
    """Refuse a study that was changed after the first person had begun; keep its hashes until then.

    Raises:
        ConfigError: naming what has changed, and how to make a new version.
    """
    path = study.folder / PROTOCOL
    if answers.begun():
        before = json.loads(path.read_text())["files"] if path.exists() else {}
        changed = sorted(name for name in {*before, *study.files} if before.get(name) != study.files.get(name))
        if changed:
            raise ConfigError(
                f"study={study.folder}: {', '.join(changed[:3])} changed after the first person had begun; allowed is "
                f"what it was, or a copy of the folder without {FILE}* and {PROTOCOL}, as a new version"
            )
    else:
        path.write_text(json.dumps({"protocol": study.protocol, "files": study.files}, indent=1, sort_keys=True))


def _check_stimuli(study: Study) -> None:
    """Refuse a study whose episodes are too few or lack the explanations of an arm."""
    needed = episodes_needed(study.settings, len(study.orders[0]))
    if len(study.stimuli) < needed:
        raise ConfigError(
            f"{study.folder / STUDY_YAML}: trials: a person sees {needed} episodes, {len(study.stimuli)} are in "
            f"{STIMULI}/; allowed are fewer trials, or more episodes"
        )
    task = study.settings.trials.task
    for arm in study.settings.arms:
        without = [one["name"] for one in study.stimuli if arm != NONE and arm not in arms_of(one, task)]
        if without:
            has = ", ".join([NONE, *(one for one in ARMS if one in arms_of(study.stimuli[0], task))])
            raise ConfigError(
                f"{study.folder / STUDY_YAML}: arms={study.settings.arms}: {STIMULI}/{without[0]}.json has no "
                f"explanations of {arm}; allowed are {has}"
            )


def _files(folder: Path, parts: Sequence[Path]) -> dict[str, str]:
    paths = [folder / STUDY_YAML, *(one for part in parts for one in part.rglob("*") if one.is_file())]
    return {str(path.relative_to(folder)): _hash(path.read_bytes()) for path in sorted(paths)}


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:HASH_DIGITS]


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no UTF-8"
        raise ConfigError(f"{path}: allowed is a text in Markdown ({reason})") from None


def _yaml(path: Path) -> Any:
    try:
        return yaml.safe_load(_text(path))
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: allowed is YAML ({' '.join(str(error).split())[:200]})") from None
