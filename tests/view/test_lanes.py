"""The lanes of an episode, read back."""

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from view_data import WATCHED, Rows, column, flights, frames, read

from ibe_rl.view import lanes
from ibe_rl.view.lanes import FIRST_X, LAST_X, Lane, log_lanes, step_marks


def grey(steps: int) -> np.ndarray:
    return np.full((steps, 3), 100, np.uint8)


def test_a_band_is_as_long_as_its_words_hold_and_bears_them_where_they_fit(tmp_path: Path) -> None:
    words = ["up"] * 50 + ["a long phrase"] * 2 + ["down"] * 48
    with rr.RecordingStream("test") as recording:
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(tmp_path / "a.rrd"))
        recording.set_time("frames", sequence=7)
        log_lanes(recording, [Lane("is told", words, grey(100)), Lane("next 60 steps", ["up"] * 100, grey(100))])
        recording.flush()
    rows = read(tmp_path / "a.rrd")
    bands = [np.array(band) for band in rows["/lanes/bands"][0]["LineStrips2D:strips"]]
    ends = [FIRST_X + (LAST_X - FIRST_X) * step / 100 for step in (0, 50, 52, 100)]
    drawn = [(band[:, 0].min() - lanes.PEN, band[:, 0].max() + lanes.PEN) for band in bands]
    assert np.allclose(drawn, [ends[:2], ends[1:3], ends[2:], (FIRST_X, LAST_X)])
    assert bands[3][:, 1].min() > bands[0][:, 1].max()
    shown = rows["/lanes/words"][0]["Points2D:labels"]
    assert shown == ["up", "down", "up", "is told", "next 60 steps", "step 0", "20", "40", "60", "80"]


def test_the_mark_is_at_the_step_that_is_shown(rows: Rows) -> None:
    steps = len(flights()[WATCHED[0]].moments)
    at, lines = frames(rows["/lanes/now"]), column(rows["/lanes/now"], "LineStrips2D:strips")
    assert at[:steps] == list(range(100_000, 100_000 + steps))
    assert lines[0][0][0][0] == pytest.approx(FIRST_X)
    assert lines[steps - 1][0][0][0] == pytest.approx(lanes.x_of(steps - 1, steps))
    assert len(list(step_marks(10, 2))) > 0
