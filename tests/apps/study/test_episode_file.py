"""An episode that the task cannot show is refused when the folder is opened."""

from __future__ import annotations

import json
from typing import Any

import pytest
from own_study import recording, stimulus

from ibe_rl.apps.study.episode_file import arms_of, read_episode, sides_of
from ibe_rl.types import ConfigError

ARMS = ["paper", "ibe", "placebic", "true_future"]


@pytest.mark.parametrize("task", ["landing", "next_words", "what_if", "which_agent"])
def test_an_episode_is_read(task: str) -> None:
    one = read_episode(json.dumps(stimulus(1, task)), task, "1.json")
    assert len(sides_of(one, task)) == (2 if task == "which_agent" else 1)
    assert arms_of(one, task) == ARMS


def test_an_arm_must_be_in_both_recordings() -> None:
    sides = [recording(1), {**recording(2), "explanations": {"ibe": recording(2)["explanations"]["ibe"]}}]
    assert arms_of({"sides": sides}, "which_agent") == ["ibe"]


LANDING, WORDS, AGENTS = stimulus(1), stimulus(1, "next_words"), stimulus(1, "which_agent")
SHORT = {"ibe": {"expressions": [0.5], "phrases": ["right"]}}


@pytest.mark.parametrize(
    ("task", "values", "message"),
    [
        ("landing", {**LANDING, "truth": {"choice": 1}}, "truth.at=None is no place in the picture, 0 to 1"),
        ("landing", {**LANDING, "truth": {"at": 1.2}}, "truth.at=1.2 is no place in the picture, 0 to 1"),
        ("landing", {**LANDING, "frames": []}, "it has no frames"),
        ("landing", {**LANDING, "frames": [3]}, "it has no frames"),
        ("landing", {key: one for key, one in LANDING.items() if key != "size"}, "it has no size"),
        ("landing", {**LANDING, "explanations": SHORT}, "explanations.ibe is not as long as frames"),
        ("next_words", {**WORDS, "phrases": ["left"]}, "it has no two phrases"),
        ("what_if", WORDS, "it is told nothing"),
        ("next_words", {**WORDS, "truth": {"at": 0.5}}, "truth.choice=None is none of its options"),
        ("next_words", {**WORDS, "truth": {"choice": 3}}, "truth.choice=3 is none of its options"),
        ("which_agent", LANDING, "it has no two sides"),
        ("which_agent", {**AGENTS, "sides": [AGENTS["sides"][0]]}, "it has no two sides"),
        ("which_agent", {**AGENTS, "sides": [AGENTS["sides"][0], 3]}, "it has no size"),
        ("which_agent", {**AGENTS, "truth": {"choice": 2}}, "truth.choice=2 is none of its options"),
    ],
)
def test_what_does_not_fit_the_task_is_named(task: str, values: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=f"^1.json: {message}; allowed with trials.task={task}"):
        read_episode(json.dumps(values), task, "1.json")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"truth": 1}', '{"truth": {}, "x": NaN}', "[" * 100_000])
def test_no_episode_at_all(text: str) -> None:
    with pytest.raises(ConfigError, match=r"^1.json: allowed is an episode that `study make` wrote"):
        read_episode(text, "landing", "1.json")
