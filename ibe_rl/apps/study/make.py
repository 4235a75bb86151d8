"""``make``: a study in a folder of one's own, from a trained run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import yaml

from ibe_rl.apps.study.assignment import mixed_orders, orders_of
from ibe_rl.apps.study.folder import STIMULI, STUDY_YAML, TEXTS, open_study
from ibe_rl.apps.study.schedule import episodes_needed
from ibe_rl.apps.study.settings import ASK_WHAT_IF, MIXED, NONE, WHICH_AGENT, WITHIN, StudySettings, read_settings
from ibe_rl.apps.study.shipped_texts import copy_texts
from ibe_rl.config.declared import meanings
from ibe_rl.config.limits import allowed_values
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.operating_system import lock_file
from ibe_rl.storage.run_folder import PARTIAL
from ibe_rl.types import ConfigError

ABOUT = "made.json"
"""What a study was made from."""
_LOCK = "lock"


def make(
    run: str | None = None,
    out: str = "study",
    other: str | None = None,
    until: str | None = None,
    frames: int = SEEN_STEPS,
    stimuli: int = 0,
    flights: int = 200,
    pace: float = 1.0,
    seed: int = 0,
    **study: Any,
) -> Path:
    """Make a study from a trained run: stimuli, study.yaml and texts, in a new folder.

    Args:
        run: folder of the run; "demo" is the one that comes along; null: the newest below runs/
        out: the folder to make
        other: of which_agent: folder of a second run; null: an earlier policy of the same run
        until: what is asked about: "contact", where it first touches, "end", as in the paper, or "lot", any
            moment; null: contact if the environment declares it, else lot; of what_if always lot
        frames: of an episode that people see, before the moment that they are asked about
        stimuli: how many episodes; 0: as many as a person sees, and one as the example in the instructions
        flights: flown beforehand, for the paper's vocabulary and the simulated observers
        pace: 1 plays as fast as the environment is, 0.5 half as fast
        seed: of the episodes, and of the study
        study: settings of study.yaml

    Returns:
        the folder.

    Raises:
        ConfigError: naming the key, the value and what is allowed; nothing is left behind.
    """
    settings, folder = read_settings(nested({"seed": seed, **study}), "make"), Path(out)
    needed = episodes_needed(settings, arms_each(settings))
    _check(stimuli, frames, flights, pace, seed, needed)
    paired = settings.trials.task == WHICH_AGENT
    if (other if not paired else until) is not None:
        key, value = ("until", until) if paired else ("other", other)
        raise ConfigError(f"{key}={value} with trials.task={settings.trials.task}: allowed is null")
    preparing = load_app("study make")  # imports torch
    otherwise = settings.trials.task == ASK_WHAT_IF
    plan = preparing.StimuliPlan(run, other, stimuli or needed + 1, flights, pace, seed, until, frames, otherwise)
    with _new_folder(folder) as partial:
        made, about = preparing.pairs_from(plan) if paired else preparing.stimuli_from(plan)
        _check_arms(settings, made[0])
        write_study_files(partial, settings, made, about)
        open_study(partial)
    return folder


def arms_each(settings: StudySettings) -> int:
    """How many arms a person goes through."""
    if settings.design == MIXED:
        return len(mixed_orders(settings.arms, NONE)[0])
    return len(orders_of(settings.arms, settings.design == WITHIN)[0])


def nested(study: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as ``trials.each_arm`` to groups.

    Raises:
        ConfigError: if a key is both a group and a value.
    """
    found: dict[str, Any] = {}
    for key, value in study.items():
        *groups, name = key.split(".")
        place = found
        for group in groups:
            place = place.setdefault(group, {})
            if not isinstance(place, dict):
                raise ConfigError(f"{key}={value}: {group} has a value of its own; allowed is one of both")
        place[name] = value
    return found


