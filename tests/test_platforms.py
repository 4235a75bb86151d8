"""What is said of the systems and Pythons that are not here."""

import subprocess
from typing import Any

import pytest

from benchmarks import platforms
from benchmarks.platforms import SYSTEMS, VERSIONS, check, main, unpinned

LINUX, MACOS = SYSTEMS


def test_names_are_compared_as_registries_do():
    pins = "Box2D==2.3.10\ntyping_extensions==4.16.0\nnumpy==2.4.6\n"
    assert unpinned("box2d==2.3.10\ntyping-extensions==4.16.0\n", pins) == []
    resolved = "numpy==2.4.60\nsetuptools==84.2.1\ntriton==3.7.1\nnvidia-nvtx==13.0.85\n"
    assert unpinned(resolved, pins) == ["numpy==2.4.60", "setuptools==84.2.1"]


@pytest.fixture
def resolver(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands in for uv and pip; what it gets and, for each Python, what it answers."""
    found: dict[str, Any] = {"commands": [], "answers": {}}

    def run(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        found["commands"].append(command)
        good = subprocess.CompletedProcess(command, 0, "numpy==2.4.6\n", "")
        return found["answers"].get(command[command.index("--python-version") + 1], good) if "uv" in command else good

    monkeypatch.setattr(platforms.subprocess, "run", run)
    return found


def test_each_system_is_asked_with_each_python(resolver: Any, capsys: pytest.CaptureFixture[str]):
    assert main() == 0
    assert len(resolver["commands"]) == 1 + len(SYSTEMS) * len(VERSIONS)
    assert capsys.readouterr().out.splitlines() == [
        f"{system}, Python {version}: 1 wheels, all pinned" for system in SYSTEMS for version in VERSIONS
    ]


def test_what_is_missing_is_said(resolver: Any):
    resolver["answers"] = {
        "3.12": subprocess.CompletedProcess([], 1, "", "error: No solution\n  cause: no wheels"),
        "3.13": subprocess.CompletedProcess([], 0, "numpy==2.4.6\nnew==1.0\n", ""),
    }
    assert check(LINUX, "3.12", "wheels") == f"{LINUX}, Python 3.12: error: No solution cause: no wheels"
    assert check(MACOS, "3.13", "wheels") == f"{MACOS}, Python 3.13: 2 wheels, without a pin: new==1.0"
    assert main() == 1
