"""A study with people, from stimuli to statistics.

python -m ibe_rl.apps.study make run=DIR out=STUDY     stimuli, study.yaml and texts, into a folder of one's own
python -m ibe_rl.apps.study serve STUDY                its pages; on this machine alone unless told otherwise
python -m ibe_rl.apps.study bundle STUDY               its pages as files for any web host, for N persons
python -m ibe_rl.apps.study collect STUDY FILE         what people answered to a bundle, into answers.sqlite
python -m ibe_rl.apps.study pilot STUDY people=60      simulated people through the real pages
python -m ibe_rl.apps.study power STUDY                how many people each comparison needs
python -m ibe_rl.apps.study register STUDY             a registration filled from study.yaml, to complete and deposit
python -m ibe_rl.apps.study withdraw STUDY             delete somebody who asks for it later: participant=ID
python -m ibe_rl.apps.study analyse STUDY              table, figures, report.html, a row for each answer
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from textwrap import wrap
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import yaml

from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.settings import CODES, StudySettings
from ibe_rl.apps.study.shipped_texts import to_fill_in
from ibe_rl.config.declared import as_typed, declared
from ibe_rl.config.limits import nearest
from ibe_rl.config.manual import PAGE_COLUMNS
from ibe_rl.runtime.installation import typed
from ibe_rl.runtime.printed import prepare_output, visible
from ibe_rl.types import ConfigError

_HERE = "ibe_rl.apps.study"
FUNCTIONS = {
    "make": f"{_HERE}.make:make",
    "serve": f"{_HERE}.serving:serve",
    "bundle": f"{_HERE}.bundle:make_bundle",
    "collect": f"{_HERE}.collecting:collect_answers",
    "pilot": f"{_HERE}.pilot:pilot",
    "power": f"{_HERE}.power:power",
    "register": f"{_HERE}.registration:write_registration",
    "withdraw": f"{_HERE}.withdrawal:withdraw_participant",
    "analyse": f"{_HERE}.analysis:analyse",
}
"""StudyCommand to the function that does it; its arguments are the settings of the command."""
_MAKE, _AND_SERVE = "make", "serve"
"""With ``make``: serve the study as soon as it is made."""
_KINDS: dict[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "a text",
    Path: "a path",
    tuple[float, float]: "two numbers with a comma between",
}


@dataclass(frozen=True)
class StudyCommand:
    """One of the commands.

    Attributes:
        name: of it.
        function: that does it.
    """

    name: str
    function: Callable[..., Any]

    @property
    def paths(self) -> list[str]:
        """The arguments that are given without their names: the folder of the study, and what is positional only."""
        given = inspect.signature(self.function).parameters.values()
        after = [one.name.upper() for one in [*given][1:] if one.kind == one.POSITIONAL_ONLY]
        return [] if self.name == _MAKE else ["STUDY", *after]

    @property
    def parameters(self) -> dict[str, inspect.Parameter]:
        """What can be set: the arguments of the function that have a value which can be typed."""
        given = list(inspect.signature(self.function).parameters.values())
        found = given[len(self.paths) :]
        return {one.name: one for one in found if one.kind != one.VAR_KEYWORD and {*self._types(one.name)} & {*_KINDS}}

    @property
    def free(self) -> bool:
        """Whether it takes the settings of study.yaml, too."""
        kinds = [one.kind for one in inspect.signature(self.function).parameters.values()]
        return inspect.Parameter.VAR_KEYWORD in kinds

    def _types(self, name: str) -> list[Any]:
        hint = get_type_hints(self.function)[name]
        parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
        return [one for one in parts if one in (*_KINDS, NoneType)]

    def read(self, argument: str) -> tuple[str, Any]:
        """A setting, ``KEY=VALUE``.

        Raises:
            ConfigError: naming the key, the value and what is allowed.
        """
        key, equals, text = argument.partition("=")
        known = list(dict.fromkeys([*self.parameters, *(one.key for one in declared(StudySettings) if self.free)]))
        if not equals or (key not in known and not (self.free and key.startswith("completion_codes."))):
            raise ConfigError(f"{argument}: no such setting; allowed are {', '.join(known)}{nearest(key, known)}")
        if key not in self.parameters:
            return key, _of_study(text)
        return key, _as_one_of(self._types(key), key, text)

    def page(self) -> str:
        """What it does and what can be set."""
        paths = "".join(f"{one} " for one in self.paths)
        about = inspect.getdoc(self.function) or ""
        lines = [about.partition("\n\n")[0], "", f"usage: {typed('study')} {self.name} {paths}[KEY=VALUE ...]", ""]
        meaning = _meanings_of_arguments(about)
        for key, one in self.parameters.items():
            shown = "" if one.default is one.empty else _typed_value(one.default)
            lines += _row(f"{key}={shown}", meaning.get(key, ""))
        if self.free:
            lines += [*_row(f"{_AND_SERVE}=false", "serve the study as soon as it is made"), ""]
            lines += ["and the settings of study.yaml, which can be changed there later:"]
            for each in declared(StudySettings):
                lines += [] if each.key in self.parameters else _row(f"{each.key}={each.default}", each.meaning, 40)
        return "\n".join(lines) + "\n"


def _typed_value(value: Any) -> str:
    return ",".join(map(as_typed, value)) if isinstance(value, tuple) else as_typed(value)


def _row(setting: str, meaning: str, room: int = 22) -> list[str]:
    """A line of a page, or some, with what a setting means."""
    first = f"  {setting} ".ljust(room + 2)
    return wrap(meaning, PAGE_COLUMNS, initial_indent=first, subsequent_indent=" " * (room + 2)) or [first.rstrip()]


def study_command(arguments: Sequence[str] | None = None) -> int:
    """Do what the first argument names."""
    prepare_output()
    name, *rest = (sys.argv[1:] if arguments is None else [*arguments]) or ["--help"]
    try:
        if name in ("--help", "-h", "help"):
            sys.stdout.write(overview())
            return 0
        _do(command_of(name), rest)
    except ConfigError as error:
        sys.exit(f"error: {visible(' '.join(str(error).split()))}")
    except KeyboardInterrupt:
        return 130
    return 0


def overview() -> str:
    """What each command does."""
    lines = ["A study with people, from stimuli to statistics.", "", f"usage: {typed('study')} COMMAND ...", ""]
    about = {
        line.split()[3]: line.split("  ")[-1] for line in (__doc__ or "").splitlines() if line.startswith("python")
    }
    lines += [f"  {name:<10}{about[name].strip()}" for name in FUNCTIONS]
    return "\n".join([*lines, "", f"{typed('study')} COMMAND --help tells what can be set.", ""])


def command_of(name: str) -> StudyCommand:
    """The command of a name, loaded.

    Raises:
        ConfigError: if there is none, or it cannot be loaded.
    """
    if name not in FUNCTIONS:
        raise ConfigError(f"study {name}: allowed is one of {', '.join(FUNCTIONS)}{nearest(name, FUNCTIONS)}")
    module, _, function = FUNCTIONS[name].partition(":")
    try:
        return StudyCommand(name, getattr(import_module(module), function))
    except ImportError as error:
        raise ConfigError(f"study {name}: needs what is not installed ({error}); allowed is the extra study") from None


def _do(command: StudyCommand, arguments: Sequence[str]) -> None:
    if {"--help", "-h"} & set(arguments):
        sys.stdout.write(command.page())
        return
    paths = [one for one in arguments if "=" not in one] if command.paths else []
    if len(paths) != len(command.paths):
        after = "".join(f", {one}" for one in command.paths[1:])
        raise ConfigError(f"study {command.name}: allowed is the folder of one study{after}, and settings KEY=VALUE")
    settings = [one for one in arguments if one not in paths]
    if command.name == _MAKE:
        _make(command, settings)
        return
    given = dict(map(command.read, settings))
    for key, one in command.parameters.items():
        if one.default is one.empty and key not in given:
            raise ConfigError(f"{key}=: has to be given with study {command.name}")
    done = command.function(*map(Path, paths), **given)
    if isinstance(done, str | Path):
        sys.stdout.write(f"{visible(str(done))}\n")


def _make(command: StudyCommand, settings: Sequence[str]) -> None:
    """Make a study, say what is left to do, and serve it if that is asked for."""
    after = [one for one in settings if one.partition("=")[0] == _AND_SERVE]
    at_once = [_as_one_of([bool], _AND_SERVE, one.partition("=")[2]) for one in after]
    folder: Path = command.function(**dict(command.read(one) for one in settings if one not in after))
    left = to_fill_in(folder)
    sys.stdout.write(f"study: {visible(str(folder))}\n")
    if left:
        sys.stdout.write(f"  what only you can say is still to be filled in, where it says [[…]]: {', '.join(left)}\n")
    sys.stdout.write(f"  serve it: {typed('study')} serve {visible(str(folder))}\n")
    sys.stdout.flush()
    if any(at_once):
        served = open_study(folder).settings
        command_of("serve").function(folder, codes=served.quota if served.recruiter == CODES else 0)


def _of_study(text: str) -> Any:
    """A value of study.yaml as it is typed; several are separated by commas."""
    value = _parsed(text)
    return [one.strip() for one in value.split(",")] if isinstance(value, str) and "," in value else value


def _parsed(text: str) -> Any:
    try:
        return yaml.safe_load(text) if text else ""
    except yaml.YAMLError:
        return text


def _as_one_of(types: Sequence[Any], key: str, text: str) -> Any:
    value = _parsed(text)
    if value is None and NoneType in types:
        return None
    for kind in types:
        if kind in (str, Path) and (text or kind is str):
            return kind(text)
        if get_origin(kind) is tuple and (pair := _numbers(text)) is not None:
            return pair
        if type(value) is kind or (kind is float and type(value) is int):
            return kind(value)
    allowed = " or ".join(dict.fromkeys(_KINDS.get(one, "null") for one in types))
    raise ConfigError(f"{key}={text}: allowed is {allowed}")


def _numbers(text: str) -> tuple[float, ...] | None:
    """Two numbers with a comma between; None if it is something else."""
    try:
        found = tuple(float(one) for one in text.split(","))
    except ValueError:
        return None
    return found if len(found) == 2 else None


def _meanings_of_arguments(about: str) -> Mapping[str, str]:
    """From the ``Args:`` of a docstring: name to its first sentence."""
    _, _, section = about.partition("Args:\n")
    return dict(_arguments(section.partition("\n\n")[0]))


def _arguments(section: str) -> Iterator[tuple[str, str]]:
    for found in re.finditer(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", section, re.MULTILINE):
        yield found[1], " ".join(found[2].split())
