"""Where ``ibe_rl/apps`` is not there, the core explains and judges a run, and names the application that is missing."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from processes import ROOT, SMALL

pytestmark = pytest.mark.slow

PARTS = ("ibe_rl", "configs", "demo", "explain.py", "train.py")
FEW = ["evaluate.episodes=3", "evaluate.calibration_episodes=2", "evaluate.changing_episodes=0", "evaluate.shuffles=1"]
FEW += [
    "evaluate.spoken_episodes=1",
    "evaluate.resamples=20",
    "evaluate.stride_steps=40",
    "evaluate.horizons_steps=[20]",
    "predictor.processes=1",
]


GONE = """raise ModuleNotFoundError("No module named 'ibe_rl.apps'")"""


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout without the applications."""
    folder = tmp_path_factory.mktemp("core")
    for part in PARTS:
        if (ROOT / part).is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "apps")
            shutil.copytree(ROOT / part, folder / part, ignore=ignored)
        else:
            shutil.copy(ROOT / part, folder / part)
    (folder / "ibe_rl" / "apps.py").write_text(GONE)  # an editable install would find them elsewhere
    return folder


COMMANDS = """
import json, sys
import train, explain
from ibe_rl.config.command_line import run_script
from pathlib import Path

def call(script, *arguments):
    sys.argv = [f"{script.__name__}.py", *arguments]
    try:
        run_script(script.main, Path("configs").absolute(), script.__name__)
    except SystemExit as ended:
        return str(ended)
    return "done"

print(json.dumps([call(globals()[script], *arguments) for script, *arguments in json.loads(sys.argv[1])]))
"""
"""Calls scripts one after the other and prints how they ended."""
ASKED = {
    "train": ("train", *SMALL, "total_frames=3000", "eval_every_frames=1000", "viewer=file", "run_dir={out}/run"),
    "episode": ("explain", "run={out}/run", "predictor.processes=1", "output={out}/episode.rrd"),
    "evaluate": ("explain", "run={out}/run", "task=evaluate", *FEW),
    "compare": ("explain", "run={out}/run", "task=compare", "compare.mappings=[paper]", *FEW),
    "figures": ("explain", "run=demo", "task=figures"),
    "summary": ("explain", "run=demo", "task=summary"),
    "agent": ("explain", "agent=model.zip"),
    "sweep": ("explain", "sweep=runs"),
}
MISSING = {
    "figures": "task=figures: needs ibe_rl.apps.paper.experiments",
    "summary": "task=summary: needs ibe_rl.apps.summary.summarising",
    "agent": "agent=: needs ibe_rl.apps.external.explaining",
    "sweep": "sweep=: needs ibe_rl.apps.sweep.report",
}


@pytest.fixture(scope="module")
def endings(core: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """How each command ended, all of them in one process that has only the core."""
    out = tmp_path_factory.mktemp("out")
    asked = [[part.format(out=out) for part in command] for command in ASKED.values()]
    environment = os.environ | {"PYTHONPATH": str(core)}
    ended = subprocess.run(
        [sys.executable, "-c", COMMANDS, json.dumps(asked)],
        cwd=core,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return dict(zip(ASKED, json.loads(ended.stdout.splitlines()[-1]), strict=True))


@pytest.mark.parametrize("command", ["train", "episode", "evaluate", "compare"])
def test_the_core_does_without(command: str, endings: dict[str, str]) -> None:
    assert endings[command] == "done"


@pytest.mark.parametrize("command", MISSING)
def test_what_an_application_is_for_names_it(command: str, endings: dict[str, str]) -> None:
    assert endings[command].startswith(f"error: {MISSING[command]}, which cannot be imported")
    assert "\n" not in endings[command]
