"""MLflow reads back what a training says, from a database in the run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from told import run, train

from ibe_rl.apps.loggers.mlflow import Mlflow, MlflowConfig
from ibe_rl.storage.run_folder import read_json

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _installed() -> None:
    pytest.importorskip("mlflow")  # not among the packages of the tests: too many come with it


def read(folder: Path) -> tuple[Any, Any]:
    """A client, and the run."""
    import mlflow

    client = mlflow.MlflowClient(f"sqlite:///{folder / 'loggers/mlflow.db'}")
    return client, client.get_run(read_json(folder / "loggers/mlflow.json")["run_id"])


def test_it_reads_curves_texts_pictures_and_settings(tmp_path: Path) -> None:
    lines = train(Mlflow(MlflowConfig(kind="", closing_s=120.0)), run(tmp_path / "run"), until=40)
    database = tmp_path / "run/loggers/mlflow.db"
    assert lines == [f"logger=mlflow: mlflow ui --backend-store-uri sqlite:///{database}"]
    client, found = read(tmp_path / "run")
    curve = client.get_metric_history(found.info.run_id, "train/return_mean")
    assert [(one.step, one.value) for one in curve] == [(10, 5.0), (20, 10.0), (30, 15.0), (40, 20.0)]
    assert (found.data.params["agent.hidden"], found.info.run_name, found.info.status) == ("[8, 8]", "run", "FINISHED")
    artifacts = {path.name for path in (tmp_path / "run/loggers/mlflow").rglob("*.*") if path.is_file()}
    assert artifacts == {
        *("clusters_000000000020.png", "episode_000000000020.png", "vocabulary_000000000020.md"),
        *("skipped_000000000040.md", "summary_000000000040.md", "settings_000000000000.md"),
    }


def test_a_run_that_goes_on_is_the_same(tmp_path: Path) -> None:
    train(Mlflow(MlflowConfig(kind="", closing_s=120.0)), run(tmp_path / "run"), until=40)
    train(Mlflow(MlflowConfig(kind="", closing_s=120.0)), run(tmp_path / "run", resumed_at=20), until=60)
    client, found = read(tmp_path / "run")
    curve = client.get_metric_history(found.info.run_id, "train/return_mean")
    assert sorted({(one.step, one.value) for one in curve}) == [(10 * n, 5.0 * n) for n in range(1, 7)]
    [experiment] = client.search_experiments(filter_string="name = 'ibe_rl'")
    assert len(client.search_runs([experiment.experiment_id])) == 1
