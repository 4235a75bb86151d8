"""Translate command-line arguments into hydra overrides."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import Quote, QuotedString

from ibe_rl.config.kinds import GROUPS, SEVERAL, KindFiles
from ibe_rl.config.limits import typed_names
from ibe_rl.config.local_files import config_folders
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.storage.run_folder import CONFIG, read_yaml

OF_A_TRAINING = re.compile(r"(env|mapping)[.=]")
"""Settings that ``explain.py`` passes on when it creates an external agent's run folder."""


def as_hydra_reads(arguments: Sequence[str], script: str, configs: Path) -> list[str]:
    """Translate the arguments of a script into hydra overrides.

    Args:
        arguments: as typed.
        script: "train" or "explain".
        configs: folder of the hydra files.
    """
    renamed = [_renamed(one, script) for one in arguments]
    if script == "explain":
        return _passed_on(renamed)
    at = next((place for place, one in enumerate(renamed) if one.startswith("resume=")), len(renamed))
    renamed[at:at] = _resumed_choices(renamed, configs)  # next to it: hydra refuses settings on both sides of an option
    return renamed


def _renamed(argument: str, script: str) -> str:
    key, equals, value = argument.partition("=")
    field = typed_names(ExplainConfig).get(key) if script == "explain" else None
    return f"{field}={value}" if equals and field else argument


def _passed_on(arguments: list[str]) -> list[str]:
    """Pass settings of a training on as one value: ``explain.py`` cannot compose them itself."""
    passed = [one for one in arguments if OF_A_TRAINING.match(one)]
    if not passed:
        return arguments
    at = arguments.index(passed[0])
    rest = [one for one in arguments if one not in passed]
    return [*rest[:at], f"guest_settings=[{','.join(map(quoted, passed))}]", *rest[at:]]


def _resumed_choices(arguments: Sequence[str], configs: Path) -> list[str]:
    """The group choices of a resumed run, from which hydra knows the settings of their kinds."""
    resumed = [one.partition("=")[2].strip("'") for one in arguments if one.startswith("resume=")]
    try:
        saved = read_yaml(Path(resumed[0]) / CONFIG)
        given = {one.partition("=")[0] for one in arguments}
        folders = [KindFiles("", str(folder)) for folder in reversed(config_folders(configs, arguments))]
        return [
            f"{group}={chosen}"
            for group in GROUPS
            if group not in given and (chosen := _chosen(group, saved, folders)) is not None
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        return []  # resuming the run reports the error


def _chosen(group: str, saved: dict[str, Any], folders: Sequence[KindFiles]) -> str | None:
    """The choice of a group that matches a saved config, as on the command line; None if there is none."""
    names = {kind: name for folder in folders for kind, name in folder.kinds(group).items()}
    if group in SEVERAL:
        several = saved.get(SEVERAL[group], {})
        return f"[{','.join(several)}]" if several and all(one["kind"] in names for one in several.values()) else None
    return names.get(saved[group].get("kind"))


def quoted(text: str) -> str:
    """Quote a text so that hydra reads it as one value."""
    return QuotedString(text, Quote.single).with_quotes()
