"""Opening runs again: which, under which names, all that is in them, and nothing is left afterwards."""

import io
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
import rerun as rr
import yaml
from PIL import Image
from processes import SMALL, call, gone, server_of
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient
from view_data import TASK, eventually, free_ports, needed
from viewers import BROWSER_FLAGS, FILLED, new_share, opened, panels
from viewers import viewer as viewer  # a fixture

from ibe_rl.runtime.operating_system import children_of
from ibe_rl.runtime.ports import is_free
from ibe_rl.storage.run_folder import METRICS, MetricsTable, read_json, read_rows
from ibe_rl.types import ConfigError
from ibe_rl.view import relay as relay_module
from ibe_rl.view.address import page as page_at
from ibe_rl.view.address import port_forward
from ibe_rl.view.overlay import OVERLAY_APPLICATION, PLOT_COLUMNS, PLOTS, Overlay, curves_blueprint
from ibe_rl.view.palette import RUN_COLOURS
from ibe_rl.view.recorder import APPLICATION as RUN_APPLICATION
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import rerun_binary
from ibe_rl.view.viewer import Messages, append_new_messages, open_recordings, run_names, runs_at, with_curves

SHORT = ["total_frames=4000", "eval_every_frames=2000"]
SHOWN = {"train/return_mean", "eval/return_mean", "train/success_rate", "eval/success_rate", "ibe/came_true"}


def make_run(folder: Path, *overrides: str, recorded: bool = True, curves: bool = True) -> Path:
    (folder / ".hydra").mkdir(parents=True)
    (folder / ".hydra" / "config.yaml").touch()
    (folder / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump(list(overrides)))
    if recorded:
        Recorder(folder / "recording.rrd", TASK, folder.name).close()
    if curves:
        with MetricsTable(folder / "metrics.csv") as table:
            table.write({"frames": 10, "train/return_mean": 1.5})
    return folder


def test_a_run_a_recording_and_a_sweep_are_found(tmp_path: Path) -> None:
    runs = [make_run(tmp_path / "sweep" / f"{i}_seed={i}", recorded=i == 0) for i in (10, 2, 1, 0)]
    (tmp_path / "sweep" / "notes").mkdir()
    (tmp_path / "sweep" / "multirun.yaml").touch()
    assert runs_at(tmp_path / "sweep") == runs[::-1]
    assert runs_at(runs[0]) == [runs[0]]
    assert runs_at(runs[-1] / "recording.rrd") == [runs[-1]]
    (tmp_path / "episode.rrd").touch()
    assert runs_at(tmp_path / "episode.rrd") == [tmp_path / "episode.rrd"]


def test_runs_are_named_after_what_differs(tmp_path: Path) -> None:
    first = make_run(tmp_path / "a", "seed=0", "mapping.n_clusters=4", "run_dir=a", "viewer=off")
    second = make_run(tmp_path / "b", "seed=1", "mapping.n_clusters=4", "run_dir=b", "viewer=file")
    third = make_run(tmp_path / "c", "mapping.n_clusters=5", "+env.kwargs.pad=left", "run_dir=c")
    assert run_names([first]) == ["a"]
    assert run_names([first, second]) == ["seed=0", "seed=1"]
    assert run_names([first, second, third]) == [
        "seed=0, mapping.n_clusters=4",
        "seed=1, mapping.n_clusters=4",
        "mapping.n_clusters=5, env.kwargs.pad=left",
    ]
    (tmp_path / "episode.rrd").touch()
    assert run_names([first, tmp_path / "episode.rrd"]) == ["a", "episode"]


def test_no_two_names_are_alike(tmp_path: Path) -> None:
    same = [make_run(tmp_path / name, "seed=0") for name in ("a", "b")]
    assert run_names(same) == ["a", "b"]
    assert run_names([*same, make_run(tmp_path / "c", "seed=1")]) == ["seed=0 in a", "seed=0 in b", "seed=1"]
    twins = [make_run(tmp_path / name / "run", "seed=0") for name in ("x", "y")]
    assert run_names(twins) == [str(run) for run in twins]


@pytest.mark.parametrize("text", ["{a: b}", "[unclosed", "\x00", "- 5\n- null"])
def test_overrides_that_cannot_be_read_are_no_obstacle(text: str, tmp_path: Path) -> None:
    runs = [make_run(tmp_path / name, "seed=0") for name in ("a", "b")]
    (runs[0] / ".hydra" / "overrides.yaml").write_text(text)
    assert len(set(run_names(runs))) == 2


