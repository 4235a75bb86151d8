"""The pages of ``--help``: an overview of a command, and every setting of a group."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import Any, get_type_hints

import yaml

from ibe_rl.config.declared import DeclaredSetting, as_typed, declared
from ibe_rl.config.limits import nearest
from ibe_rl.config.local_files import config_folders
from ibe_rl.config.settings import ExplainConfig, ListenerConfig, LoggerConfig, MetricConfig, TrainConfig
from ibe_rl.runtime.installation import shipped, typed
from ibe_rl.types import ConfigError

ROOTS: dict[str, type] = {"train": TrainConfig, "explain": ExplainConfig}
MATTER = {
    "train": ("total_frames", "seed", "run_dir", "refresh_every_frames", "mapping.n_clusters"),
    "explain": ("run", "task", "seed", "context", "agent"),
}
"""The settings that matter most."""
TOP_LEVEL = "settings"
"""The page of settings that are in no group."""
PAGE_COLUMNS, LISTED = 100, 6
"""Columns, and how many choices of a group the overview has a line for."""


def page_asked_for(arguments: Sequence[str], configs: Path, script: str) -> str | None:
    """The page that ``--help`` or ``--help GROUP`` asks for; None if there is no such argument.

    Args:
        arguments: of the command line.
        configs: folder of the config files of the script.
        script: "train" or "explain".

    Raises:
        ConfigError: if there is no page of that name.
    """
    at = next((place for place, one in enumerate(arguments) if one.partition("=")[0] in ("--help", "-h")), None)
    if at is None:
        return None
    following = [one for one in arguments[at + 1 : at + 2] if re.fullmatch(r"\w+", one)]
    topic = arguments[at].partition("=")[2] or next(iter(following), "")
    pages = Pages(script, config_folders(configs, arguments))
    return pages.of_group(topic) if topic else pages.overview()


def exit_with_page(arguments: Sequence[str], configs: Path, script: str) -> None:
    """End the program with the page that is asked for, or the error if there is none; nothing if none is asked for."""
    try:
        page = page_asked_for(arguments, configs, script)
    except ConfigError as error:
        sys.exit(f"error: {error}")
    if page is not None:
        sys.stdout.write(page)
        sys.exit(0)


class Pages:
    """The pages of a command.

    Args:
        script: "train" or "explain".
        folders: with config files, the ones that win first.
    """

    def __init__(self, script: str, folders: Sequence[Path]):
        self._script, self._folders = script, folders
        self._root = _read(next(path for folder in folders if (path := folder / f"{script}.yaml").exists()))
        self._chosen = _chosen(self._root)
        self._schemas: dict[str, Any] = {
            item: hint for item, hint in _hints(ROOTS[script]).items() if is_dataclass(hint)
        }
        several = {"listener": ListenerConfig, "logger": LoggerConfig, "metric": MetricConfig}
        self._schemas |= {group: schema for group, schema in several.items() if group in self._chosen}

    def overview(self) -> str:
        """What the command does, the settings that matter, the choices, and where the rest is."""
        command = typed(self._script)
        lines = [_purpose(self._script), "", f"usage: {command} [SETTING=VALUE ...] [GROUP=CHOICE ...]", "", "settings"]
        rows = {one.key: one for one in self._of_root()}
        lines += [f"  {key + '=' + str(rows[key].default):<34}{rows[key].meaning}" for key in MATTER[self._script]]
        lines += ["", "choices (* is the default)"]
        lines += [line for group in self._chosen for line in self._summary(group)]
        others = [one for one in (*self._schemas, TOP_LEVEL) if one not in self._chosen]
        lines += ["", "more"]
        lines += wrap(
            f"{'--help GROUP':<27}every setting of a group, or of {', '.join(others)}", PAGE_COLUMNS, **_INDENTED
        )
        lines += [f"  {key:<27}{text}" for key, text in _MORE[self._script]]
        return "\n".join(lines) + "\n"

    def of_group(self, group: str) -> str:
        """The choices of a group, and every setting in it.

        Raises:
            ConfigError: if there is no such group.
        """
        known = (*self._chosen, *self._schemas, TOP_LEVEL)
        if group not in known:
            allowed = f"allowed is one of {', '.join(dict.fromkeys(known))}"
            raise ConfigError(f"--help {group}: {allowed}{nearest(group, known)}")
        lines = []
        if group in self._chosen:
            marked = " (* is the default)" if self._chosen[group] else ""
            lines += [f"{group}=CHOICE{marked}", *self._choices_with_values(group), ""]
        return "\n".join([*lines, *self._settings_of(group)]).rstrip() + "\n"

    def _settings_of(self, group: str) -> Iterator[str]:
        if group == TOP_LEVEL:
            yield from ("SETTING=VALUE", *_rows(one for one in self._of_root() if "." not in one.key))
        if (schema := self._schemas.get(group)) is None:
            return
        shared = declared(schema)
        if shared:
            yield from (f"{group}.SETTING=VALUE: {_first_line(schema)}", *_rows(shared), "")
        known = {(one.key, one.default) for one in shared}
        for own, names in self._schemas_of_choices(group).items():
            if further := [one for one in declared(own) if (one.key, one.default) not in known]:
                choices = f"{group}={'|'.join(names)}" if len(names) <= LISTED else f"the choices of {group}"
                yield from (f"with {choices} also: {_first_line(own)}", *_rows(further), "")

    def _schemas_of_choices(self, group: str) -> dict[type, list[str]]:
        """The settings that some choices have beyond those of the group, with the names of these choices."""
        from ibe_rl.config.kinds import GROUPS, settings_of  # imports hydra, and the kinds torch

        found: dict[type, list[str]] = {}
        for name, path in self._choices(group).items() if group in GROUPS else ():
            values = _read(path)
            own = settings_of(group, (values.get(group) or values).get("kind"))
            if own is not self._schemas[group]:
                found.setdefault(own, []).append(name)
        return found

    def _choices(self, group: str) -> dict[str, Path]:
        paths = [path for folder in reversed(self._folders) for path in sorted((folder / group).glob("*.yaml"))]
        found = {path.stem: path for path in paths}
        first = self._chosen.get(group)
        return {name: found[name] for name in sorted(found, key=lambda name: (name != first, name))}

    def _summary(self, group: str) -> Iterator[str]:
        choices, first = self._choices(group), self._chosen[group]
        listed = (
            list(choices)
            if len(choices) <= LISTED and group not in ("logger", "sweep")
            else [first]
            if first in choices
            else []
        )
        rest = [name for name in choices if name not in listed]
        heads = [*listed, *([] if choices else ["(none yet; yours: ./configs/" + group + "/NAME.yaml)"])]
        for number, name in enumerate(heads):
            about = first_comment(choices[name]) if name in choices else ""
            mark = "*" if name == first else " "
            yield f"  {'' if number else group:<12}{mark} {name:<18}{about}".rstrip()
        if rest:
            label = f"  {'' if heads else group:<12}  "
            yield from wrap(
                ("also " if heads else "") + ", ".join(rest),
                PAGE_COLUMNS,
                initial_indent=label,
                subsequent_indent=" " * 16,
            )

    def _choices_with_values(self, group: str) -> Iterator[str]:
        for name, path in self._choices(group).items():
            yield f"  {'*' if name == self._chosen[group] else ' '} {name:<18}{first_comment(path)}".rstrip()
            values = ", ".join(_flat(_read(path), group))
            yield from wrap(values, PAGE_COLUMNS, initial_indent=" " * 22, subsequent_indent=" " * 22)
        if group in ("listener", "logger", "metric"):
            yield f"    several: {group}=[NAME,NAME]"

    def _of_root(self) -> list[DeclaredSetting]:
        """The settings of the root config, with the defaults of its file."""
        told = {key: _NOW.sub("DATE_TIME", as_typed(value)) for key, value in self._root.items()}
        return [replace(one, default=told.get(one.key, one.default)) for one in declared(ROOTS[self._script])]


_INDENTED: dict[str, Any] = {"initial_indent": "  ", "subsequent_indent": " " * 29}
_NOW = re.compile(r"\$\{now:.*?\}")
_MORE = {
    "train": (
        ("--cfg job", "all values of a run, without starting it"),
        ("-m seed=0,1,2", "several runs in parallel; -m sweep=CHOICE: one of the ready sweeps"),
        ("resume=RUN", "go on with a run that was stopped or killed"),
        ("./configs/GROUP/NAME.yaml", "a choice of your own"),
    ),
    "explain": (
        ("--cfg job", "all values, without doing anything"),
        ("sweep=DIR", "report on the runs of a sweep"),
        ("agent=FILE env=CHOICE", "explain an agent trained elsewhere"),
    ),
}


def first_comment(path: Path) -> str:
    """The first sentence of a config file's first comment: what the choice is."""
    comments = [line.lstrip("# ") for line in path.read_text().splitlines() if line.startswith("#")]
    text = next((one for one in comments if not one.startswith("@package")), "")
    return text.partition(". ")[0].rstrip(".")