def _check(stimuli: int, frames: int, flights: int, pace: float, seed: int, needed: int) -> None:
    limits = (
        ("stimuli", stimuli, stimuli == 0 or max(needed, 2) <= stimuli <= 1000, f"0, or {max(needed, 2)} to 1000"),
        ("frames", frames, 2 <= frames <= 1000, "2 to 1000"),
        ("flights", flights, 2 <= flights <= 5000, "2 to 5000"),
        ("pace", pace, 0.01 <= pace <= 10, "0.01 to 10"),
        ("seed", seed, 0 <= seed < 1000, "0 to 999"),
    )
    for key, value, fits, allowed in limits:
        if not fits:
            raise ConfigError(f"{key}={value}: allowed is {allowed}")
    if not stimuli and not 1 <= needed < 1000:
        raise ConfigError(f"trials: a person sees {needed} episodes; allowed are 1 to 999")


@contextmanager
def _new_folder(folder: Path) -> Iterator[Path]:
    """A folder under another name, which takes its own in the end, or is gone if the body fails."""
    if folder.exists():
        raise ConfigError(f"out={folder}: it is there already; allowed is a new folder")
    partial = folder.with_name(folder.name + PARTIAL)
    try:
        partial.mkdir(parents=True, exist_ok=True)
        with (partial / _LOCK).open("w") as lock:
            if not lock_file(lock):
                raise ConfigError(f"out={folder}: another program is making it; allowed is a new folder")
            try:
                shutil.rmtree(partial / STIMULI, ignore_errors=True)  # of a program that was killed
                shutil.rmtree(partial / TEXTS, ignore_errors=True)
                (partial / STIMULI).mkdir()
                yield partial
                (partial / _LOCK).unlink()
                partial.rename(folder)
            finally:
                shutil.rmtree(partial, ignore_errors=True)
    except OSError as error:
        raise ConfigError(f"out={folder}: allowed is a folder that can be written to ({error.strerror})") from None


def _check_arms(settings: StudySettings, stimulus: Mapping[str, Any]) -> None:
    for arm in settings.arms:
        if arm != NONE and arm not in stimulus["explanations"]:
            raise ConfigError(
                f"arms={settings.arms}: this agent's flights teach no vocabulary for {arm}; allowed are more flights, "
                f"or arms without it"
            )


def write_study_files(
    folder: Path, settings: StudySettings, stimuli: list[dict[str, Any]], about: Mapping[str, Any]
) -> None:
    """Write study.yaml, stimuli, texts and what it was made from."""
    (folder / STUDY_YAML).write_text(commented(settings), encoding="utf-8")
    for number, one in enumerate(stimuli):
        text = json.dumps(one, allow_nan=False, separators=(",", ":"))
        (folder / STIMULI / f"{number:03d}.json").write_text(text + "\n", encoding="utf-8")
    copy_texts(folder, settings, about, arms_each(settings))
    kept = {"version": version("ibe_rl"), "task": settings.trials.task, "stimuli": len(stimuli), **about}
    (folder / ABOUT).write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")


def commented(settings: StudySettings) -> str:
    """study.yaml, each setting with what it means and what is allowed."""
    head = ["# A study of ibe_rl. Change what you need before the first person begins; serving checks it.", ""]
    return "\n".join([*head, *_lines(settings, "")]) + "\n"


def _lines(settings: Any, indent: str) -> list[str]:
    found = []
    schema: type = type(settings)
    said = meanings(schema)
    for item in fields(settings):
        value = getattr(settings, item.name)
        about = "; ".join(filter(None, (said.get(item.name, ""), allowed_values(item.metadata))))
        found += [f"{indent}# {about}"] if about else []
        if is_dataclass(value):
            found += [f"{indent}{item.name}:", *_lines(value, indent + "  "), ""]
        else:
            found.append(f"{indent}{_yaml_line(item.name, value)}")
    return found


def _yaml_line(name: str, value: Any) -> str:
    text = yaml.safe_dump({name: value}, default_flow_style=True, width=10_000, allow_unicode=True).strip()
    return text[1:-1]
