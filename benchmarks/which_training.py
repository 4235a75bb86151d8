"""Which training a measurement is of: what is measured again when a folder of the same name was trained anew."""

from __future__ import annotations

from pathlib import Path

from ibe_rl.storage.run_folder import SUMMARY, read_json


def training_of(folder: Path) -> str:
    """The name of a finished run, and how long it took: no two trainings take the same time to the millisecond.

    Raises:
        SystemExit: if it is no finished run.
    """
    try:
        summary = read_json(folder / SUMMARY)
        return f"{folder.name}, {summary['frames']} frames in {summary['wall_s']:.3f} s"
    except (OSError, ValueError, KeyError, TypeError) as error:
        why = f"{type(error).__name__}: {error}"
        raise SystemExit(f"RUN={folder}: allowed is the folder of a finished run ({SUMMARY}: {why})") from None
