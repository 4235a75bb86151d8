"""The command line of a study: settings from the arguments of functions, pages of help, and what is mistyped."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from own_study import write_study

from ibe_rl import __main__ as command
from ibe_rl.apps.study import commands, serving
from ibe_rl.apps.study.commands import StudyCommand, command_of, overview, study_command
from ibe_rl.config.manual import PAGE_COLUMNS

CALLS: list[tuple[Path, dict[str, Any]]] = []


def measure(
    folder: Path,
    people: int = 60,
    speed: float = 1.0,
    note: str | None = None,
    deep: bool = False,
    into: Path | None = None,
    between: tuple[float, float] = (0.0, 1.0),
    say: Callable[[str], None] | None = None,
) -> str:
    """Measure something.

    More about it.

    Args:
        folder: of the study.
        people: how many,
            in words.
        speed: of each.
        note: .
        deep: whether.
        into: where to.
        between: lowest and highest.
        say: prints a line.

    Returns:
        a line.
    """
    told = {"people": people, "speed": speed, "note": note, "deep": deep, "into": into, "between": between, "say": say}
    CALLS.append((folder, told))
    return "measured"


@pytest.fixture(autouse=True)
def measured(monkeypatch: pytest.MonkeyPatch) -> None:
    CALLS.clear()
    monkeypatch.setitem(commands.FUNCTIONS, "power", f"{__name__}:measure")


def test_settings_are_the_arguments_of_the_function(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["power", "mine", "people=20", "speed=2", "note=a, b", "deep=true", "into=there", "between=0.5,1"]
    assert study_command(line) == 0
    settings = {"people": 20, "speed": 2.0, "note": "a, b", "deep": True, "into": Path("there")}
    [call] = CALLS
    assert call == (Path("mine"), {**settings, "between": (0.5, 1.0), "say": None})
    assert capsys.readouterr().out == "measured\n"
    study_command(["power", "note=null", "mine"])
    assert CALLS[1][1]["note"] is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "srve",
            "study srve: allowed is one of make, serve, bundle, collect, pilot, .*; did you mean serve",
        ),
        ("power", "study power: allowed is the folder of one study, and settings KEY=VALUE"),
        ("power one other", "study power: allowed is the folder of one study"),
        ("power mine poeple=3", "poeple=3: no such setting; allowed are people, .*; did you mean people"),
        ("power mine say=3", "say=3: no such setting"),
        ("power mine people=few", "people=few: allowed is a whole number"),
        ("power mine people=1.5", "people=1.5: allowed is a whole number"),
        ("power mine people=", "people=: allowed is a whole number"),
        ("power mine between=1", "between=1: allowed is two numbers with a comma between"),
        ("power mine between=1,a", "between=1,a: allowed is two numbers"),
        ("power mine deep=3", "deep=3: allowed is true or false"),
        ("power mine deep=[", r"deep=\[: allowed is true or false"),
        ("make runs=here", "runs=here: no such setting; allowed are run, .*trials.task, .*; did you mean run"),
        ("make here", "here: no such setting"),
        ("make trials.tsk=landing", "did you mean trials.task"),
        ("make serve=maybe", "serve=maybe: allowed is true or false"),
        ("collect mine", "study collect: allowed is the folder of one study, FILE, and settings KEY=VALUE"),
        ("bundle mine people=3 out=there", "collect=: has to be given with study bundle"),
        ("withdraw mine", "participant=: has to be given with study withdraw"),
        ("serve nowhere", "study=nowhere: it has no study.yaml"),
    ],
)
def test_what_is_mistyped_is_named(line: str, message: str) -> None:
    with pytest.raises(SystemExit, match=f"^error: .*{message}"):
        study_command(line.split())


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(commands.FUNCTIONS, "pilot", "nowhere.at_all:pilot")
    with pytest.raises(SystemExit, match=r"study pilot: needs what is not installed .No module named 'nowhere'"):
        study_command(["pilot", "mine"])


def test_help_says_what_can_be_set(capsys: pytest.CaptureFixture[str]) -> None:
    study_command(["--help"])
    assert capsys.readouterr().out == overview()
    assert all(f"\n  {name} " in overview() for name in commands.FUNCTIONS)
    study_command(["power", "--help"])
    page = capsys.readouterr().out
    assert page.startswith("Measure something.\n\nusage: ")
    assert "power STUDY [KEY=VALUE ...]" in page
    assert "\n  people=60             how many, in words.\n" in page
    assert "\n  note=null             .\n" in page
    assert "say=" not in page
    study_command(["make", "-h"])
    page = capsys.readouterr().out
    assert "\n  run=null " in page
    assert "\n  trials.each_arm=12 " in page
    assert page.count("\n  seed=") == 1
    assert max(map(len, page.splitlines()[3:])) <= PAGE_COLUMNS


def test_real_commands_have_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    assert {name: command_of(name).page()[:5] for name in commands.FUNCTIONS}.keys() == commands.FUNCTIONS.keys()
    assert "reliance" in command_of("pilot").parameters
    assert {*command_of("bundle").parameters} == {"out", "collect", "people", "address", "pilot"}
    assert "collect STUDY FILE [KEY=VALUE ...]" in command_of("collect").page()
    assert command_of("serve").function is serving.serve
    assert {"host", "port", "admin_port"} <= {*command_of("serve").parameters}
    assert {"run", "out", "other", "until", "flights", "seed"} <= {*command_of("make").parameters}


def test_a_study_is_made_and_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[Any] = []

    def make(run: str | None = None, **study: Any) -> Path:
        told.append((run, study))
        return write_study(tmp_path / "study")

    def serve(folder: Path, codes: int = 0) -> None:
        told.append((folder, codes))

    made = {"make": StudyCommand("make", make), "serve": StudyCommand("serve", serve)}
    monkeypatch.setattr(commands, "command_of", made.__getitem__)
    study_command(["make", "run=demo", "arms=none,ibe", "quota=6", "completion_codes.finished=C1", "serve=true"])
    study = {"arms": ["none", "ibe"], "quota": 6, "completion_codes.finished": "C1"}
    assert told == [("demo", study), (tmp_path / "study", 6)]
    said = capsys.readouterr().out
    assert f"study: {tmp_path / 'study'}\n" in said
    assert "fill in" not in said


def test_what_is_left_to_fill_in_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_study(tmp_path / "study")
    (folder / "texts/en/consent.md").write_text("We are [[who]].")
    monkeypatch.setattr(commands, "command_of", lambda name: StudyCommand(name, lambda **_: folder))
    study_command(["make"])
    assert "still to be filled in, where it says [[…]]: texts/en/consent.md\n" in capsys.readouterr().out


def test_the_installed_command_and_the_module_do_the_same(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["ibe-rl", "study", "power", "mine"])
    with pytest.raises(SystemExit, match="0"):
        command.dispatch_command()
    monkeypatch.setattr(sys, "argv", ["study"])
    with pytest.raises(SystemExit, match="0"):
        runpy.run_module("ibe_rl.apps.study", run_name="__main__")
    assert capsys.readouterr().out == "measured\n" + overview()


def test_ctrl_c_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "command_of", lambda name: StudyCommand(name, stop))
    assert study_command(["serve", "mine"]) == 130
