"""The curves of several runs in one recording, read back: the values of the csv files, as far as they are written."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rerun.chunk import RrdReader
from view_data import Rows, column, frames, read

from ibe_rl.storage.run_folder import MetricsTable
from ibe_rl.types import ConfigError
from ibe_rl.view.overlay import PLOTS, Overlay, curves_blueprint
from ibe_rl.view.palette import RUN_COLOURS

LATER = ("eval/return_mean", "eval/success_rate", "ibe/came_true", "ibe/skipped")
NAMES = ("seed=0", "seed=1")


def row(at: int, seed: int, **more: float) -> dict[str, float]:
    return {"frames": at, "train/return_mean": -300.0 + at + seed, "train/loss": 0.5} | more


def fill(path: Path, seed: int) -> Path:
    """A table as train.py writes it: a value that is not there yet, one that is not finite, and columns of others."""
    with MetricsTable(path, LATER) as table:
        table.write({"frames": 10, "train/return_mean": math.nan, "train/loss": 0.5})
        table.write(row(20, seed, **{"eval/return_mean": 5.5 + seed, "eval/success_rate": 0.25}))
        table.write(row(30, seed, **{"ibe/came_true": 0.125, "ibe/skipped": 3.0}))
        table.write({"frames": 40, "train/return_mean": math.inf, "train/loss": 0.5})
    return path


@pytest.fixture
def tables(tmp_path: Path) -> dict[str, Path]:
    return {name: fill(tmp_path / f"{seed}.csv", seed) for seed, name in enumerate(NAMES)}


def written(folder: Path, tables: Mapping[str, Path]) -> Rows:
    Overlay(folder / "overlay.rrd", tables).close()
    return read(folder / "overlay.rrd")


def curve(rows: Rows, name: str, of: str) -> dict[int, float]:
    found = rows.get(f"/{name}/{of.replace('=', chr(92) + '=')}", [])
    values = [value for [value] in column(found, "Scalars:scalars")]
    return dict(zip(frames(found), values, strict=True))


def style(rows: Rows, name: str, of: str, component: str) -> Any:
    found = rows[f"/{name}/{of.replace('=', chr(92) + '=')}"]
    return next(row[component] for row in found if row.get(component) is not None)


def plots(path: Path) -> set[str]:
    """Titles of the plots in all layouts of a recording."""
    reader, title = RrdReader(str(path)), "ViewBlueprint:display_name"
    batches = [chunk.to_record_batch() for one in reader.blueprints() for chunk in reader.stream(store=one)]
    return {name for batch in batches if title in batch.schema.names for [name] in batch[title].to_pylist()}


def test_the_curves_are_those_of_the_csv_files(tmp_path: Path, tables: dict[str, Path]) -> None:
    rows = written(tmp_path, tables)
    for name, path in tables.items():
        with path.open() as stream:
            table = list(csv.DictReader(stream))
        for metric in ("train/return_mean", *LATER[:3]):
            expected = {int(one["frames"]): float(one[metric]) for one in table if one[metric] not in ("", "inf")}
            assert curve(rows, metric, name) == expected != {}
    shown = {entity.rpartition("/")[0] for entity in rows if "seed" in entity}
    assert shown == {"/train/return_mean", "/eval/return_mean", "/eval/success_rate", "/ibe/came_true"}
    assert {key for found in rows.values() for one in found for key in one} & {"log_time", "log_tick"} == set()


def test_a_run_has_one_colour_in_all_plots_and_its_name_in_the_legend(tmp_path: Path, tables: dict[str, Path]) -> None:
    rows = written(tmp_path, tables)
    metrics = ("train/return_mean", *LATER[:3])
    for name in NAMES:
        assert len({tuple(style(rows, metric, name, "SeriesLines:colors")) for metric in metrics}) == 1
        assert style(rows, "train/return_mean", name, "SeriesLines:names") == [name]
        assert style(rows, "ibe/came_true", name, "SeriesPoints:names") == [name]
        assert style(rows, "eval/return_mean", name, "SeriesPoints:names") == [f"{name}, greedy policy"]
    first, second = (style(rows, "ibe/came_true", name, "SeriesLines:colors") for name in NAMES)
    assert first != second
    assert len(set(RUN_COLOURS)) == len(RUN_COLOURS) == 8


def test_more_runs_than_colours_are_all_shown(tmp_path: Path, tables: dict[str, Path]) -> None:
    rows = written(tmp_path, {str(i): tables["seed=1"] for i in range(9)})
    assert curve(rows, "eval/return_mean", "0") == curve(rows, "eval/return_mean", "8") == {20: 6.5}
    assert style(rows, "ibe/came_true", "0", "SeriesLines:colors") == style(
        rows, "ibe/came_true", "8", "SeriesLines:colors"
    )


def test_only_plots_with_a_value_are_laid_out(tmp_path: Path, tables: dict[str, Path]) -> None:
    written(tmp_path, tables)
    assert plots(tmp_path / "overlay.rrd") == {
        "Return per episode",
        "Success, greedy policy",
        "Share that went as predicted",
    }
    every = {metric for metrics in PLOTS.values() for metric in metrics}
    assert [view.name for view in curves_blueprint(every).root_container.contents] == list(PLOTS)


def test_what_a_run_adds_is_followed(tmp_path: Path, tables: dict[str, Path]) -> None:
    """The second run has no table when it is opened; rows and a whole new plot come later."""
    growing = tmp_path / "growing.csv"
    overlay = Overlay(tmp_path / "overlay.rrd", {"old": tables["seed=0"], "new": growing})
    with MetricsTable(growing, ("train/success_rate",)) as table:
        for at in (1, 2, 3):
            table.write(row(at, 0))
            overlay.update()
            assert list(curve(read(tmp_path / "overlay.rrd"), "train/return_mean", "new")) == list(range(1, at + 1))
        assert "Success, training" not in plots(tmp_path / "overlay.rrd")
        table.write(row(4, 0, **{"train/success_rate": 0.75}))
    overlay.update()
    overlay.update()
    overlay.close()
    rows = read(tmp_path / "overlay.rrd")
    assert curve(rows, "train/return_mean", "new") == {at: at - 300.0 for at in (1, 2, 3, 4)}
    assert curve(rows, "train/success_rate", "new") == {4: 0.75}
    assert len(column(rows["/train/return_mean/new"], "Scalars:scalars")) == 4
    assert "Success, training" in plots(tmp_path / "overlay.rrd")


def test_a_line_that_is_being_written_is_not_taken(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    whole = b"frames,train/return_mean\r\n10,-1.5\r\n20,123.5\r\n"
    path.write_bytes(b"")
    overlay = Overlay(tmp_path / "overlay.rrd", {"run": path})
    seen = []
    for end in range(len(whole) + 1):  # byte by byte
        path.write_bytes(whole[:end])
        overlay.update()
        seen.append(curve(read(tmp_path / "overlay.rrd"), "train/return_mean", "run"))
    overlay.close()
    first, second = whole.index(b"-1.5\r\n") + 6, len(whole)
    assert [found for found in seen[:first] if found] == []
    assert all(found == {10: -1.5} for found in seen[first:second])
    assert seen[second] == {10: -1.5, 20: 123.5}


@pytest.mark.parametrize(
    "content",
    [
        b"time,train/return_mean\n1,2\n",
        b"frames,train/return_mean\n1,two\n",
        b"\xff\xfe\n",
    ],
)
def test_what_is_no_table_of_metrics_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "metrics.csv").write_bytes(content)
    with pytest.raises(ConfigError, match=r"metrics.csv: allowed are the metrics that train.py writes \("):
        Overlay(tmp_path / "overlay.rrd", {"run": tmp_path / "metrics.csv"})
