"""CONTRIBUTING shows the rooms as they are, and its recipes for kinds run."""

import re
import sys
from pathlib import Path
from textwrap import dedent

import pytest
import yaml
from processes import ROOT, SMALL, call

from ibe_rl.storage.run_folder import CONFIG, METRICS, read_rows
from tests.rooms import picture

TEXT = (ROOT / "CONTRIBUTING.md").read_text()
[RECIPES] = [dedent(one) for one in re.findall(r"(?:^    .*\n)+", TEXT, re.MULTILINE) if "class " in one]
IMPORTS = """
from dataclasses import dataclass
import gymnasium
from ibe_rl.agents.ppo import PPO
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import MappingConfig
from ibe_rl.envs.cart_pole import CartPoleTarget
from ibe_rl.ibe import IBEMapping
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.predict.regression import Regression
from ibe_rl.vocabulary.listener import Listener, Metric
"""
KINDS = {
    "mapping": "Calm",
    "predictor": "Straight",
    "agent": "Careful",
    "instructor": "Contrary",
    "listener": "Diary",
    "metric": "Words",
}
FEW = ["total_frames=2048", "refresh_every_frames=1024", "mapping.spans_steps=[]", "viewer=off", "mapping.calmness=0.5"]


def test_it_can_be_read_at_once() -> None:
    assert len(TEXT.splitlines()) <= 80


def test_it_shows_the_rooms() -> None:
    assert picture() in TEXT


def test_the_recipes_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_kinds.py").write_text(IMPORTS + RECIPES)
    files = {group: f"kind: my_kinds:{name}\n" for group, name in KINDS.items()} | {"env": "id: my_kinds:Breeze-v0\n"}
    for group, text in files.items():
        (tmp_path / "mine" / group).mkdir(parents=True)
        (tmp_path / "mine" / group / "mine.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    several = ("listener", "metric")
    chosen = [f"{group}=[mine]" if group in several else f"{group}=mine" for group in files]
    try:
        call("train", "--config-dir", "mine", *SMALL, *FEW, *chosen, "run_dir=run")
    finally:
        sys.path.remove(str(tmp_path))
    config = yaml.safe_load((tmp_path / "run" / CONFIG).read_text())
    kinds = {group: config[group]["kind"] for group in KINDS if group not in several}
    assert kinds == {group: f"my_kinds:{KINDS[group]}" for group in kinds}
    assert config["mapping"]["calmness"] == 0.5
    rows = read_rows(tmp_path / "run" / METRICS)
    assert {row["train/careful"] for row in rows} == {"1"}
    assert any(row["mine/words"] for row in rows)
