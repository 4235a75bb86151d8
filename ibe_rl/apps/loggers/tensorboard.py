"""TensorBoard, in the run folder."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from torchrl.record.loggers import Logger, TensorboardLogger

from ibe_rl.apps.loggers.run_logger import FOLDER, RunLogger


class Tensorboard(RunLogger):
    """Event files in ``loggers/tensorboard``; in a run that goes on, those beyond are hidden."""

    name = package = "tensorboard"

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        """See ``RunLogger``."""
        self._folder = folder / FOLDER / self.name
        return _Purging(self.name, str(folder / FOLDER), resumed_at)

    def place(self) -> str:
        """See ``RunLogger``."""
        return f"tensorboard --logdir {self._folder}"

    def hyperparameters(self, values: Mapping[str, Any]) -> None:
        """See ``RunLogger``; TorchRL's way adds a second run, named after the time."""
        from torch.utils.tensorboard.summary import hparams  # needs the package

        for summary in hparams(dict(values), {}):
            self.logger.experiment.file_writer.add_summary(summary)

    def text(self, name: str, text: str, frames: int) -> None:
        """See ``RunLogger``."""
        self.logger.experiment.add_text(name, text, frames)

    def picture(self, name: str, png: bytes, frames: int) -> None:
        """See ``RunLogger``."""
        pixels = np.asarray(Image.open(BytesIO(png)).convert("RGB"))
        self.logger.experiment.add_image(name, pixels, frames, dataformats="HWC")


class _Purging(TensorboardLogger):
    """Hides events after ``resumed_at`` frames, and writes each batch at once, for whoever is killed."""

    def __init__(self, exp_name: str, log_dir: str, resumed_at: int | None) -> None:
        self._purge_step = None if resumed_at is None else resumed_at + 1
        super().__init__(exp_name, log_dir)

    def _create_experiment(self) -> Any:
        from torch.utils.tensorboard import SummaryWriter  # needs the package

        return SummaryWriter(str(Path(self.log_dir) / self.exp_name), purge_step=self._purge_step)

    def log_metrics(self, *arguments: Any, **named: Any) -> Any:
        found = super().log_metrics(*arguments, **named)
        self.flush()
        return found
