"""The notebooks run from their first cell to their last, and what is committed of their output is small."""

import json
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from processes import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
LARGEST_BYTES = 20_000


def said(notebook: Any) -> str:
    """All that its cells printed."""
    return "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []))


def run(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """Run one as a reader does, in its folder; what it writes goes to ``runs/`` of another one."""
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    folder = tmp_path / "docs" / "notebooks"
    folder.mkdir(parents=True)
    (tmp_path / "demo").symlink_to(ROOT / "demo")
    notebook = nbformat.read(ROOT / "docs" / "notebooks" / name, 4)
    NotebookClient(
        notebook, timeout=540, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    return said(notebook)


@pytest.mark.slow
def test_the_quick_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    printed = run("quick_start.ipynb", monkeypatch, tmp_path)
    assert "of the next 60 steps went as predicted" in printed
    assert "\x1b" not in printed
    assert "falling moderately to the right" in printed
    assert "+1.00  falling to the right" in printed


@pytest.mark.slow
def test_an_agent_of_another_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    printed = run("explain_your_sb3_agent.ipynb", monkeypatch, tmp_path)
    assert "Lunar Lander with pads: " in printed
    assert "satisfaction" in printed


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_is_committed_is_text_and_small(path: Path) -> None:
    assert path.stat().st_size < LARGEST_BYTES
    for cell in json.loads(path.read_text())["cells"]:
        assert all(output["output_type"] == "stream" for output in cell.get("outputs", []))
