"""The listener that all loggers share: from events to rows, texts and pictures."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from torchrl.record.loggers import Logger

from ibe_rl.apps.loggers.background import Background
from ibe_rl.apps.loggers.phrase_table import PHRASE_COLUMNS, phrase_rows
from ibe_rl.apps.loggers.pictures import pictures_of
from ibe_rl.config.settings import LoggerConfig
from ibe_rl.types import ConfigError
from ibe_rl.view.sentences import standing
from ibe_rl.vocabulary.listener import Listener, Refreshed

FOLDER = "loggers"
"""Folder of a run in which loggers keep their files."""


class RunLogger(Listener, ABC):
    """Passes a training on to a logger of TorchRL, in a thread of its own.

    A subclass opens the logger and says how it takes texts and pictures. Its methods run in that thread, except for
    the constructor. Whatever they raise drops the logger; training goes on.

    Args:
        config: its settings.

    Attributes:
        name: as in ``logger=NAME``; also the extra that installs its package.
        package: the package that it needs; empty if none.
        settings: the dataclass of its settings.
        logger: TorchRL's, once it is open.

    Raises:
        ConfigError: if the package is not installed.
    """

    name: str
    package: str = ""
    settings: type = LoggerConfig
    logger: Logger

    def __init__(self, config: Any) -> None:
        self.config = config
        self._news: deque[str] = deque()
        self._background: Background | None = None
        self._left_out = 0
        if self.package and not installed_package(self.package):
            raise ConfigError(
                f"logger={self.name}: needs the package {self.package}; pip install 'ibe_rl[{self.name}]'"
            )

    @abstractmethod
    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        """Open TorchRL's logger.

        Args:
            folder: of the run; files belong below ``folder / FOLDER``, which exists.
            resumed_at: training frames at which the run goes on; None if it begins.
        """

    @abstractmethod
    def place(self) -> str:
        """Where to look at the run: an address or a command."""

    @abstractmethod
    def text(self, name: str, text: str, frames: int) -> None:
        """Log a text in markdown."""

    @abstractmethod
    def picture(self, name: str, png: bytes, frames: int) -> None:
        """Log a picture, the contents of a PNG file."""

    def table(self, name: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], frames: int) -> None:
        """Log a table; a logger without tables has it in a text."""

    def hyperparameters(self, values: Mapping[str, Any]) -> None:
        """Log the settings of a run that begins."""
        self.logger.log_hparams(dict(values))

    def shut(self) -> None:
        """Close the logger."""
        self.logger.close()

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        if find_spec("IPython"):
            import_module("IPython")  # packages do in their thread; matplotlib, in this one, fails on half of it
        self._run = run
        self._background = Background(self.config.waiting_events)
        values, frames = flat(asdict(run.cfg)), run.log.frames
        self._do(partial(self._open, run.folder, frames if run.resumed else None, values))
        lines = "\n".join(f"    {name}: {value}" for name, value in values.items())
        self._do(lambda: self.text("settings", lines, frames))

    def _open(self, folder: Path, resumed_at: int | None, values: Mapping[str, Any]) -> None:
        (folder / FOLDER).mkdir(exist_ok=True)
        self.logger = self.open(folder, resumed_at)
        self._news.append(f"logger={self.name}: {self.place()}")
        if resumed_at is None:
            self.hyperparameters(values)

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """Log the columns of metrics.csv over frames."""
        whole = {**row, **self._run.time_row()}
        values = {name: value for name, value in whole.items() if name != "frames" and math.isfinite(value)}
        self._do(lambda: self.logger.log_metrics(values, step=frames))

    def refreshed(self, event: Refreshed) -> None:
        """Log the vocabulary as text and table, and the pictures of the refresh."""
        frames, task = event.frames, self._run.task
        text, rows = standing(event.refresh, task, None, links=False), phrase_rows(event.refresh, task)
        self._do(lambda: self.text("refresh/vocabulary", text, frames))
        self._do(lambda: self.table("refresh/phrases", PHRASE_COLUMNS, rows, frames))
        for name, png in pictures_of(event, task).items() if self.config.pictures else ():
            self._do(partial(self.picture, f"refresh/{name}", png, frames))

    def skipped(self, frames: int, reason: str) -> None:
        """See ``Listener``."""
        self._do(lambda: self.text("refresh/skipped", reason, frames))

    def end(self, summary: Mapping[str, Any]) -> None:
        """See ``Listener``."""
        text = "\n".join(f"    {line}" for line in json.dumps(summary, indent=2).splitlines())
        self._do(lambda: self.text("summary", text, summary["frames"]))

    def close(self) -> None:
        """Wait until all is logged, but not for long."""
        background, self._background = self._background, None
        if background and not background.finish(self.shut, self.config.closing_s):
            self._news.append(
                f"warning: logger={self.name}: it did not take everything within loggers.{self.name}.closing_s="
                f"{self.config.closing_s:g} s; metrics.csv and refreshes/ have all of it"
            )

    def news(self) -> Iterable[str]:
        """See ``Listener``."""
        while self._news:
            yield self._news.popleft()

    def _do(self, call: Callable[[], object]) -> None:
        if self._background is None:
            return
        self._background.do(call)
        if self._background.left_out and not self._left_out:
            self._news.append(
                f"warning: logger={self.name}: {self.config.waiting_events:,} events wait for it; further ones are "
                "left out until it takes them. metrics.csv and refreshes/ have all of it"
            )
        self._left_out = self._background.left_out


def installed_package(name: str) -> bool:
    """Whether a package is installed; a folder of that name in the working directory does not count."""
    found = find_spec(name)
    return found is not None and found.origin is not None


def flat(values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested settings by their names on the command line; lists as JSON.

    >>> flat({"agent": {"gamma": 0.9, "hidden": [64, 64]}, "address": None})
    {'agent.gamma': 0.9, 'agent.hidden': '[64, 64]', 'address': 'null'}
    """
    return dict(_flat(values, ""))


def _flat(values: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value if isinstance(value, str | int | float) else json.dumps(value)
