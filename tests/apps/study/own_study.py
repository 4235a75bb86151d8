"""A small study in a folder, written by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

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
    "scales/satisfaction": {"options": ["no", "a little", "yes"], "questions": ["I understood it.", "I liked it."]},
}


def stimulus(number: int) -> dict[str, Any]:
    """An episode of two frames."""
    return {
        "frames": [[{"points": [[0.0, 1.0]]}], [{"points": [[0.5, 0.5]]}]],
        "phrases": ["left", "straight", "right"],
        "truth": {"at": number / 10, "choice": number % 3},
        "explanations": {"ibe": {"expressions": [0.5, 1.0], "phrases": ["right", "right"]}},
        "observers": {"none": {"at": 0.9, "choice": 2}, "ibe": {"at": number / 10, "choice": number % 3}},
    }


def write_study(folder: Path, episodes: int = 3, **settings: Any) -> Path:
    """Write a study that has all it needs, with other settings."""
    texts = folder / "texts/en"
    (texts / "scales").mkdir(parents=True)
    (folder / "stimuli").mkdir()
    (folder / "study.yaml").write_text(yaml.safe_dump({**SETTINGS, **settings}))
    for name, text in TEXTS.items():
        (texts / f"{name}.md").write_text(text)
    for name, questions in QUESTIONS.items():
        (texts / f"{name}.yaml").write_text(yaml.safe_dump(questions))
    for number in range(episodes):
        (folder / f"stimuli/{number}.json").write_text(json.dumps(stimulus(number)))
    return folder
