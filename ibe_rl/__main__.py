"""The command ``ibe-rl``, also ``python -m ibe_rl``: one program for all that can be done with the package.

What is asked for is loaded only then, so that help comes at once.
"""

from __future__ import annotations

import os
import runpy
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from ibe_rl import __version__
from ibe_rl.config.limits import nearest
from ibe_rl.config.local_files import CONFIGS
from ibe_rl.config.manual import exit_with_page
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.installation import COMMAND, shipped, typed
from ibe_rl.runtime.printed import prepare_output, visible

DEMO = {"run": "runs/demo", "seed": "1", "context": "right", "viewer": "live"}
"""Settings of ``explain`` with which the demo explains its episode, unless others are given."""


def _train(arguments: Sequence[str]) -> None:
    """Train an agent that explains itself, and watch it live."""
    _script("train", arguments)


def _explain(arguments: Sequence[str]) -> None:
    """Let a trained agent explain an episode, or judge what it says."""
    _script("explain", arguments)


def _view(arguments: Sequence[str]) -> None:
    """Open the recordings of runs in the browser."""
    sys.argv = [sys.argv[0], *arguments]
    runpy.run_module("ibe_rl.viewer", run_name="__main__")


def _demo(arguments: Sequence[str]) -> None:
    """Let the small trained agent that comes along explain an episode."""
    exit_with_page(arguments, CONFIGS, "explain")
    given = {one.partition("=")[0] for one in arguments}
    if "run" not in given and not Path(DEMO["run"]).exists():
        _copied(shipped("demo"), Path(DEMO["run"]))
    _explain([*(f"{key}={value}" for key, value in DEMO.items() if key not in given), *arguments])


def _teach(arguments: Sequence[str]) -> None:
    """Train, and be the instructor yourself, on a page in the browser."""
    _train(["instructor=human", *arguments])


def _sweep(arguments: Sequence[str]) -> None:
    """Train several runs in parallel: seed=0,1,2, or sweep=CHOICE."""
    _train(["--multirun", *arguments])


def _minari(arguments: Sequence[str]) -> None:
    """Export a run's log as a Minari dataset, or import one."""
    sys.exit(load_app("minari")(arguments))


def _study(arguments: Sequence[str]) -> None:
    """Run a study with people: make, serve, pilot, power, register, withdraw, analyse."""
    sys.exit(load_app("study")(arguments))


COMMANDS: dict[str, Callable[[Sequence[str]], None]] = {
    one.__name__[1:]: one for one in (_train, _explain, _view, _demo, _teach, _sweep, _minari, _study)
}


def dispatch_command() -> None:
    """Do what the first argument names."""
    prepare_output()
    name, *arguments = sys.argv[1:] or ["--help"]
    if name in ("--help", "-h", "help"):
        sys.stdout.write(_overview())
    elif name == "--version":
        sys.stdout.write(f"{COMMAND} {__version__}\n")
    elif name in ("-sc", "--shell-completion"):
        _complete(arguments)
    elif name in COMMANDS:
        COMMANDS[name](arguments)
    else:
        sys.exit(f"error: {COMMAND} {visible(name)}: allowed is one of {', '.join(COMMANDS)}{nearest(name, COMMANDS)}")


def _overview() -> str:
    """What each command does."""
    lines = ["Agents that explain themselves while they learn, in their instructor's words.", ""]
    lines += [f"usage: {typed('COMMAND')} [SETTING=VALUE ...]", ""]
    lines += [f"  {name:<10}{one.__doc__}" for name, one in COMMANDS.items()]
    return "\n".join(
        [*lines, "", f"{typed('COMMAND --help')} tells what can be set; --version which version this is.", ""]
    )


def _complete(arguments: Sequence[str]) -> None:
    """Answer the shell's question for what can follow; the line it is about is in the environment, as hydra has it."""
    if not any(one.startswith("query=") for one in arguments):
        _compose("train", ["--shell-completion", *arguments])
        return
    _, command, rest = (*os.environ.get("COMP_LINE", "").split(" ", 2), "", "", "")[:3]
    if command not in COMMANDS:
        sys.stdout.write(("\n" if "query=fish" in arguments else " ").join(COMMANDS) + "\n")
        return
    os.environ["COMP_LINE"] = f"{COMMAND} {rest}"
    _compose("explain" if command in ("explain", "demo") else "train", ["--shell-completion", *arguments])


def _script(name: str, arguments: Sequence[str]) -> None:
    """Run a script as ``python NAME.py`` does; without it what needs no more than the settings."""
    exit_with_page(arguments, CONFIGS, name)
    if {"--shell-completion", "-sc"} & set(arguments):
        _compose(name, arguments)
        return
    sys.argv = [sys.argv[0], *arguments]
    runpy.run_path(str(shipped(f"{name}.py")), run_name="__main__")


def _compose(name: str, arguments: Sequence[str]) -> None:
    from ibe_rl.config.command_line import run_script  # imports hydra

    sys.argv = [sys.argv[0], *arguments]
    run_script(lambda _: None, CONFIGS, name)


def _copied(source: Path, to: Path) -> None:
    partial = to.with_name(f"{to.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(source, partial)
    partial.rename(to)


if __name__ == "__main__":
    dispatch_command()