def test_curves_are_laid_over_each_other_for_several_runs_or_where_there_is_nothing_else(tmp_path: Path) -> None:
    one, two = make_run(tmp_path / "one"), make_run(tmp_path / "two", recorded=False)
    assert with_curves({"one": one}) == {}
    assert with_curves({"two": two}) == {"two": two / "metrics.csv"}
    assert with_curves({"one": one, "two": two}) == {"one": one / "metrics.csv", "two": two / "metrics.csv"}
    assert with_curves({"episode": one / "recording.rrd"}) == {}


def test_where_there_is_nothing_to_show_it_is_said_so(tmp_path: Path) -> None:
    run = make_run(tmp_path / "begun", recorded=False, curves=False)
    with pytest.raises(ConfigError, match=r"begun: neither recording.rrd nor metrics.csv is there \(yet\)"):
        with_curves({"begun": run})


def frames_in(path: Path) -> dict[str, list[int]]:
    """Frames of each curve in a file that holds several recordings."""
    reader = RrdReader(str(path))
    chunks = [chunk for one in reader.recordings() for chunk in reader.stream(store=one)]
    curves = [chunk for chunk in chunks if chunk.entity_path.startswith("/curves/train/")]
    found: dict[str, list[int]] = {}
    for chunk in curves:
        frames = chunk.to_record_batch().to_pydict().get("frames", [])
        found.setdefault(chunk.entity_path.rpartition("/")[2], []).extend(frames)
    return {name: sorted(frames) for name, frames in found.items() if frames}


def test_recordings_that_grow_are_gathered_into_one(tmp_path: Path) -> None:
    paths = {name: tmp_path / f"{name}.rrd" for name in ("a", "b")}
    with (tmp_path / "shown.rrd").open("wb") as shown:
        parts = [Messages(path) for path in paths.values()]
        append_new_messages(parts, shown)  # neither is there yet
        assert shown.tell() == 0
        recorders = {name: Recorder(path, TASK, name) for name, path in paths.items()}
        for frame in (1, 2, 3):
            for name, recorder in recorders.items():
                recorder.batch(frame, {f"train/{name}": 1.0})
                recorder.flush()
            append_new_messages(parts, shown)
            assert frames_in(tmp_path / "shown.rrd") == {name: list(range(1, frame + 1)) for name in paths}
        for recorder in recorders.values():
            recorder.close()
        append_new_messages(parts, shown)
        append_new_messages(parts, shown)
    assert len(RrdReader(str(tmp_path / "shown.rrd")).recordings()) == 2
    assert frames_in(tmp_path / "shown.rrd") == {"a": [1, 2, 3], "b": [1, 2, 3]}


def test_a_half_written_message_waits_for_its_end(tmp_path: Path) -> None:
    Recorder(tmp_path / "whole.rrd", TASK, "run").close()
    whole, growing = (tmp_path / "whole.rrd").read_bytes(), tmp_path / "growing.rrd"
    part, sizes = Messages(growing), []
    with (tmp_path / "shown.rrd").open("wb") as shown:
        for end in [*range(0, len(whole), 97), len(whole)]:
            growing.write_bytes(whole[:end])
            append_new_messages([part], shown)
            assert whole[:end].startswith((tmp_path / "shown.rrd").read_bytes())
            sizes.append(shown.tell())
    assert len(set(sizes)) > 10  # it came bit by bit
    [recording], [expected] = (RrdReader(str(tmp_path / f"{n}.rrd")).recordings() for n in ("shown", "whole"))
    assert recording == expected
    assert gathered_rows(tmp_path / "shown.rrd") == gathered_rows(tmp_path / "whole.rrd") > 10


