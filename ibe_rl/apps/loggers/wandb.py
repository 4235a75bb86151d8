"""Weights & Biases, at its server or offline in the run folder."""

from __future__ import annotations

import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from torchrl.record.loggers import Logger, WandbLogger

from ibe_rl.apps.loggers.run_logger import FOLDER, RunLogger
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import LoggerConfig
from ibe_rl.storage.run_folder import read_json, write_json
from ibe_rl.types import ConfigError


@dataclass
class WandbConfig(LoggerConfig):
    """Settings of ``logger=wandb``."""

    mode: str = setting("online", choices=("online", "offline"))  # offline: `wandb sync` sends it later
    project: str = "ibe_rl"
    entity: str | None = None  # user or team; None: as logged in


class Wandb(RunLogger):
    """A run of Weights & Biases; a resumed training goes on in the same one.

    Raises:
        ConfigError: if it is to be online and nobody is logged in.
    """

    name = package = "wandb"
    settings = WandbConfig

    def __init__(self, config: WandbConfig) -> None:
        super().__init__(config)
        online = config.mode == "online" and os.environ.get("WANDB_MODE", "online") == "online"
        if online and not _logged_in():
            raise ConfigError(
                f"loggers.wandb.mode={config.mode}: nobody is logged in (wandb login, or WANDB_API_KEY); "
                "allowed without is offline"
            )

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        """See ``RunLogger``."""
        import wandb

        self._folder = folder / FOLDER / self.name
        identity = folder / FOLDER / "wandb.json"
        if not identity.exists():
            write_json(identity, {"id": secrets.token_hex(4)})
        limits = {"finish_timeout": self.config.closing_s} if self.config.closing_s else {}
        logger = WandbLogger(
            folder.name,
            offline=self.config.mode == "offline",
            log_dir=folder / FOLDER,
            id=read_json(identity)["id"],
            project=self.config.project,
            entity=self.config.entity,
            group=folder.absolute().parent.name,  # the runs of a sweep
            log_env_packages=False,
            settings=wandb.Settings(console="off", silent=True, symlink=False, **limits),
        )
        _remove_links(self._folder)
        return logger

    def place(self) -> str:
        """See ``RunLogger``."""
        run = self.logger.experiment
        return f"wandb sync {Path(run.dir).parent}" if run.offline else str(run.url)

    def text(self, name: str, text: str, frames: int) -> None:
        """See ``RunLogger``."""
        import wandb

        self._log(name, wandb.Html(f"<pre>{escape(text)}</pre>"), frames)

    def picture(self, name: str, png: bytes, frames: int) -> None:
        """See ``RunLogger``."""
        import wandb

        self._log(name, wandb.Image(Image.open(BytesIO(png))), frames)

    def table(self, name: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], frames: int) -> None:
        """See ``RunLogger``."""
        import wandb

        self._log(name, wandb.Table(columns=list(columns), data=[list(row) for row in rows]), frames)

    def shut(self) -> None:
        """See ``RunLogger``."""
        super().shut()
        _remove_links(self._folder)

    def _log(self, name: str, value: Any, frames: int) -> None:
        """Log over frames, as ``WandbLogger`` logs numbers: each group of names has a step of its own."""
        group, slash, _ = name.rpartition("/")
        self.logger.experiment.log({name: value, f"{group}{slash}step": frames})


def _remove_links(folder: Path) -> None:
    """Remove the link to the package's own log: a run folder with links is not resumed."""
    for path in folder.rglob("*"):
        if path.is_symlink():
            path.unlink()


def _logged_in() -> bool:
    """Whether there are credentials; they are not tried and nobody is asked for them."""
    os.environ.setdefault("WANDB_SILENT", "true")
    import wandb

    return bool(wandb.login(verify=False, prompt=False))
