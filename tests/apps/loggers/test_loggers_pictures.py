"""The pictures of a refresh show its clusters and the episode."""

from __future__ import annotations

from io import BytesIO

import pytest
from PIL import Image
from told import event
from view_data import TASK, developed, refreshed

from ibe_rl.apps.loggers.phrase_table import PHRASE_COLUMNS, phrase_rows
from ibe_rl.apps.loggers.pictures import draw_clusters, draw_episode, pictures_of


@pytest.mark.slow
def test_they_are_png_files_drawn_once() -> None:
    told = event(20)
    found = pictures_of(told, TASK)
    assert {name: Image.open(BytesIO(png)).size[0] for name, png in found.items()} == {"clusters": 900, "episode": 900}
    assert pictures_of(told, TASK) is found
    assert pictures_of(event(20), TASK) is not found


def test_every_cluster_has_its_bar_and_phrase() -> None:
    refresh = refreshed()
    scatter, bars = draw_clusters(refresh, TASK).axes
    assert [bar.get_width() for bar in bars.patches] == refresh.mapping.expressions[:, 0].tolist()
    labels = [label.get_text() for label in bars.get_yticklabels()]
    assert labels == [f"{row[2]}  #{row[0]}" for row in phrase_rows(refresh, TASK)]
    assert {text.get_text() for text in scatter.texts} == {f"#{name}" for name in refresh.mapping.ids}


def test_the_episode_shows_what_was_said_and_told() -> None:
    told = event(20)
    figure = draw_episode(told, TASK)
    scene, signal, said = figure.axes
    assert len(scene.collections[-1].get_offsets()) == len(told.said)
    assert [len(line.get_xdata()) for line in signal.lines] == [len(told.said)] * 2
    [legend] = figure.legends
    assert {text.get_text() for text in legend.get_texts()} == {one.said for one in told.said}
    assert said.get_xlim() == (0, len(told.said))


def test_the_table_has_what_the_file_of_the_refresh_has() -> None:
    first, second, _ = developed()
    rows = [dict(zip(PHRASE_COLUMNS, row, strict=True)) for row in phrase_rows(second, TASK)]
    assert [row["cluster"] for row in rows] == second.mapping.ids.tolist()
    assert [row["windows"] for row in rows] == [int(size) for size in second.mapping.sizes]
    new = [row["cluster"] for row in rows if not row["before"]]
    assert sorted(new) == sorted(second.change.transition.emerged if second.change else ())
    assert all(
        row["before"] == "" for row in (dict(zip(PHRASE_COLUMNS, row, strict=True)) for row in phrase_rows(first, TASK))
    )
