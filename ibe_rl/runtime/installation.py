"""How the program is installed and started: the files that come with it, and commands as a person types them."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from ibe_rl.runtime.printed import for_shell

COMMAND = "ibe-rl"
_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "shipped"
"""Where a wheel has what lies beside the package in the repository; see pyproject.toml."""
_STARTED = Path(sys.argv[0])  # runpy changes it later
_MODULES = {"view": "ibe_rl.viewer", "minari": "ibe_rl.apps.minari", "study": "ibe_rl.apps.study"}
"""Commands that have no script in the repository."""


def shipped(name: str) -> Path:
    """A file or folder that comes with the package: ``configs``, ``demo``, ``train.py`` or ``explain.py``."""
    return (_INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent) / name


def installed(program: str) -> str:
    """A program of this Python environment: its name if the shell finds it, else its path."""
    path = Path(sys.executable).parent / program
    found = shutil.which(program)
    return program if found is not None and Path(found) == path else str(path)


def opened_with(program: str, file: Path) -> str:
    """A command of another program of this Python environment on a file, for any shell in any folder."""
    return f"{for_shell(installed(program))} {for_shell(str(file.absolute()))}"


def typed(command: str) -> str:
    """How to type a command of ``ibe-rl`` in the working directory, in the way this program was started."""
    words = (os.path.relpath(one) if Path(one).is_absolute() else one for one in _words(command))
    return " ".join(map(for_shell, words))


def pasted(command: str, *arguments: str) -> str:
    """A whole command of ``ibe-rl`` for any shell in any folder, in the way this program was started."""
    return " ".join(map(for_shell, [*_words(command), *arguments]))


def _words(command: str) -> list[str]:
    if _is_module():
        return [installed("python"), "-m", _PACKAGE.name, command]
    if _is_command() or _INSTALLED.is_dir():
        return [installed(COMMAND), command]
    if command in _MODULES:
        return [installed("python"), "-m", _MODULES[command]]
    return [installed("python"), str(shipped(f"{command}.py"))]


def started_again(command: str) -> list[str]:
    """The beginning of a command line that starts ``train`` or ``explain`` as this program was started."""
    if _is_module():
        return [sys.executable, "-m", _PACKAGE.name, command]
    return [sys.executable, *([str(_STARTED), command] if _is_command() else [str(shipped(f"{command}.py"))])]


def _is_command() -> bool:
    return _STARTED.name == COMMAND


def _is_module() -> bool:
    return _STARTED == _PACKAGE / "__main__.py"