def gathered_rows(path: Path) -> int:
    reader = RrdReader(str(path))
    stores = [*reader.recordings(), *reader.blueprints()]
    return sum(chunk.to_record_batch().num_rows for one in stores for chunk in reader.stream(store=one))


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line of error that a command line ends in."""
    with pytest.raises(SystemExit) as stopped:
        open_recordings(arguments)
    assert stopped.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


def test_what_cannot_be_opened_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*arguments: str) -> str:
        return refusal(capsys, *arguments)

    monkeypatch.chdir(tmp_path)
    assert "there is no run below runs/; train one, or name one" in refused()
    assert "nowhere: nothing to open; allowed is the folder of a run or of a sweep" in refused("nowhere")
    (tmp_path / "empty").mkdir()
    assert "empty: nothing to open" in refused("empty")
    (tmp_path / "notes.txt").write_text("no recording at all")
    assert re.search(r"notes.txt: not a recording of rerun; allowed is one that", refused("notes.txt"))
    assert "neither recording.rrd nor metrics.csv" in refused(
        str(make_run(tmp_path / "begun", recorded=False, curves=False))
    )
    run = str(make_run(tmp_path / "run"))
    assert "viewer.web_port=70000: no such port" in refused(run, "--web-port", "70000")
    (make_run(tmp_path / "other") / "metrics.csv").write_text("frames,train/return_mean\n1,two\n")
    assert "metrics.csv: allowed are the metrics that train.py writes" in refused(run, "other")
    monkeypatch.setattr(relay_module, "find_spec", lambda _: None)
    assert "rerun viewer is not installed" in refused(run)


@contextmanager
def viewing(*arguments: str | Path, temporary: Path) -> Iterator[subprocess.Popen[str]]:
    """The viewer as a user starts it; killed at the end if it has not ended by then."""
    command = [sys.executable, "-m", "ibe_rl.viewer", *map(str, arguments)]
    environment = os.environ | {"TMPDIR": str(temporary)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def said(process: subprocess.Popen[str]) -> str:
    """What it prints until it says how to end it."""
    assert process.stdout is not None
    lines = []
    while not lines or "Ctrl-C" not in lines[-1]:
        lines.append(process.stdout.readline())
        assert lines[-1], process.stderr.read() if process.stderr else ""
    return "".join(lines)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_runs_are_served_until_they_are_closed(number: signal.Signals, tmp_path: Path) -> None:
    for seed in (0, 1):
        make_run(tmp_path / "sweep" / f"run{seed}", f"seed={seed}")
    (tmp_path / "tmp").mkdir()
    ports = free_ports()
    numbers = ["--grpc-port", str(ports.grpc), "--web-port", str(ports.web)]
    with viewing(tmp_path / "sweep", *numbers, temporary=tmp_path / "tmp") as process:
        text = said(process)
        assert f"seed=0: {tmp_path / 'sweep' / 'run0'}" in text
        assert f"seed=1: {tmp_path / 'sweep' / 'run1'}" in text
        assert page_at(ports) in text
        assert port_forward(ports) in text
        [relay] = children_of(process.pid)
        server = server_of(relay)
        assert len(list((tmp_path / "tmp").iterdir())) == 1
        process.send_signal(number)
        assert process.wait(240) == 0
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert gone(relay)
    assert gone(server)
    assert list((tmp_path / "tmp").iterdir()) == []
    assert not list((tmp_path / "sweep").glob("*/viewer.log"))  # nothing is written into a run


def test_a_server_that_dies_ends_it(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run")
    with viewing(run, temporary=tmp_path) as process:
        said(process)
        os.kill(server_of(children_of(process.pid)[0]), signal.SIGKILL)
        assert process.wait(240) == 1
        assert process.stderr is not None
        assert "the server has ended" in process.stderr.read()


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Two trainings, and what was printed."""
    folder = tmp_path_factory.mktemp("viewer") / "sweep"
    with redirect_stdout(io.StringIO()) as printed:
        call("train", "-m", "seed=0,1", *SMALL, *SHORT, f"run_dir={folder}", "viewer=file")
    return folder, printed.getvalue()


@pytest.fixture(scope="module")
def sweep(swept: tuple[Path, str]) -> Path:
    return swept[0]


def test_a_sweep_makes_a_folder_a_run(swept: tuple[Path, str]) -> None:
    folder, output = swept
    runs = sorted(path.parent for path in folder.glob("*/summary.json"))
    assert [read_json(run / "summary.json")["seed"] for run in runs] == [0, 1]
    assert len({read_rows(run / METRICS)[-1]["train/return_mean"] for run in runs}) == 2
    assert [name_of(run / "recording.rrd") for run in runs] == ["seed=0", "seed=1"]
    assert f"-m ibe_rl.viewer {folder}\n" in output


def name_of(recording: Path) -> str:
    chunks = [chunk.to_record_batch() for chunk in RrdReader(str(recording)).stream()]
    [name] = [
        chunk["RecordingInfo:name"][0].as_py()[0] for chunk in chunks if "RecordingInfo:name" in chunk.schema.names
    ]
    return str(name)


