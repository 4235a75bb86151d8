"""What a person sees: real viewers, native and in a browser, in which every panel must be filled."""

from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import pytest
from rerun.experimental import ViewerClient
from view_data import HORIZON_STEPS, TASK, developed, eventually, free_ports, needed, record
from viewers import BROWSER_FLAGS, FILLED, colours, new_share, opened, panels, pixels, settled
from viewers import viewer as viewer  # a fixture

from ibe_rl.runtime.ports import is_free
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import Relay
from ibe_rl.view.relay import page as page_of_relay

PANELS = {
    "Lunar Lander with pads: flown and predicted",
    "What it is told and says, step by step",
    "Now",
    "Its vocabulary",
    "Movements in its best episodes, and their clusters",
    "x change (half widths): best green, highest bar cut",
    "Told (yellow), said (teal) by step; right-click goes there",
    "Return per episode",
    "Success (share of episodes)",
    "Are its words true? (0 to 1)",
    "What each refresh changed",
    "Expression of each cluster",
}
CLUSTERS = ("Movements in its best episodes, and their clusters", "Expression of each cluster", "Its vocabulary")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "recording.rrd"
    record(path)
    return path


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
    viewer.set_time("frames", sequence=developed()[1].frame + HORIZON_STEPS + 20, play_state="paused")
    shares: dict[str, float] = {}

    def filled() -> bool:
        shares.update({name: new_share(picture, empty[name]) for name, picture in panels(viewer, shot).items()})
        return min(shares.values()) > FILLED

    assert eventually(filled, 30), shares


def test_the_view_opens_as_a_film_that_plays_to_its_end(viewer: ViewerClient, recording: Path) -> None:
    viewer.open(str(recording))
    assert eventually(lambda: not viewer.get_state().loading and viewer.get_state().recordings)
    [shown] = viewer.get_state().recordings
    ends: dict[str, Any] = {timeline.name: timeline.end for timeline in shown.timelines}
    assert set(ends) == {"frames", "film"}
    assert shown.current_timeline == "film"
    assert eventually(lambda: viewer.get_state().recordings[0].current_time == ends["film"])


def test_scrubbing_back_shows_the_clusters_of_that_time(viewer: ViewerClient, recording: Path, tmp_path: Path) -> None:
    opened(viewer, recording)
    seen = {}
    for refresh in (*developed(), developed()[0]):
        viewer.set_time("frames", sequence=refresh.frame + 20, play_state="paused")
        assert eventually(lambda at=refresh.frame: viewer.get_state().recordings[0].current_time == at + 20)
        if refresh.frame in seen:  # the first one again
            for name in CLUSTERS:
                first = seen[refresh.frame][name]
                assert eventually(
                    lambda name=name, first=first: (
                        new_share(settled(viewer, name, tmp_path / "shot.png"), first) < FILLED
                    )
                )
        shown = {name: settled(viewer, name, tmp_path / "shot.png") for name in CLUSTERS}
        for other in set(seen) - {refresh.frame}:
            assert all(np.mean(shown[name] != seen[other][name]) > FILLED for name in CLUSTERS)
        seen[refresh.frame] = shown


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
