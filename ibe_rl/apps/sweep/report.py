"""The report of a sweep: a table, printed and as CSV, and a page with its figures."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.apps.report_page import number, write_page
from ibe_rl.apps.sweep import figures
from ibe_rl.apps.sweep.board import viewer_command
from ibe_rl.apps.sweep.intervals import of_runs
from ibe_rl.apps.sweep.records import COLUMN_LABELS, LEARNING, TRUTH, SweepRun, read_sweep
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.run_folder import FIGURES, write_atomically
from ibe_rl.types import ConfigError
from ibe_rl.view.address import choose_ports
from ibe_rl.view.viewer import open_recordings

_TABLE = "sweep.csv"
MAIN = (
    *("eval/success_rate", "eval/return_mean", "ibe/motion_auc", "ibe/motion_auc_disobeyed", "ibe/came_true"),
    *("quality/vocabulary_loss", "quality/observer_error"),
)
"""Columns of the short table, if the runs have them."""
DIGITS = {"eval/return_mean": 1, "train/return_mean": 1, "quality/observer_error": 1}


def report_sweep(cfg: ExplainConfig) -> None:
    """Report a sweep for ``explain.py sweep=DIR``; with ``viewer=live`` also open all its recordings.

    Raises:
        ConfigError: if another task is asked for as well; and as ``report``.
    """
    if cfg.run is not None or cfg.agent_file is not None or cfg.task != "episode":
        raise ConfigError(f"sweep={cfg.sweep_dir} reports a whole sweep; allowed is no run=, agent= or task= beside it")
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    report(Path(str(cfg.sweep_dir)))
    if ports:
        open_recordings([str(cfg.sweep_dir), "--grpc-port", str(ports.grpc), "--web-port", str(ports.web)])


def report(sweep: Path) -> None:
    """Aggregate the runs of a sweep; print the table and the paths of the files.

    Raises:
        ConfigError: if there is no run, none is finished, or one is damaged.
    """
    records = read_sweep(sweep)
    found = by_condition(records)
    folder = sweep / FIGURES
    try:
        folder.mkdir(exist_ok=True)
        write_table(folder / _TABLE, found["conditions"])
        page = write_figures(folder, found, sweep)
    except OSError as error:
        raise ConfigError(f"sweep={sweep}: allowed is a folder that can be written to ({error.strerror})") from None
    console = PlainConsole(soft_wrap=True)
    console.width = max(console.width, 110)
    console.print(short_table(found["conditions"]))
    for notice in found["notices"]:
        console.print(f"note: {notice}")
    for what, where in (
        ("table", folder / _TABLE),
        ("report", page),
        ("all recordings together", viewer_command(sweep)),
    ):
        console.print(f"{what}: {where}")


def by_condition(records: Sequence[SweepRun]) -> dict[str, Any]:
    """The finished runs by condition, and notices about the others.

    Raises:
        ConfigError: if no run is finished.
    """
    counted = [record for record in records if not record.missing]
    if not counted:
        estimate = "; ".join(f"{record.name}: {record.missing}" for record in records[:3])
        raise ConfigError(f"sweep={records[0].folder.parent}: none of its {len(records)} runs is finished ({estimate})")
    names = list(dict.fromkeys(record.condition for record in records))
    by_name = {name: [record for record in counted if record.condition == name] for name in names}
    having = [(name, runs) for name, runs in by_name.items() if runs]
    conditions = []
    with progress_bar("conditions", len(having)) as step:
        for name, runs in having:
            conditions.append(_condition(name, runs))
            step()
    metrics = list(dict.fromkeys(metric for one in conditions for metric in one["ends"]))
    said = notices(records, by_name)
    return {"runs": records, "conditions": conditions, "metrics": metrics, "notices": said}


def _condition(name: str, runs: Sequence[SweepRun]) -> dict[str, Any]:
    columns = [column for column in (*LEARNING, *TRUTH) if all(column in run.curves for run in runs)]
    ends, curves = of_runs(
        [run.ends for run in runs], {column: [run.curves[column] for run in runs] for column in columns}
    )
    return {"name": name, "runs": len(runs), "ends": ends, "curves": curves}


def notices(records: Sequence[SweepRun], by_name: dict[str, list[SweepRun]]) -> list[str]:
    """Caveats about the numbers."""
    missing = [record for record in records if record.missing]
    lines = [f"{len(missing)} of {len(records)} runs are not finished and do not count"] if missing else []
    lines += [f"{record.name}: {record.missing}" for record in missing]
    none = [name for name, runs in by_name.items() if not runs]
    lines += [f"no finished run with {name}" for name in none]
    single = [name for name, runs in by_name.items() if len(runs) == 1]
    if single:
        lines.append(f"a single run, so no interval and no conclusion: {'; '.join(single)}")
    few = sorted({len(runs) for runs in by_name.values() if 1 < len(runs) < 5})
    if few:
        lines.append(f"intervals over {' or '.join(map(str, few))} runs are rough; five or more are better")
    return lines


def main_columns(conditions: Sequence[dict[str, Any]]) -> list[str]:
    """The columns of the short table that any condition has."""
    return [column for column in MAIN if any(column in one["ends"] for one in conditions)]


def short_table(conditions: Sequence[dict[str, Any]]) -> Table:
    """Final values, for the terminal."""
    table = Table(box=SIMPLE, show_edge=False, title_justify="left")
    table.title = "interquartile means over the runs [95 % intervals]"
    columns = main_columns(conditions)
    table.add_column("condition", overflow="fold")
    for heading in ("runs", *columns):
        lines = heading.replace("/", "/\n").replace("_disobeyed", "\n_disobeyed")
        table.add_column(lines, justify="right", no_wrap=True)
    for one in conditions:
        cells = [number(one["ends"].get(column), DIGITS.get(column, 3)).replace(" [", "\n[") for column in columns]
        table.add_row(one["name"], str(one["runs"]), *cells)
    return table


def write_table(path: Path, conditions: Sequence[dict[str, Any]]) -> None:
    """Write a row for each condition and metric, with the final value of each run."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["condition", "metric", "runs", "iqm", "low", "high", "each"])
    for one in conditions:
        for metric, estimate in one["ends"].items():
            values = [
                f"{estimate[name]:.6g}" if estimate[name] is not None else "" for name in ("value", "low", "high")
            ]
            each = " ".join(f"{value:.6g}" for value in estimate["each"])
            table.writerow([one["name"], metric, estimate["runs"], *values, each])
    write_atomically(path, lambda stream: stream.write(text.getvalue().encode()))


def write_figures(folder: Path, found: dict[str, Any], sweep: Path) -> Path:
    """Draw the figures and write the page with them; returns its path."""
    conditions = found["conditions"]
    columns = main_columns(conditions)
    drawn = {"learning.png": partial(figures.curves, conditions, LEARNING)}
    if any(column in one["curves"] for one in conditions for column in TRUTH):
        drawn["truth.png"] = partial(figures.curves, conditions, TRUTH)
    _, page = write_page(
        "ibe_rl.apps.sweep",
        folder,
        drawn | {"ends.png": partial(figures.ends, conditions, columns)},
        sweep=sweep.resolve().name,
        found=found,
        columns=columns,
        labels=COLUMN_LABELS,
        digits=DIGITS,
        viewer=viewer_command(sweep),
    )
    return page
