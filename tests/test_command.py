"""The command ibe-rl: what it does for each of its words, in this process."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

from ibe_rl import __main__ as command
from ibe_rl import __version__
from ibe_rl.runtime.installation import shipped


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The scripts and modules that are run, with their arguments."""
    found: list[list[str]] = []

    def instead(what: str, run_name: str) -> dict[str, Any]:
        assert run_name == "__main__"
        found.append([Path(what).name, *sys.argv[1:]])
        return {}

    monkeypatch.setattr(runpy, "run_path", instead)
    monkeypatch.setattr(runpy, "run_module", instead)
    return found


def type_command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, "argv", ["ibe-rl", *arguments])
    command.dispatch_command()


def test_every_word_runs_its_program(ran: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    for line in ("train seed=1", "explain run=here", "view here", "teach seed=1", "sweep seed=0,1"):
        type_command(monkeypatch, *line.split())
    assert ran == [
        ["train.py", "seed=1"],
        ["explain.py", "run=here"],
        ["ibe_rl.viewer", "here"],
        ["train.py", "instructor=human", "seed=1"],
        ["train.py", "--multirun", "seed=0,1"],
    ]


def test_the_demo_explains_a_copy_and_what_is_said_beside_it_wins(
    ran: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        type_command(monkeypatch, "demo", "viewer=off")
    assert ran == [["explain.py", "run=runs/demo", "seed=1", "context=right", "viewer=off"]] * 2
    theirs, copied = (
        sorted(path.relative_to(root) for path in root.rglob("*"))
        for root in (shipped("demo"), tmp_path / "runs" / "demo")
    )
    assert theirs == copied


def test_help_version_and_what_is_mistyped(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    type_command(monkeypatch)
    said = capsys.readouterr().out
    assert all(f"\n  {name} " in said for name in command.COMMANDS)
    type_command(monkeypatch, "--version")
    assert capsys.readouterr().out == f"ibe-rl {__version__}\n"
    with pytest.raises(SystemExit, match=r"^error: ibe-rl trian: allowed is one of train, .*; did you mean train\?$"):
        type_command(monkeypatch, "trian")
    with pytest.raises(SystemExit, match="0"):
        type_command(monkeypatch, "minari", "--help")
    assert "export" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("ibe-rl tr", "train explain view demo teach sweep minari study"),
        ("ibe-rl train viewer=", "viewer=file viewer=live viewer=off"),
        ("ibe-rl explain predictor=e", "predictor=ensemble"),
    ],
)
@pytest.mark.parametrize(("shell", "between"), [("bash", " "), ("fish", "\n")])
def test_the_shell_is_told_what_can_follow(
    line: str,
    expected: str,
    shell: str,
    between: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COMP_LINE", line)
    type_command(monkeypatch, "-sc", f"query={shell}")
    assert capsys.readouterr().out == expected.replace(" ", between) + "\n"


@pytest.mark.parametrize("command_line", [["train", "--shell-completion"], ["--shell-completion"]])
@pytest.mark.parametrize(
    ("shell", "line"),
    [
        ("bash", "-F hydra_bash_completion ibe-rl"),
        ("zsh", "-F hydra_bash_completion ibe-rl"),  # by zsh's bashcompinit
        ("fish", "complete -c ibe-rl -x -a '(hydra_fish_completion)'"),
    ],
)
def test_each_shell_learns_to_complete(
    command_line: list[str],
    shell: str,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    type_command(monkeypatch, *command_line, f"install={shell}")
    assert line in capsys.readouterr().out
