"""What it would do if it were told something else, in the recording, read back."""

from pathlib import Path

import numpy as np
from view_data import ASKED_EVERY, TASK, Rows, asked, column, filmed, frames, read, refreshed

from ibe_rl.explain.what_if import values_of
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.what_if import last_asked, sentence_at, told_shades

VALUES = values_of(TASK)


def recorded(path: Path, *films: bool) -> Rows:
    """A recording of as many episodes, asked or not."""
    recorder = Recorder(path, TASK, "asked", training=False)
    watched, said, real = filmed()
    recorder.refresh(refreshed())
    for number, with_answers in enumerate(films, start=1):
        recorder.watched(number * 100_000, watched, asked(said) if with_answers else said, real)
    recorder.close()
    return read(path)


def test_faint_paths_of_all_values_begin_where_it_was_asked(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "a.rrd", True)
    said = filmed()[1]
    drawn = [row for row in rows["/scene/what_if"] if row.get("LineStrips2D:strips") is not None]
    steps = list(range(0, len(said), ASKED_EVERY))
    assert [row["frames"] - 100_000 for row in drawn] == steps
    first = np.array(drawn[1]["LineStrips2D:strips"])
    assert first.shape[0] == 3
    expected = TASK.scene_path(said[ASKED_EVERY].path)[::2] * (1, -1) + (0, TASK.scene_size[1])
    np.testing.assert_allclose(first[0], expected, atol=1e-4)
    assert not np.allclose(first[1], expected, atol=1e-3)


def test_a_lane_for_each_value_and_one_for_how_much_it_listens(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "a.rrd", True)
    labels = rows["/what_if/words"][-1]["Points2D:labels"]
    assert {"if to the left", "if straight down", "if to the right", "listens", "50%"} <= set(labels)
    curve = np.array(column(rows["/what_if/listens"], "LineStrips2D:strips")[-1][0])
    assert len(curve) == 2 * len(filmed()[1])
    assert np.ptp(curve[:, 1]) == 0  # it listens as much all the time
    assert len(frames(rows["/what_if/now"])) >= len(filmed()[1])


def test_answers_of_an_earlier_episode_do_not_stay(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "a.rrd", True, False)
    for entity in ("/scene/what_if", "/what_if"):
        assert frames(rows[entity])[-1] == 200_000
        assert rows[entity][-1].get("LineStrips2D:strips") is None


def test_between_the_moments_that_were_asked_the_last_answers_hold() -> None:
    said = filmed()[1]
    held = last_asked(said[:3] + asked(said)[:25])
    assert held[:3] == [None] * 3
    assert len({id(one) for one in held[3:23]}) == 1
    assert held[23] is not held[22]
    assert sentence_at(held[3], str).endswith("(listens 50%)")
    assert sentence_at(None, str) == ""


def test_values_have_the_colours_of_what_they_ask_for_and_words_colours_of_their_own() -> None:
    left, down, right = told_shades(TASK, list(VALUES)).astype(int)
    assert left[2] > left[0]
    assert right[0] > right[2]
    assert np.ptp(down) < 10
    assert len(np.unique(told_shades(TASK, ["a", "b", "c"]), axis=0)) == 3
