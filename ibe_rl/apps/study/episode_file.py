"""Reads an episode of stimuli/, and refuses one that the study's task cannot show."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ibe_rl.apps.study.settings import ASK_WHAT_IF, LANDING, NEXT_WORDS, WHICH_AGENT
from ibe_rl.types import ConfigError

PLAYED = ("size", "frame_ms", "background", "frames")
"""What a page gets of a recording, beside the explanations of one arm."""


def read_episode(text: str, task: str, source: str) -> dict[str, Any]:
    """Read an episode.

    Args:
        text: JSON object of the file.
        task: that people do with it.
        source: path of the file, for messages.

    Raises:
        ConfigError: naming the file and what is missing.
    """
    try:
        one = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        one = None
    if not isinstance(one, dict) or not isinstance(one.get("truth"), dict):
        raise ConfigError(f"{source}: allowed is an episode that `study make` wrote")
    if why := _unfit(one, task):
        raise ConfigError(f"{source}: {why}; allowed with trials.task={task} is an episode that was made for it")
    return one


def sides_of(one: Mapping[str, Any], task: str) -> list[Mapping[str, Any]]:
    """The recordings that an episode shows: itself, or one of each agent."""
    return list(one["sides"]) if task == WHICH_AGENT else [one]


def arms_of(one: Mapping[str, Any], task: str) -> list[str]:
    """The arms whose explanations are in all recordings of an episode."""
    first, *others = sides_of(one, task)
    return [arm for arm in first["explanations"] if all(arm in other["explanations"] for other in others)]


def _no_number(name: str) -> float:
    raise ValueError(name)


def _unfit(one: dict[str, Any], task: str) -> str:
    """What is missing for a task; empty if nothing is."""
    truth, phrases = one["truth"], one.get("phrases")
    if task == WHICH_AGENT and not (isinstance(one.get("sides"), list) and len(one["sides"]) == 2):
        return "it has no two sides"
    if task in (NEXT_WORDS, ASK_WHAT_IF) and not (isinstance(phrases, list) and len(phrases) > 1):
        return "it has no two phrases"
    if task == ASK_WHAT_IF and not (isinstance(one.get("told"), str) and one["told"]):
        return "it is told nothing"
    if task == LANDING:
        if not isinstance(truth.get("at"), int | float) or not 0 <= truth["at"] <= 1:
            return f"truth.at={truth.get('at')} is no place in the picture, 0 to 1"
    elif truth.get("choice") not in range(2 if task == WHICH_AGENT else len(phrases or [])):
        return f"truth.choice={truth.get('choice')} is none of its options"
    return next(filter(None, map(_unplayable, sides_of(one, task))), "")


def _unplayable(side: Any) -> str:
    """Why a recording cannot be played; empty if it can."""
    missing = [name for name in (*PLAYED, "explanations") if not isinstance(side, dict) or name not in side]
    if missing:
        return f"it has no {missing[0]}"
    if not side["frames"] or not all(isinstance(frame, list) for frame in side["frames"]):
        return "it has no frames"
    for arm, said in side["explanations"].items():
        if any(len(said[name]) != len(side["frames"]) for name in ("expressions", "phrases")):
            return f"explanations.{arm} is not as long as frames"
    return ""
