"""The moving picture is put together from what a viewer shows."""

import io
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image
from view_data import free_ports

from docs_site import moving_picture
from ibe_rl.view.blueprint import FILM


class Viewer:
    """Shows the step as a shade of grey, at the second look; before that, for a while, a white notice."""

    def __init__(self) -> None:
        self.step, self.looks = 0, 0

    def open(self, url: str) -> None:
        self.opened, self.free_at = url, time.monotonic() + 0.1

    def get_state(self) -> SimpleNamespace:
        line = SimpleNamespace(name=FILM, start=0, end=10)
        return SimpleNamespace(recordings=[SimpleNamespace(timelines=[line])])

    def set_time(self, timeline: str, *, sequence: int, play_state: str) -> None:
        self.step, self.looks = sequence, 0

    def take_screenshot(self) -> bytes:
        self.looks += 1
        shade = 20 * self.step if self.looks > 1 and time.monotonic() > self.free_at else 255
        stream = io.BytesIO()
        Image.new("RGB", (100, 84), (shade, shade, shade)).save(stream, "PNG")
        return stream.getvalue()


def test_every_fourth_step_and_the_last_one_are_shown_once_they_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def viewer():
        yield Viewer()

    monkeypatch.setattr(moving_picture, "headless_viewer", viewer)
    monkeypatch.setattr(moving_picture, "NOTICE_S", 0.2)
    moving_picture.main(tmp_path / "demo.rrd", tmp_path / "moving.webp")
    with Image.open(tmp_path / "moving.webp") as image:
        assert image.n_frames == 3
        assert image.size == (moving_picture.WIDTH, moving_picture.WIDTH // 2)
        shades = []
        for frame in range(3):
            image.seek(frame)
            shades.append(image.convert("RGB").getpixel((5, 5))[0])
    assert shades == pytest.approx([80, 160, 200], abs=3)


def test_a_viewer_that_does_not_answer_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moving_picture, "START_S", 0)
    with pytest.raises(ConnectionError):
        moving_picture.connected(f"rerun+http://127.0.0.1:{free_ports().grpc}/proxy")
