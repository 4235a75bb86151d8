"""A small study in a folder, written by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.settings import LANDING
from ibe_rl.apps.study.sitting import questions_of
from ibe_rl.apps.study.words import WORD_KEYS

SETTINGS: dict[str, Any] = {
    "arms": ["none", "ibe"],
    "quota": 6,
    "trials": {"practice": 1, "each_arm": 2, "attention_checks": 1},
    "scales": ["satisfaction"],
    "test": {"resamples": 200},
}
TEXTS = {"consent": "# Do you agree?", "instructions": "# How it goes", "debriefing": "# What it was about"}
QUESTIONS: dict[str, Any] = {
    "comprehension": {"questions": [{"text": "Where does it land?", "options": ["there", "here"], "right": 1}]},
    "demographics": {
        "optional": True,
        "questions": ["How old are you?", {"text": "Do you fly?", "options": ["y", "n"]}],
    },
    "attention": {"questions": [{"text": "Choose the second one.", "options": ["a", "b", "c"], "right": 1}]},
    "scales/satisfaction": {
        "lead": "How much do you agree?",
        "options": ["no", "a little", "yes"],
        "questions": ["I understood it.", "I liked it."],
    },
}


SHAPE: dict[str, Any] = {"points": [[0.0, 1.0], [1.0, 1.0]], "colour": [200, 200, 200], "closed": False}


TOLD_ARMS = ("paper", "ibe", "placebic", "true_future")
TRUE_ARMS = ("ibe", "true_future")
"""With these the simulated observers are right; with the others they say what they say without an explanation."""


def recording(number: int, frames: int = 2) -> dict[str, Any]:
    """A square that moves across the picture."""
    return {
        "size": [6.0, 4.0],
        "frame_ms": 10,
        "background": [SHAPE],
        "frames": [[square(number + frame, 3.0 - frame)] for frame in range(frames)],
        "explanations": {
            arm: {"expressions": [0.5, 1.0][:frames], "phrases": [phrase] * frames}
            for arm, phrase in (("paper", "left"), ("ibe", "right"), ("placebic", "straight"), ("true_future", "right"))
        },
    }


def square(x: float, y: float) -> dict[str, Any]:
    """A shape of width 1 with its lower left corner at a place."""
    corners = [[x % 5, y], [x % 5 + 1, y], [x % 5 + 1, y + 1], [x % 5, y + 1]]
    return {"points": corners, "colour": [120, 160, 255], "closed": True}


def stimulus(number: int, task: str = "landing") -> dict[str, Any]:
    """An episode of two frames."""
    told = {"seed": number, "context": "", "success": True, "phrases": ["left", "straight", "right"]}
    told["truth"] = {"at": number % 10 / 10, "choice": number % 2 if task == "which_agent" else number % 3}
    prior = {"at": 0.9, "choice": 1}
    told["observers"] = {"none": prior} | {arm: told["truth"] if arm in TRUE_ARMS else prior for arm in TOLD_ARMS}
    told["later"] = [[square(number + 2, 1.0)], [square(number + 3, 0.0)]]
    if task == "which_agent":
        return {**told, "frames": [], "explanations": {}, "sides": [recording(number), recording(number + 2)]}
    return {**told, **({"told": "to the left"} if task == "what_if" else {}), **recording(number)}


def write_study(folder: Path, episodes: int = 3, **settings: Any) -> Path:
    """Write a study that has all it needs, with other settings."""
    texts = folder / "texts/en"
    (texts / "scales").mkdir(parents=True)
    (folder / "stimuli").mkdir()
    (folder / "study.yaml").write_text(yaml.safe_dump({**SETTINGS, **settings}))
    (texts / "words.yaml").write_text(yaml.safe_dump({key: key.replace("_", " ") for key in WORD_KEYS}))
    for name, text in TEXTS.items():
        (texts / f"{name}.md").write_text(text)
    for name, questions in QUESTIONS.items():
        (texts / f"{name}.yaml").write_text(yaml.safe_dump(questions))
    for number in range(episodes):
        task = settings.get("trials", {}).get("task", "landing")
        (folder / f"stimuli/{number:03}.json").write_text(json.dumps(stimulus(number, task)))
    return folder


def right_value(study: Study, page: Any) -> dict[str, Any]:
    """An answer that fits a page; a right one where there is one."""
    asked = questions_of(study, page)
    if page.kind == "consent":
        return {"agrees": True}
    if page.kind == "trial":
        said: dict[str, Any] = {"at": 0.5} if study.settings.trials.task == LANDING else {"choice": 0}
        return {**said, "confidence": 70}
    if page.kind == "comment":
        return {"text": "fine"}
    if page.kind == "attention":
        return {"choice": asked[0].right}
    chosen = [(one.right or 0) if one.options else "40" for one in asked]
    return {"choices": chosen} if asked else {}
