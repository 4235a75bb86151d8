"""What a person sees: real viewers, native and in a browser, in which every panel must be filled."""

import ctypes.util
import subprocess
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rerun.experimental import ViewerClient
from view_data import TASK, eventually, free_ports, needed, record

from ibe_rl.relay import Relay, is_free, rerun_binary
from ibe_rl.stream import Recorder

PANELS = {
    "Lunar Lander with pads: flown, predicted (dots), real (white)",
    "Return per episode",
    "Share of episodes",
    "Instruction (yellow), explanation (teal)",
    "In words",
    "Now",
    "What the best episodes did, by cluster",
    "Expression of each cluster",
    "Δx (half widths): best green, peak cut",
    "Spoken",
}
BROWSER_FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "recording.rrd"
    record(path)
    return path


def pixels(path: Path) -> np.ndarray:
    """A picture ``(h, w, 3)`` with five bits a colour, so that smoothing at edges counts little."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")) >> 3


def settled(shoot: Callable[[Path], object], path: Path) -> np.ndarray:
    """Take pictures until two in a row are the same."""
    seen: list[np.ndarray] = []

    def same() -> bool:
        shoot(path)
        seen.append(pixels(path))
        return len(seen) > 1 and np.array_equal(seen[-1], seen[-2])

    eventually(same, 15)
    return seen[-1]


def colours(picture: np.ndarray) -> int:
    return len(np.unique(picture.reshape(-1, 3), axis=0))


def changed(picture: np.ndarray, before: np.ndarray) -> float:
    """Share of the pixels that differ where both pictures are."""
    height, width = np.minimum(picture.shape, before.shape)[:2]
    return float(np.mean(np.any(picture[:height, :width] != before[:height, :width], axis=-1)))


@pytest.fixture
def viewer() -> Iterator[ViewerClient]:
    drivers = [*Path("/usr/share/vulkan/icd.d").glob("*.json"), *Path("/etc/vulkan/icd.d").glob("*.json")]
    there = ctypes.util.find_library("vulkan") is not None and bool(drivers)
    needed(there, "a Vulkan driver (apt install mesa-vulkan-drivers libvulkan1)")
    port = free_ports().grpc
    address = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1280x720"]
    with subprocess.Popen([rerun_binary(), *address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            assert eventually(lambda: not is_free(port), 20)
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            process.kill()


def panels(client: ViewerClient, path: Path, folder: Path) -> dict[str, np.ndarray]:
    """Open a recording; returns a picture of every panel by its title, and of all of it as ''."""
    client.open(str(path))
    assert eventually(lambda: not client.get_state().loading and client.get_state().views)
    shot = folder / "shot.png"
    whole = settled(lambda to: client.save_screenshot(str(to)), shot)
    pictures = {"": whole}
    for view in client.get_state().views:
        assert not view.reports
        client.save_screenshot(str(shot), view.view_id)
        pictures[view.name] = pixels(shot)
    return pictures


def test_every_panel_of_the_native_viewer_is_filled(viewer: ViewerClient, recording: Path, tmp_path: Path) -> None:
    Recorder(tmp_path / "empty.rrd", TASK, "empty").close()
    empty = panels(viewer, tmp_path / "empty.rrd", tmp_path)
    full = panels(viewer, recording, tmp_path)
    assert set(empty) == set(full) == PANELS | {""}
    for name, picture in full.items():
        assert colours(picture) > 1.25 * colours(empty[name]), name
        assert changed(picture, empty[name]) > 0.01, name


def test_the_view_opens_on_the_newest_frame(viewer: ViewerClient, recording: Path) -> None:
    viewer.open(str(recording))
    assert eventually(lambda: not viewer.get_state().loading and viewer.get_state().recordings)
    [opened] = viewer.get_state().recordings
    ends: dict[str, Any] = {timeline.name: timeline.end for timeline in opened.timelines}
    assert set(ends) == {"frames", "watched_step"}
    assert eventually(lambda: opened.current_timeline == "frames" and opened.current_time == ends["frames"])


def test_the_page_of_the_relay_shows_the_recording(recording: Path, tmp_path: Path) -> None:
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    ports = free_ports()
    with Relay(recording, ports) as relay, sync_playwright() as driver:
        assert eventually(lambda: not is_free(ports.web), 20)
        with driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
            page = browser.new_page(viewport={"width": 960, "height": 540}, color_scheme="dark")
            page.goto(relay.address + "&renderer=webgl")
            page.wait_for_selector("canvas.visible", timeout=30_000)
            shot = tmp_path / "page.png"

            def filled() -> bool:
                page.screenshot(path=shot)
                return colours(pixels(shot)) > 300

            assert eventually(filled, 30), colours(pixels(shot))
