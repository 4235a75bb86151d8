"""The curves of several runs in the same plots, as a recording of its own: one plot shows one recording only.

It is made of the runs' ``metrics.csv``, so a run needs no recording for it, and the trainer knows nothing of it.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from uuid import uuid4

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ibe_rl.types import ConfigError
from ibe_rl.view.palette import RUN_COLOURS

OVERLAY_APPLICATION = "ibe_rl_overlay"
"""Not the application of a run's recording: rerun keeps one layout for each."""
_FRAMES = "frames"
PLOTS: dict[str, tuple[str, ...]] = {
    "Return per episode": ("train/return_mean", "eval/return_mean"),
    "Success, training": ("train/success_rate",),
    "Success, greedy policy": ("eval/success_rate",),
    "Share that went as predicted": ("ibe/came_true",),
    "Motion AUC of the words": ("ibe/motion_auc",),
    "Staleness of the vocabulary": ("ibe/staleness",),
    "Drift of the vocabulary": ("ibe/vocabulary_drift",),
    "Drift of the policy": ("ibe/policy_drift",),
}
"""Title of each plot to the columns of metrics.csv in it."""
SHARES = {"train/success_rate", "eval/success_rate", "ibe/came_true", "ibe/motion_auc"}
PLOT_COLUMNS = tuple(column for columns in PLOTS.values() for column in columns)

Curve = list[tuple[int, float]]
"""Frames and value of each row that has one."""


class GrowingTable:
    """Reads what is new in a CSV file that may still grow, or may not be there yet.

    Args:
        path: the file.

    Attributes:
        header: its columns; none before the file has its first line.
    """

    def __init__(self, path: Path) -> None:
        self.header: Sequence[str] = ()
        self._path, self._read = path, 0

    def new_rows(self) -> list[dict[str, str]]:
        """The rows completed since the last call; a line that is being written is taken the next time."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            file.seek(self._read)
            whole, end, _ = file.read().rpartition(b"\n")
        self._read += len(whole) + len(end)
        reader = csv.DictReader(whole.decode().splitlines(), self.header or None)
        self.header = reader.fieldnames or ()
        return list(reader)


def new_curves(table: GrowingTable, path: Path) -> dict[str, Curve]:
    """The curves of ``PLOT_COLUMNS`` in the rows completed since the last call.

    Raises:
        ConfigError: if it is not what train.py writes, or cannot be read.
    """
    try:
        rows = table.new_rows()
        return {name: _curve(rows, name) for name in PLOT_COLUMNS if name in table.header}
    except (OSError, KeyError, TypeError, ValueError, csv.Error) as error:
        raise ConfigError(f"{path}: allowed are the metrics that train.py writes ({error!r:.200})") from None


def _curve(rows: Sequence[Mapping[str, str]], column: str) -> Curve:
    """Frames and value of the rows in which the value is there and finite."""
    values = [(int(row[_FRAMES]), float(row[column] or "nan")) for row in rows]
    return [(frame, value) for frame, value in values if math.isfinite(value)]


class Overlay:
    """Writes the curves of some runs into one recording, and what is added to them.

    Args:
        path: the recording, written anew; its folder must exist.
        runs: name of each run to its ``metrics.csv``.

    Raises:
        ConfigError: if one of them is not what train.py writes.
    """

    def __init__(self, path: Path, runs: Mapping[str, Path]) -> None:
        self._tables = {name: (GrowingTable(path), path) for name, path in runs.items()}
        self._colours = {name: RUN_COLOURS[i % len(RUN_COLOURS)] for i, name in enumerate(runs)}
        self._columns: set[str] = set()
        self._recording = rr.RecordingStream(OVERLAY_APPLICATION, recording_id=str(uuid4()))
        self._recording.set_sinks(rr.FileSink(path))
        self._recording.set_log_time_enabled(False)
        self._recording.send_recording_name("curves of all runs")
        self.update()

    def update(self) -> None:
        """Add the rows that have been completed since.

        Raises:
            ConfigError: if a file is not what train.py writes.
        """
        new = {name: new_curves(*table) for name, table in self._tables.items()}
        columns = {column for curves in new.values() for column, curve in curves.items() if curve}
        if columns - self._columns:  # a run that has just begun has none yet
            self._columns |= columns
            self._recording.send_blueprint(curves_blueprint(self._columns))
        for name, curves in new.items():
            for column, curve in curves.items():
                if curve:
                    self._send(column, name, curve)
        self._recording.flush()

    def _send(self, column: str, name: str, curve: Curve) -> None:
        path = rr.new_entity_path([*column.split("/"), name])
        self._recording.log(path, *_style(column, name, self._colours[name]), static=True)
        frames, values = (np.array(part) for part in zip(*curve, strict=True))
        times = [rr.TimeColumn(_FRAMES, sequence=frames)]
        rr.send_columns(path, times, rr.Scalars.columns(scalars=values), recording=self._recording)

    def close(self) -> None:
        """Write the rest and the end of the file."""
        self._recording.flush()
        self._recording.disconnect()


def _style(column: str, name: str, colour: tuple[int, int, int]) -> list[rr.AsComponents]:
    """One colour a run in all plots; thin lines for training, wide ones with marks for what has few rows."""
    if column.startswith("train/"):
        return [rr.SeriesLines(colors=[colour], names=[name], widths=[1])]
    legend = f"{name}, greedy policy" if column == "eval/return_mean" else name
    points = rr.SeriesPoints(colors=[colour], names=[legend], marker_sizes=[3])
    return [rr.SeriesLines(colors=[colour], names=[legend], widths=[2]), points]


def curves_blueprint(columns: set[str]) -> rrb.Blueprint:
    """Lay out the plots of which at least one of ``columns`` is there, with the list of recordings beside them."""
    shown = {title: [name for name in names if name in columns] for title, names in PLOTS.items()}
    plotted = [(title, names) for title, names in shown.items() if names]
    plots = [_plot(*one, legend=i == 0) for i, one in enumerate(plotted)]  # the colours are the same in all
    return rrb.Blueprint(
        rrb.Grid(*plots, grid_columns=2),
        rrb.BlueprintPanel(state="expanded"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=_FRAMES, play_state="following"),
        auto_views=False,
    )


def _plot(title: str, columns: Sequence[str], legend: bool) -> rrb.View:
    boundary = rrb.TimeRangeBoundary.infinite()
    return rrb.TimeSeriesView(
        name=title,
        contents=[f"/{column}/**" for column in columns],
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=boundary, end=boundary)),
        axis_y=rrb.ScalarAxis(range=(-0.02, 1.06)) if SHARES.issuperset(columns) else None,
        plot_legend=rrb.PlotLegend("RightBottom", visible=legend),
    )
