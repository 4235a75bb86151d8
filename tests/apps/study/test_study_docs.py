"""What docs/STUDY.md shows works in its order, with simulated people and small numbers."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest
import yaml
from processes import ROOT

from ibe_rl.apps.study import commands, serving
from ibe_rl.apps.study.commands import FUNCTIONS, study_command
from ibe_rl.apps.study.settings import ARMS
from ibe_rl.apps.study.stimuli import UNTIL

PAGE = (ROOT / "docs" / "STUDY.md").read_text()
LINES = [shlex.split(line, comments=True) for line in re.findall(r"^    python -m ibe_rl.apps.study (.*)$", PAGE, re.M)]
SMALL = {
    "make": ["flights=20", "trials.each_arm=2", "trials.practice=1", "test.resamples=200"],
    "power": ["studies=20", "most_people=32"],
    "serve": ["port=null", "admin_port=null"],  # other tests run beside this one
    "bundle": ["people=2"],
    "pilot": ["people=6", "at_once=3", "through=protocol", "drop_out=0"],
}
MADE = ("analysis/power.json", "registration.md", "codes.txt", "analysis/report.html", "made.json", "answers.sqlite")


@pytest.mark.slow
def test_an_afternoon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "demo", tmp_path / "demo")

    async def begun(*_: object) -> None:
        """Serve nobody: the pages have tests of their own."""

    monkeypatch.setattr(serving, "_serve", begun)
    monkeypatch.setattr(serving, "asked_port", lambda *_, **__: None)  # a study may be served beside the tests
    afternoon = ["make", "power", "pilot", "register", "serve", "analyse"]
    assert [line[0] for line in LINES] == [*afternoon, "bundle", "collect"]
    (tmp_path / "answers.jsonl").touch()
    for name, *settings in LINES:
        few = [one for one in settings if not one.startswith("people=")] if name == "pilot" else settings
        assert study_command([name, *few, *SMALL.get(name, [])]) == 0
    assert all((tmp_path / "mine" / name).is_file() for name in MADE)
    assert len((tmp_path / "bundle/links.txt").read_text().split()) == 2
    assert len((tmp_path / "mine/codes.txt").read_text().split()) == 60
    assert "Pilot: no participants of the study. 6 people began" in " ".join(capsys.readouterr().out.split())


def test_all_that_can_be_chosen_is_explained() -> None:
    for name in (*ARMS, *UNTIL, *FUNCTIONS):
        assert f"`{name}" in PAGE or f"study {name} " in PAGE or f"{name}" in [line[0] for line in LINES]
    scales = {path.stem for path in (Path(commands.__file__).parent / "texts/en/scales").glob("*.yaml")}
    assert all(f"`{name}" in PAGE for name in scales)


def test_texts_that_come_along_are_yaml_and_say_no_secret() -> None:
    for path in (Path(commands.__file__).parent / "texts/en").rglob("*.yaml"):
        assert isinstance(yaml.safe_load(path.read_text()), dict)
