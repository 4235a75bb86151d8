"""The quarter of an hour of docs/OWN_ENVIRONMENT.md, with fewer frames."""

import json
import re
import sys
from pathlib import Path

import pytest
import yaml
from processes import ROOT, SMALL, call

from ibe_rl.config.settings import TaskConfig

DOC = (ROOT / "docs" / "OWN_ENVIRONMENT.md").read_text()
FEWER = ["viewer=file", "collect.envs_per_process=16", "explain_every_steps=25", "total_frames=4000"]
EASIER = [
    "evaluate.spoken_episodes=0",
    "evaluate.episodes=3",
    "evaluate.calibration_episodes=3",
    "evaluate.shuffles=1",
    "evaluate.resamples=20",
]
EASIER += [
    "predictor.processes=1",
    "evaluate.horizons_steps=[20]",
    "evaluate.changing_episodes=0",
    "evaluate.stride_steps=20",
]


def files() -> dict[str, str]:
    """Each block below the line that names its file."""
    return dict(re.findall(r"^`(\S+)`\n\n```\w+\n(.*?)```", DOC, re.DOTALL | re.MULTILINE))


def commands() -> list[list[str]]:
    [block] = re.findall(r"```sh\n(.*?)```", DOC, re.DOTALL)
    return [line.removeprefix("python ").replace(".py", "", 1).split() for line in block.splitlines()]


def test_the_files_and_the_commands_do_what_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    for name, text in files().items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    train, explain, evaluate = commands()
    call(*train, *SMALL, *FEWER)
    assert re.search(r"explain\.py --config-dir=\S*my_configs run=/\S+/runs/my_cart\n", capsys.readouterr().out)
    call(*explain, "viewer=off")
    said = capsys.readouterr().out
    assert "Cart-pole: any" in said
    assert "going" in said
    with pytest.raises(SystemExit, match="context=any: allowed is none, this environment has no option for it"):
        call(*explain, "viewer=off", "context=any")
    call(*evaluate, *EASIER)
    rows = json.loads((tmp_path / "runs/my_cart/evaluation/quality.json").read_text())["rows"]
    assert "ibe:axis" in {row["explainer"] for row in rows}
    strange = r"error: runs/my_cart/\S+: its environment runs code, my_rules:MiddleCart-v0, my_rules:stood, "
    strange += "my_rules:to_the_middle; allowed is"
    for command in (["explain", "run=runs/my_cart"], ["train", "resume=runs/my_cart", "total_frames=9000"]):
        with pytest.raises(SystemExit, match=strange):
            call(*command)


def test_everything_that_can_be_declared_is_listed():
    listed = set(re.findall(r"`task\.(\w+)`", DOC))
    assert set(TaskConfig.__dataclass_fields__) <= listed


def test_the_config_of_the_page_is_one():
    assert yaml.safe_load(files()["my_configs/env/my_cart.yaml"])["id"] == "my_rules:MiddleCart-v0"


def test_the_files_it_links_to_are_there():
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", DOC):
        assert (ROOT / "docs" / link).exists(), link
