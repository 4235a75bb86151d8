"""All ways in which the program opens what lies in the folder of a run."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

from ibe_rl.config.limits import check
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.evaluation.runs import kept_policies, kept_refreshes, load_run
from ibe_rl.evaluation.trained_run import open_log
from ibe_rl.instructors.recorded import read_lesson
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.storage.run_folder import CONFIG, METRICS, RECORDING, read_overrides, read_rows
from ibe_rl.training.build import make_parts
from ibe_rl.training.resume import read_state
from ibe_rl.training.state import must_fit
from ibe_rl.view.overlay import GrowingTable, new_curves
from ibe_rl.view.recording_file import set_back, whole_messages
from ibe_rl.view.viewer import Messages, run_names, runs_at


def explained(run: Path) -> None:
    """As explain.py does."""
    opened = load_run(run)
    kept_policies(opened, "policy", "between")
    kept_refreshes(opened)
    read_overrides(run / ".hydra" / "overrides.yaml")


def log(run: Path) -> None:
    """As explain.py task=compare does."""
    opened = open_log(load_run(run).folder)
    opened.read(range(len(opened.index)))
    assert len(opened.context_names) == len(opened.index)


def resumed(run: Path) -> None:
    """As train.py resume=DIR does, up to the first step."""
    config: Any = load_config(run / CONFIG, TrainConfig)
    check(config)
    state = read_state(run, "latest")
    if state["recorder"]:
        with must_fit(run):
            set_back(run / RECORDING, state["recorder"]["recorder"]["bytes"])
    with ExitStack() as owned, patch("ibe_rl.training.build.run_name", lambda folder: folder.name):  # hydra's to know
        parts = make_parts(config, run, owned, StopRequest(), state)
        with must_fit(run):
            parts.random.load_state_dict(state["random"])
        parts.log.read(range(len(parts.log.index)))


def tabled(run: Path) -> None:
    """As resume and the viewer read metrics.csv."""
    read_rows(run / METRICS)
    new_curves(GrowingTable(run / METRICS), run / METRICS)


def viewed(run: Path) -> None:
    """As the viewer does."""
    run_names([*runs_at(run), run.parent])
    with tempfile.TemporaryFile() as shown:
        Messages(run / RECORDING).copy(shown)
    with (run / RECORDING).open("rb") as file:
        whole_messages(file, (run / RECORDING).stat().st_size)


def lesson(run: Path) -> None:
    """As instructor=recorded does."""
    config: Any = load_config(run / CONFIG, TrainConfig)
    read_lesson(run / "lesson.jsonl", task_of(make_env(config.env)).instruction_size)


WAYS: dict[str, Callable[[Path], None]] = {
    one.__name__: one for one in (explained, log, resumed, tabled, viewed, lesson)
}
