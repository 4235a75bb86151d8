"""Where ``ibe_rl/apps`` is not there, the core explains and judges a run, and names the application that is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from processes import ROOT, SMALL

PARTS = ("ibe_rl", "configs", "demo", "explain.py", "train.py")
FEW = ["evaluate.episodes=3", "evaluate.calibration_episodes=2", "evaluate.changing_episodes=0", "evaluate.shuffles=1"]
FEW += ["evaluate.resamples=20", "evaluate.stride_steps=40", "evaluate.horizons_steps=[20]", "predictor.processes=1"]


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


@pytest.fixture(scope="module")
def run(core: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that the core has trained, recording included."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    few = ["total_frames=4000", "eval_every_frames=2000", "viewer=file"]
    ended = script(core, "train.py", *SMALL, *few, f"run_dir={folder}")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return folder


def script(core: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(core)}
    return subprocess.run(
        [sys.executable, *command], cwd=core, env=environment, capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize(
    "command",
    [
        ("explain.py", "run=demo", "predictor.processes=1", "output={out}/episode.rrd"),
        ("explain.py", "run={run}", "task=evaluate", *FEW),
        ("explain.py", "run={run}", "task=compare", "compare.mappings=[paper]", *FEW),
    ],
    ids=["episode", "evaluate", "compare"],
)
def test_the_core_does_without(command: tuple[str, ...], core: Path, run: Path, tmp_path: Path) -> None:
    ended = script(core, *(part.format(run=run, out=tmp_path) for part in command))
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "motion AUC" in ended.stdout or "went as predicted" in ended.stdout


@pytest.mark.parametrize(
    ("setting", "missing"),
    [
        ("task=figures", "task=figures: needs ibe_rl.apps.paper.experiments"),
        ("agent=model.zip", "agent=: needs ibe_rl.apps.external.study"),
        ("sweep=runs", "sweep=: needs ibe_rl.apps.sweep.report"),
    ],
)
def test_what_an_application_is_for_names_it(setting: str, missing: str, core: Path) -> None:
    ended = script(core, "explain.py", *(["run=demo"] if setting == "task=figures" else []), setting)
    assert ended.returncode == 1
    assert ended.stderr.startswith(f"error: {missing}, which cannot be imported")
    assert ended.stderr.count("\n") == 1
