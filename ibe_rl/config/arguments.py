"""From what a person types to what hydra reads."""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import Quote, QuotedString

from ibe_rl.config.kinds import GROUPS, SEVERAL, KindFiles
from ibe_rl.storage.run_folder import CONFIG, read_yaml

SPELT = {"explain": {"sweep": "sweep_dir", "agent": "agent_file"}}
"""Settings of a script that name a file or folder, where hydra would look in ``configs/``; what they are in it."""
OF_A_TRAINING = re.compile(r"(env|mapping)[.=]")
"""Settings that ``explain.py`` hands on to what a guest's run folder is made of."""


def as_hydra_reads(arguments: Sequence[str], script: str, configs: Path) -> list[str]:
    """The arguments of a script as its config is composed from them.

    Args:
        arguments: as they were typed.
        script: "train" or "explain".
        configs: the folder of the hydra files.
    """
    spelt = [_spelt(one, script) for one in arguments]
    if script == "explain":
        return _handed_on(spelt)
    at = next((place for place, one in enumerate(spelt) if one.startswith("resume=")), len(spelt))
    spelt[at:at] = _kinds(spelt, configs)  # beside it: settings on both sides of an option are refused
    return spelt


def _spelt(argument: str, script: str) -> str:
    key, equals, value = argument.partition("=")
    names = SPELT.get(script, {})
    return f"{names[key]}={value}" if equals and key in names else argument


def _handed_on(arguments: list[str]) -> list[str]:
    """An environment's file may set what only a training has, so that only a training's config can be made of it."""
    theirs = [one for one in arguments if OF_A_TRAINING.match(one)]
    if not theirs:
        return arguments
    at = arguments.index(theirs[0])
    rest = [one for one in arguments if one not in theirs]
    return [*rest[:at], f"guest_settings=[{','.join(map(quoted, theirs))}]", *rest[at:]]


def _kinds(arguments: Sequence[str], configs: Path) -> list[str]:
    """What kinds a run that is resumed has: with them, their settings are known to hydra."""
    resumed = [one.partition("=")[2].strip("'") for one in arguments if one.startswith("resume=")]
    try:
        saved = read_yaml(Path(resumed[0]) / CONFIG)
        given = {one.partition("=")[0] for one in arguments}
        folders = [KindFiles("", str(folder)) for folder in (configs, *own_folders(arguments))]
        return [
            f"{group}={chosen}"
            for group in GROUPS
            if group not in given and (chosen := _chosen(group, saved, folders)) is not None
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        return []  # if it is wrong, taking the run up says so


def _chosen(group: str, saved: dict[str, Any], folders: Sequence[KindFiles]) -> str | None:
    """The files of a group that a saved config was made from, as on the command line; None if there are none."""
    names = {kind: name for folder in folders for kind, name in folder.kinds(group).items()}
    if group in SEVERAL:
        several = saved.get(SEVERAL[group], {})
        return f"[{','.join(several)}]" if several and all(one["kind"] in names for one in several.values()) else None
    return names.get(saved[group].get("kind"))


def own_folders(arguments: Sequence[str]) -> list[str]:
    """The folders that ``--config-dir`` names."""
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--config-dir", "-cd", action="append", default=[])
    found: list[str] = parser.parse_known_args(list(arguments))[0].config_dir
    return found


def quoted(text: str) -> str:
    """A text as hydra takes it as a value, whatever is in it."""
    return QuotedString(text, Quote.single).with_quotes()
