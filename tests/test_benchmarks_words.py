"""The benchmark of words: what is measured and kept, with numbers made by hand; nothing is flown."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks import words
from ibe_rl.storage.run_folder import read_json, write_json


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """Two runs, two languages without flaws; returns what would be measured."""
    done: list[Any] = []

    def measure(run: Any, _: Any, language: str, flaw: str, seed: int) -> dict[str, Any]:
        done.append((run.folder.name, language, flaw, seed))
        told = {name: {"f1": 0.5 + 0.25 * seed, "motion_auc": [0.75], "phrases": 3} for name in ("ours", "paper")}
        return {"language": language, "flaw": flaw, "delay_steps": 5 * seed, **told}

    monkeypatch.setattr(words, "load_run", lambda folder: SimpleNamespace(folder=folder))
    monkeypatch.setattr(words, "real_changes", lambda *_: None)
    monkeypatch.setattr(words, "measure", measure)
    monkeypatch.setattr(words, "FLAWS", {"": None})
    monkeypatch.setattr(words, "LANGUAGES", {"three words": None, "five words": None})
    for name in ("ppo0", "ppo1"):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / "summary.json", {"frames": 600, "wall_s": 1.5})
    return done


CELLS = "0.625 (least 0.500) | 0.625 (least 0.500) | 0.750 | 0.750 | 0, 5 |"


def test_the_table_takes_its_place(measured: list[Any], tmp_path: Path):
    page, output = tmp_path / "WORDS.md", ["--output", str(tmp_path)]
    page.write_text("above\n<!-- words: python -m benchmarks.words -->\nold\n<!-- end of words -->\nbelow\n")
    words.main([str(tmp_path / "ppo0"), str(tmp_path / "ppo1"), *output])
    text = page.read_text()
    assert text.startswith("above\n<!-- words: python -m benchmarks.words -->\n\n| words | flaw |")
    assert text.endswith(
        f"| three words | none | {CELLS}\n| five words | none | {CELLS}\n\n<!-- end of words -->\nbelow\n"
    )
    assert len(measured) == 4
    words.main(["--report", *output])
    assert page.read_text() == text
    assert len(measured) == 4


def test_only_what_lacks_is_measured(measured: list[Any], tmp_path: Path):
    results, runs = tmp_path / "words.json", [str(tmp_path / name) for name in ("ppo0", "ppo1")]

    def again(*arguments: str) -> list[Any]:
        measured.clear()
        words.main([*arguments, "--output", str(tmp_path)])
        return measured

    every = [(name, one, "", seed) for seed, name in enumerate(("ppo0", "ppo1")) for one in words.LANGUAGES]
    assert again("--missing", *runs) == every
    rows = read_json(results)["rows"]
    assert again("--missing", *runs) == []
    write_json(results, {"rows": rows[1:]})
    assert again("--missing", *runs) == every[:1]
    assert [row["run"][:4] for row in read_json(results)["rows"]] == ["ppo0", "ppo0", "ppo1", "ppo1"]
    assert again("--missing", "--episodes", "7", *runs) == every
    assert again(*runs) == every
    write_json(tmp_path / "ppo1" / "summary.json", {"frames": 600, "wall_s": 1.75})  # trained anew
    assert again("--missing", *runs) == every[2:]
    assert again("--missing", runs[0]) == []
    assert len(read_json(results)["rows"]) == 2  # of the run that was asked for


@pytest.mark.parametrize("arguments", [[], ["RUN", "--report"]])
def test_runs_or_a_report_are_asked_for(arguments: list[str], capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        words.main(arguments)
    assert "RUN: allowed are one or more, or --report without any" in capsys.readouterr().err


def test_docs_has_a_place_for_the_table():
    begin, end = "<!-- words: python -m benchmarks.words -->", "<!-- end of words -->"
    assert end in words.PAGE.read_text().partition(begin)[2]


def test_a_report_of_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        words.main(["--report", "--output", str(tmp_path)])
    assert f"allowed once something was measured ({tmp_path / 'words.json'} is not there)" in capsys.readouterr().err
