"""Commands that are printed work in the way the program was started, and shipped files are found."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ibe_rl.runtime import installation
from ibe_rl.runtime.installation import installed, pasted, shipped, started_again, typed

PACKAGE = Path(installation.__file__).parents[1]
PYTHON = Path(sys.executable)


def started_as(patch: pytest.MonkeyPatch, program: str) -> None:
    patch.setattr(installation, "_STARTED", Path(program))
    patch.setenv("PATH", str(PYTHON.parent))


def test_in_the_repository_files_lie_beside_the_package() -> None:
    assert shipped("train.py") == PACKAGE.parent / "train.py"
    assert (shipped("configs") / "train.yaml").is_file()


def test_a_script_names_scripts_wherever_one_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    started_as(monkeypatch, "train.py")
    monkeypatch.chdir(PACKAGE.parent)
    assert typed("explain") == "python explain.py"
    assert typed("view") == "python -m ibe_rl.viewer"
    assert typed("minari") == "python -m ibe_rl.apps.minari"
    monkeypatch.chdir(PACKAGE)
    assert typed("explain") == "python ../explain.py"
    assert started_again("train") == [sys.executable, str(PACKAGE.parent / "train.py")]


def test_what_is_pasted_works_in_any_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    started_as(monkeypatch, "train.py")
    monkeypatch.chdir(tmp_path)
    assert pasted("explain", "run=/a b") == f"python {PACKAGE.parent / 'explain.py'} 'run=/a b'"
    assert pasted("view", "/it's") == "python -m ibe_rl.viewer '/it'\"'\"'s'"
    monkeypatch.setenv("PATH", "/nowhere")
    assert pasted("view", "/a") == f"{PYTHON.with_name('python')} -m ibe_rl.viewer /a"


def test_the_command_names_itself(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = tmp_path / "bin" / "ibe-rl"
    program.parent.mkdir()
    program.touch(mode=0o755)
    monkeypatch.setattr(sys, "executable", str(program.with_name("python")))
    started_as(monkeypatch, str(program))
    monkeypatch.chdir(tmp_path)
    assert typed("train") == "bin/ibe-rl train"
    monkeypatch.setenv("PATH", str(program.parent))
    assert typed("train") == "ibe-rl train"
    assert started_again("train") == [str(program.with_name("python")), str(program), "train"]


def test_the_module_names_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    started_as(monkeypatch, str(PACKAGE / "__main__.py"))
    assert typed("view") == "python -m ibe_rl view"
    assert started_again("explain") == [sys.executable, "-m", "ibe_rl", "explain"]


def test_where_it_is_installed_scripts_are_not_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    started_as(monkeypatch, "a_script_of_theirs.py")
    monkeypatch.setattr(installation, "_INSTALLED", tmp_path)
    assert shipped("demo") == tmp_path / "demo"
    assert typed("explain") == f"{installed('ibe-rl')} explain"
