"""The pictures of curves, read back."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from view_data import TASK, Rows, column, developed, frames, read

from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.view import blueprint, curves
from ibe_rl.view import palette as colours
from ibe_rl.view.curves import BOTTOM, LEFT, RIGHT, TOP, Chart, Drawing
from ibe_rl.view.recorder import Recorder

CHART = Chart("chart", "A chart", {"up": ("rises", colours.GREEN), "down": ("falls", colours.PINK)}, (0, 1))


def drawn(path: Path, drawing: Drawing) -> Rows:
    with rr.RecordingStream("test") as recording:
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(path))
        recording.set_time("frames", sequence=0)
        drawing.draw(recording)
        recording.flush()
    return read(path)


def words_of(rows: Rows, entity: str = "/chart") -> dict[str, tuple[float, float]]:
    """The last words of a chart and where they are."""
    row = rows[f"{entity}/words"][-1]
    return dict(zip(row["Points2D:labels"], map(tuple, row["Points2D:positions"]), strict=True))


def test_a_curve_goes_from_edge_to_edge_against_thousands_of_frames(tmp_path: Path) -> None:
    drawing = Drawing([CHART])
    drawing.add("up", [(0, 0.0), (100_000, 0.5), (200_000, 1.0)])
    drawing.add("down", [(0, 1.0), (200_000, float("nan"))])
    drawing.add("of another chart", [(400_000, 5.0)])
    rows = drawn(tmp_path / "a.rrd", drawing)
    strips, shades = (rows["/chart/lines"][0][f"LineStrips2D:{what}"] for what in ("strips", "colors"))
    [line] = [strip for strip, shade in zip(strips, shades, strict=True) if shade >> 8 == 0x84E060]
    middle = (LEFT + RIGHT) / 2  # the other chart counts twice as far
    assert np.allclose(line, [(LEFT, BOTTOM), ((LEFT + middle) / 2, (TOP + BOTTOM) / 2), (middle, TOP)])
    words = words_of(rows)
    assert {"0", "0.5", "1", "200", "400", curves.AXIS_TITLE, "rises"} <= set(words)
    assert "falls" not in words  # its curve has ended
    assert words["400"][0] == pytest.approx(RIGHT)


def test_names_stand_beside_their_curves_in_the_same_order_and_apart(tmp_path: Path) -> None:
    drawing = Drawing([replace(CHART, curves={f"{i}": (f"curve {i}", colours.BLUE) for i in range(8)})])
    ends = [0.5, 0.51, 0.49, 0.0, 1.0, 0.02, 0.5, 0.01]
    for i, end in enumerate(ends):
        drawing.add(f"{i}", [(0, 0.5), (1000, end)])
    words = words_of(drawn(tmp_path / "a.rrd", drawing))
    places = [words[f"curve {i}"] for i in np.argsort(-np.array(ends), kind="stable")]
    assert all(low[1] - high[1] >= curves.NAME_HEIGHT - 1e-6 for high, low in pairwise(places))
    assert all(x > RIGHT and 0 <= y <= curves.SIZE[1] - curves.NAME_HEIGHT for x, y in places)


def test_a_curve_of_many_rows_keeps_its_newest_and_is_drawn_again_when_it_shows(tmp_path: Path) -> None:
    drawing = Drawing([CHART])
    assert not drawing.due()
    for frame in range(5000):
        drawing.add("up", [(frame, 0.5)])
    assert len(drawing.rows["up"]) <= curves.KEPT_ROWS
    assert drawing.rows["up"][-1] == (4999, 0.5)
    assert drawing.due()
    drawn(tmp_path / "a.rrd", drawing)
    drawing.add("up", [(5000, 0.5)])
    assert not drawing.due()
    assert "/chart/lines" not in drawn(tmp_path / "b.rrd", Drawing([CHART]))  # it has nothing to draw


def test_a_curve_that_stays_is_drawn_in_the_middle(tmp_path: Path) -> None:
    drawing = Drawing([replace(CHART, limits=None)])
    drawing.add("up", [(0, 7.0), (10, 7.0)])
    [point, _] = drawn(tmp_path / "a.rrd", drawing)["/chart/dots"][0]["Points2D:positions"]
    assert point[1] == pytest.approx((TOP + BOTTOM) / 2)


def test_every_curve_of_a_run_is_in_a_chart_with_its_name(rows: Rows) -> None:
    last = developed()[-1]
    words = words_of(rows, "/charts/expression")
    assert {f"#{name}" for name in last.mapping.ids} == {word for word in words if word.startswith("#")}
    assert {"training", "greedy policy"} <= set(words_of(rows, "/charts/return")) & set(
        words_of(rows, "/charts/success")
    )
    assert {"as predicted", "motion AUC"} <= set(words_of(rows, "/charts/truth"))
    assert {"policy drift", "word drift"} <= set(words_of(rows, "/charts/change"))
    assert frames(rows["/charts/return/lines"])[:2] == [100_000, 200_000]


def test_a_recording_that_goes_on_goes_on_with_its_curves(tmp_path: Path) -> None:
    first = Recorder(tmp_path / "a.rrd", TASK, "run")
    first.batch(1000, {"train/return_mean": 1.0})
    first.refresh(replace(developed()[0], frame=2000))
    state = first.state_dict()
    first.close()
    second = Recorder(tmp_path / "b.rrd", TASK, "run", state=state)
    second.batch(3000, {"train/return_mean": 2.0})
    second.close()
    rows = read(tmp_path / "b.rrd")
    assert len(rows["/charts/return/dots"][-1]["Points2D:positions"]) == 2
    assert len(column(rows["/curves/train/return_mean"], "Scalars:scalars")) == 1


def test_two_numbers_have_a_chart_each() -> None:
    charts = blueprint.charts(LANDER_SPEED_TASK)
    assert [chart.title for chart in charts[-2:]] == ["x: Expression of each cluster", "vy: Expression of each cluster"]
    assert charts[-1].named({"development/vy/3", "development/x/4"}).keys() == {"development/vy/3"}


def test_names_that_do_not_fit_below_one_another_stand_in_columns() -> None:
    few = curves.names([(f"#{one}", (1, 2, 3), 0.1 * one) for one in range(8)])
    assert {x for (x, _), *_ in few} == {curves.NAMES_AT}
    many = curves.names([(f"#{one}", (1, 2, 3), 0.1 * one) for one in range(16)])
    columns = {x: [y for (at, y), *_ in many if at == x] for x in sorted({x for (x, _), *_ in many})}
    assert len(columns) == 2
    assert sum(columns) / 2 == pytest.approx(curves.NAMES_AT)
    for heights in columns.values():
        assert np.all(np.diff(heights) >= curves.NAME_HEIGHT - 1e-9)
        assert max(heights) < curves.SIZE[1] - curves.NAME_HEIGHT