@pytest.fixture(scope="module")
def address(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The page on which both runs of the sweep and their curves are open."""
    with viewing(sweep, temporary=tmp_path_factory.mktemp("served")) as process:
        try:
            page = str(re.findall(r"live view: (\S+)", said(process))[0])
            assert eventually(lambda: not is_free(urlsplit(data_of(page)).port or 0))
            yield page
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(240)


def data_of(page: str) -> str:
    """Where a page has its data from."""
    [url] = parse_qs(urlsplit(page).query)["url"]
    return url


@pytest.fixture
def heard(address: str, tmp_path: Path) -> Path:
    """What a viewer receives that opens the address."""
    path = tmp_path / "heard.rrd"
    listen = [rerun_binary(), data_of(address), "--save", path, "--port", str(free_ports().grpc)]
    with subprocess.Popen(listen, stderr=subprocess.DEVNULL) as listener:
        try:
            assert eventually(lambda: path.exists() and drawn_in(path) >= SHOWN)
        finally:
            listener.terminate()
    return path


def drawn_in(path: Path) -> set[str]:
    """Metrics with a curve for both runs, in a file that may be cut in the middle of a message."""
    try:
        reader = RrdReader(str(path))
        overlays = [one for one in reader.recordings() if one.application_id == OVERLAY_APPLICATION]
        chunks = [chunk for one in overlays for chunk in reader.stream(store=one)]
    except (RuntimeError, ValueError, OSError):
        return set()
    found = {chunk.entity_path for chunk in chunks if "Scalars:scalars" in chunk.to_record_batch().schema.names}
    return {name for name in SHOWN if {rf"/{name}/seed\={seed}" for seed in (0, 1)} <= found}


def test_all_recordings_arrive(heard: Path) -> None:
    applications = [one.application_id for one in RrdReader(str(heard)).recordings()]
    assert sorted(applications) == sorted([RUN_APPLICATION, RUN_APPLICATION, OVERLAY_APPLICATION])


def plots_of(viewer: ViewerClient, shot: Path) -> dict[str, np.ndarray]:
    """A picture of every plot; none while the viewer turns from one layout to the next."""
    try:
        return panels(viewer, shot)
    except ConnectionError:
        return {}


def test_every_plot_of_the_overlay_is_filled(viewer: ViewerClient, tmp_path: Path) -> None:
    """The same overlay without data is what "filled" is measured against."""
    random, tables = np.random.default_rng(0), {name: tmp_path / f"{name}.csv" for name in ("a", "b", "c")}
    for path in tables.values():
        with MetricsTable(path) as table:
            for at in range(20):
                table.write(
                    {"frames": 1000 * at}
                    | dict(zip(PLOT_COLUMNS, random.uniform(0, 1, len(PLOT_COLUMNS)), strict=True))
                )
    with rr.RecordingStream(OVERLAY_APPLICATION) as empty:
        empty.set_sinks(rr.FileSink(tmp_path / "empty.rrd"), default_blueprint=curves_blueprint(set(PLOT_COLUMNS)))
        empty.flush()
    opened(viewer, tmp_path / "empty.rrd")
    shot = tmp_path / "shot.png"
    before: dict[str, np.ndarray] = {}
    assert eventually(lambda: before.update(plots_of(viewer, shot)) or set(before) == set(PLOTS)), set(before)
    Overlay(tmp_path / "overlay.rrd", tables).close()
    opened(viewer, tmp_path / "overlay.rrd")
    shares: dict[str, float] = {}

    def filled() -> bool:
        now = plots_of(viewer, shot)
        shares.update({name: new_share(now[name], picture) for name, picture in before.items() if name in now})
        return len(shares) == len(before) and min(shares.values()) > FILLED

    assert eventually(filled), shares


def test_the_page_opens_on_the_curves_of_both_runs(address: str, tmp_path: Path) -> None:
    """The colours of the two runs are nowhere on the page but in the curves and their legends."""
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = shutil.which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver, driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
        page = browser.new_page(viewport={"width": 960, "height": 540}, color_scheme="dark")
        page.goto(address + "&renderer=webgl")
        page.wait_for_selector("canvas.visible", timeout=120_000)
        shot, counts = tmp_path / "page.png", [0]

        def drawn() -> bool:
            page.screenshot(path=shot)
            with Image.open(shot) as image:
                picture = np.asarray(image.convert("RGB")).astype(int)
            counts[:] = [int((np.abs(picture - colour).max(axis=-1) < 12).sum()) for colour in RUN_COLOURS[:3]]
            return min(counts[:2]) > 300 and counts[2] < 30  # there is no third run

        assert eventually(drawn), counts
