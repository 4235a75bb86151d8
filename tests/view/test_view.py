"""What a person sees: real viewers, native and in a browser, in which every panel must be filled."""

from importlib.util import find_spec
from itertools import combinations
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.experimental import ViewerClient
from view_data import HORIZON_STEPS, TASK, developed, eventually, free_ports, needed, record
from viewers import BROWSER_FLAGS, FILLED, colours, new_share, opened, panels, pixels, settled
from viewers import viewer as viewer  # a fixture

from ibe_rl.runtime.ports import is_free
from ibe_rl.view import sentences
from ibe_rl.view.address import page as page_of_relay
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import Relay

PANELS = {
    "Lunar Lander with pads: path and prediction",
    "If it were told otherwise",
    "Instruction and explanation, step by step",
    "Now",
    "Its vocabulary",
    "Movements in its best episodes, and their clusters",
    "x change (half widths): best green, highest bar cut",
    "Instruction (yellow), explanation (teal); right-click goes there",
    "Return per episode",
    "Success (share of episodes)",
    "Are its words true? (0 to 1)",
    "What each refresh changed",
    "Expression of each cluster",
}
TEXTS = ("Its vocabulary", "Now")
"""Text is there from the beginning, in the same colours."""
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
    viewer.set_time("frames", sequence=developed()[2].frame + HORIZON_STEPS + 20, play_state="paused")
    shares: dict[str, float] = {}

    def filled() -> bool:
        for name, picture in panels(viewer, shot).items():
            changed = float(np.mean(picture != empty[name])) if name in TEXTS else new_share(picture, empty[name])
            shares[name] = changed
        return min(shares.values()) > FILLED

    assert eventually(filled), shares


def test_the_view_opens_as_a_film_that_plays_to_its_end(viewer: ViewerClient, recording: Path) -> None:
    viewer.open(str(recording))
    assert eventually(lambda: not viewer.get_state().loading and viewer.get_state().recordings)
    [shown] = viewer.get_state().recordings
    ends: dict[str, Any] = {timeline.name: timeline.end for timeline in shown.timelines}
    assert set(ends) == {"frames", "film"}
    assert shown.current_timeline == "film"
    assert eventually(lambda: viewer.get_state().recordings[0].current_time == ends["film"])


def test_a_recording_of_an_earlier_version_keeps_its_own_timeline_beside_a_new_one(
    viewer: ViewerClient, recording: Path, tmp_path: Path
) -> None:
    """Earlier ones had another application: rerun keeps one layout for each."""
    with rr.RecordingStream("ibe_rl", recording_id="old") as old:
        panels_then = rrb.Blueprint(
            rrb.TextDocumentView(origin="/now", name="Now"),
            rrb.TimePanel(timeline="watched_step", play_state="playing"),
            auto_views=False,
        )
        old.set_sinks(rr.FileSink(tmp_path / "old.rrd"), default_blueprint=panels_then)
        old.set_log_time_enabled(False)
        for step in range(10):
            old.set_time("watched_step", sequence=step)
            old.log("now", rr.TextDocument(f"step {step}"))
        old.flush()
    opened(viewer, tmp_path / "old.rrd")
    assert {view.name for view in viewer.get_state().views} == {"Now"}
    opened(viewer, recording)
    assert eventually(
        lambda: {one.current_timeline for one in viewer.get_state().recordings} == {"watched_step", "film"}
    )


def test_the_table_of_the_vocabulary_is_whole(viewer: ViewerClient, tmp_path: Path) -> None:
    """The row of the cluster just spoken is bold: that of the last one changes, well above the panel's edge."""
    refresh, name, path = developed()[0], "Its vocabulary", tmp_path / "recording.rrd"
    recorder = Recorder(path, TASK, "run")
    for frame, spoken in ((1, None), (2, int(refresh.mapping.ids[-1])), (3, int(refresh.mapping.ids[0]))):
        recorder._recording.set_time("frames", sequence=frame)
        recorder._show("words", sentences.standing(refresh, TASK, spoken))
    recorder.close()
    opened(viewer, path)
    pictures = []
    for frame in (1, 2, 3):
        viewer.set_time("frames", sequence=frame, play_state="paused")
        assert eventually(lambda at=frame: viewer.get_state().recordings[0].current_time == at)
        pictures.append(settled(viewer, name, tmp_path / "shot.png"))
    rows = [np.flatnonzero(np.any(picture != pictures[0], axis=(1, 2))) for picture in pictures[1:]]
    [last, first] = [changed[(changed > 30)] for changed in rows]  # below the title
    assert len(last) > 5
    assert last.max() - last.min() == pytest.approx(first.max() - first.min(), abs=6)  # not cut in the middle
    assert last.max() < len(pictures[0]) - 10


def test_scrubbing_back_shows_the_clusters_of_that_time(viewer: ViewerClient, recording: Path, tmp_path: Path) -> None:
    opened(viewer, recording)
    frames = [refresh.frame for refresh in developed()]

    def visit(frame: int) -> dict[str, np.ndarray]:
        viewer.set_time("frames", sequence=frame + 20, play_state="paused")
        assert eventually(lambda: viewer.get_state().recordings[0].current_time == frame + 20)
        return {name: settled(viewer, name, tmp_path / "shot.png") for name in CLUSTERS}

    seen = {frame: visit(frame) for frame in frames}

    def as_before() -> bool:
        """A busy viewer draws late: what was seen before may be what stood there earlier."""
        again = {frame: visit(frame) for frame in frames}
        same = all(new_share(again[at][name], seen[at][name]) < FILLED for at in frames for name in CLUSTERS)
        seen.update(again)
        return same

    assert eventually(as_before)
    for one, other in combinations(frames, 2):
        assert all(np.mean(seen[one][name] != seen[other][name]) > FILLED for name in CLUSTERS)


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
            page.wait_for_selector("canvas.visible", timeout=120_000)
            shot = tmp_path / "page.png"

            def filled() -> bool:
                page.screenshot(path=shot)
                return len(np.unique(colours(pixels(shot)))) > 300

            assert eventually(filled), len(np.unique(colours(pixels(shot))))
