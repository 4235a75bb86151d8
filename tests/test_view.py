"""What a person sees: real viewers, native and in a browser, in which every panel must be filled."""

import ctypes.util
import subprocess
from collections.abc import Iterator
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
from ibe_rl.relay import page as page_of_relay
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
FILLED = 0.003
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


def colours(picture: np.ndarray) -> np.ndarray:
    """One number for each pixel's colour ``(h, w)``."""
    return picture.astype(int) @ (1, 32, 1024)


def new_share(picture: np.ndarray, empty: np.ndarray) -> float:
    """Share of the pixels whose colour is nowhere in the empty panel: "not black" would prove nothing."""
    return float(np.mean(~np.isin(colours(picture), colours(empty))))


@pytest.fixture
def viewer() -> Iterator[ViewerClient]:
    drivers = [*Path("/usr/share/vulkan/icd.d").glob("*.json"), *Path("/etc/vulkan/icd.d").glob("*.json")]
    there = ctypes.util.find_library("vulkan") is not None and bool(drivers)
    needed(there, "a Vulkan driver (apt install mesa-vulkan-drivers libvulkan1)")
    port = free_ports().grpc
    address = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1280x720"]
    with subprocess.Popen([rerun_binary(), *address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            assert eventually(lambda: not is_free(port))
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            process.kill()


def panels(client: ViewerClient, shot: Path) -> dict[str, np.ndarray]:
    """A picture of every panel by its title, of the recording opened last."""
    pictures = {}
    for view in client.get_state().views:
        assert not view.reports
        client.save_screenshot(str(shot), view.view_id)
        pictures[view.name] = pixels(shot)
    return pictures


def opened(client: ViewerClient, path: Path) -> None:
    client.open(str(path))
    assert eventually(lambda: not client.get_state().loading and client.get_state().views)


def test_every_panel_of_the_native_viewer_is_filled(viewer: ViewerClient, recording: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    for name in ("empty.rrd", "empty too.rrd"):
        Recorder(tmp_path / name, TASK, "empty").close()
    opened(viewer, tmp_path / "empty.rrd")
    empty = panels(viewer, shot)
    assert set(empty) == PANELS
    opened(viewer, tmp_path / "empty too.rrd")
    control = panels(viewer, shot)
    assert max(new_share(control[name], empty[name]) for name in PANELS) < FILLED
    opened(viewer, recording)
    shares: dict[str, float] = {}

    def filled() -> bool:
        shares.update({name: new_share(picture, empty[name]) for name, picture in panels(viewer, shot).items()})
        return min(shares.values()) > FILLED

    assert eventually(filled, 30), shares


def test_the_view_opens_on_the_newest_frame(viewer: ViewerClient, recording: Path) -> None:
    viewer.open(str(recording))
    assert eventually(lambda: not viewer.get_state().loading and viewer.get_state().recordings)
    [shown] = viewer.get_state().recordings
    ends: dict[str, Any] = {timeline.name: timeline.end for timeline in shown.timelines}
    assert set(ends) == {"frames", "watched_step"}
    assert shown.current_timeline == "frames"
    assert eventually(lambda: viewer.get_state().recordings[0].current_time == ends["frames"])


def test_the_page_of_the_relay_shows_the_recording(recording: Path, tmp_path: Path) -> None:
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    ports = free_ports()
    with Relay(recording, ports), sync_playwright() as driver:
        assert eventually(lambda: not is_free(ports.web))
        with driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
            page = browser.new_page(viewport={"width": 960, "height": 540}, color_scheme="dark")
            page.goto(page_of_relay(ports) + "&renderer=webgl")
            page.wait_for_selector("canvas.visible", timeout=30_000)
            shot = tmp_path / "page.png"

            def filled() -> bool:
                page.screenshot(path=shot)
                return len(np.unique(colours(pixels(shot)))) > 300

            assert eventually(filled), len(np.unique(colours(pixels(shot))))
