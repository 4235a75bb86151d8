"""A listener: what the agent said at each refresh, in a text file of the run folder."""

from pathlib import Path
from typing import Any

from ibe_rl import Listener


class Diary(Listener):
    """Writes diary.txt; events that it does not need, it does not define."""

    def __init__(self, config: Any = None) -> None:
        """``config`` has its settings where a file in configs/listener makes it."""

    def begin(self, run: Any) -> None:
        """Remember where the run is kept."""
        self.path: Path = run.folder / "diary.txt"

    def refreshed(self, event: Any) -> None:
        """Note the phrases of the episode that was explained."""
        phrases = ", ".join(dict.fromkeys(one.said for one in event.said))
        with self.path.open("a") as diary:
            diary.write(f"{event.frames:,} frames: {phrases}\n")