def _read(path: Path) -> dict[str, Any]:
    return yaml.safe_load(path.read_text()) or {}


def _chosen(root: dict[str, Any]) -> dict[str, str | None]:
    """The groups of a root config and the choice of each, None without one."""
    entries = [one for one in root["defaults"] if isinstance(one, dict)]
    named = {key: value for one in entries for key, value in one.items() if not key.startswith("override ")}
    return {key: value or None for key, value in named.items()}


def _hints(schema: type) -> dict[str, Any]:
    hints = get_type_hints(schema)
    return {item.name: hints[item.name] for item in fields(schema)}


def _purpose(script: str) -> str:
    text = ast.get_docstring(ast.parse(shipped(f"{script}.py").read_text())) or ""
    return text.partition("\n")[0]


def _first_line(schema: type) -> str:
    return (schema.__doc__ or "").partition("\n")[0].rstrip(".").replace("``", "")


def _rows(settings: Any) -> Iterator[str]:
    for one in settings:
        default = "must be given" if one.default is None else f"default {one.default}"
        yield f"  {one.key:<26}{default}; {one.allowed}"
        if one.meaning:
            yield from wrap(one.meaning, PAGE_COLUMNS, initial_indent=" " * 28, subsequent_indent=" " * 28)


def _flat(values: dict[str, Any], group: str, prefix: str = "") -> Iterator[str]:
    """What a file sets, as it would be typed."""
    for key, value in values.items():
        full = f"{prefix}{key}"
        if isinstance(value, dict) and value:
            yield from _flat(value, group, f"{full}.")
        elif key not in ("kind", "defaults", "mode") and not full.startswith("env.task"):
            yield f"{full.removeprefix(f'{group}.').removeprefix('hydra.sweeper.params.')}={as_typed(value)}"
