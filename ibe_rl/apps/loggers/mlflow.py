"""MLflow, at a server or in a database of the run folder."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from torchrl.record.loggers import Logger, MLFlowLogger

from ibe_rl.apps.loggers.run_logger import FOLDER, RunLogger
from ibe_rl.config.settings import LoggerConfig
from ibe_rl.storage.run_folder import read_json, write_json

AT_ONCE = 100
"""Most settings that a server takes at once."""


@dataclass
class MlflowConfig(LoggerConfig):
    """Settings of ``logger=mlflow``."""

    uri: str | None = None  # of a server or database; None: a database in the run folder
    experiment: str = "ibe_rl"


class Mlflow(RunLogger):
    """A run of MLflow; a resumed training goes on in the same one."""

    name = package = "mlflow"
    settings = MlflowConfig

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        """See ``RunLogger``."""
        import mlflow

        logging.getLogger("mlflow").setLevel(logging.WARNING)
        own = (folder / FOLDER).absolute()
        self._uri = self.config.uri or f"sqlite:///{own / 'mlflow.db'}"
        artifacts = None if self.config.uri else f"file://{own / 'mlflow'}"
        identity = own / "mlflow.json"
        if identity.exists():
            os.environ["MLFLOW_RUN_ID"] = read_json(identity)["run_id"]  # which mlflow.start_run takes, and clears
        logger = MLFlowLogger(self.config.experiment, self._uri, artifact_location=artifacts)
        write_json(identity, {"run_id": logger.experiment.info.run_id})
        mlflow.set_tag("mlflow.runName", folder.name)
        return logger

    def place(self) -> str:
        """See ``RunLogger``."""
        return f"mlflow ui --backend-store-uri {self._uri}" if self.config.uri is None else self._uri

    def hyperparameters(self, values: Mapping[str, Any]) -> None:
        """See ``RunLogger``."""
        names = list(values)
        for first in range(0, len(names), AT_ONCE):
            self.logger.log_hparams({name: values[name] for name in names[first : first + AT_ONCE]})

    def text(self, name: str, text: str, frames: int) -> None:
        """See ``RunLogger``."""
        import mlflow

        mlflow.log_text(text, f"{name}_{frames:012d}.md")

    def picture(self, name: str, png: bytes, frames: int) -> None:
        """See ``RunLogger``."""
        import mlflow

        mlflow.log_image(Image.open(BytesIO(png)), f"{name}_{frames:012d}.png")

    def shut(self) -> None:
        """See ``RunLogger``."""
        import mlflow

        mlflow.end_run()
        super().shut()
