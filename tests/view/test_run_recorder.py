"""A training's recording: bounded, and what goes wrong in it stays in it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from processes import assert_whole
from rerun.chunk import RrdReader
from view_data import TASK, filmed, refreshed

from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.view import run_recorder
from ibe_rl.view.recording_file import earlier, set_back
from ibe_rl.view.run_recorder import RunRecorder
from ibe_rl.vocabulary.listener import Refreshed

ROW = {"train/return_mean": 1.0, "train/success_rate": 0.5}
RARE = ROW | {"ibe/came_true": 0.5}


def event(frames: int) -> Refreshed:
    """A refresh with the episode explained after it."""
    watched, said, real = filmed()
    refresh = replace(refreshed(), frame=frames)
    explainer = ExplainerState(refresh.mapping, 20, TASK.phrases)
    return Refreshed(frames, 1, refresh, watched, said, real, explainer, came_true=1.0)


def columns(path: Path, entity: str, name: str = "frames") -> list[Any]:
    chunks = [
        chunk.to_record_batch().to_pydict()
        for chunk in RrdReader(str(path)).stream()
        if str(chunk.entity_path) == entity
    ]
    return [value for chunk in chunks for value in chunk.get(name, [])]


def train(recorder: RunRecorder, refreshes: int, rows: int = 10, every: int = 10_000) -> list[str]:
    """Add that many refreshes with an episode and rows each; returns what was said."""
    said: list[str] = []
    for number in range(refreshes):
        for row in range(rows):
            recorder.batch(number * every + row, ROW)
        frame = (number + 1) * every
        recorder.refreshed(event(frame))
        recorder.batch(frame, RARE)
        said += recorder.news()
    recorder.close()
    return said + recorder.news()


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    path = tmp_path_factory.mktemp("long") / "recording.rrd"
    return path, train(RunRecorder(path, TASK, "run", max_mb=4), refreshes=400)


def test_a_long_run_stays_below_its_limit_and_is_whole(long: tuple[Path, list[str]]) -> None:
    path, _ = long
    assert 2_000_000 < path.stat().st_size <= 4_000_000
    assert_whole(path)


def test_the_newest_is_in_it_and_the_beginning_is_dense(long: tuple[Path, list[str]]) -> None:
    path, _ = long
    centres, shown = (sorted(set(columns(path, name))) for name in ("/vocabulary/centres", "/scene/background"))
    assert centres[-1] == shown[-1] == 4_000_000
    assert shown[:3] == [10_000, 20_000, 30_000]
    assert set(shown) <= set(centres)  # none without its own vocabulary
    assert len(shown) < len(centres) < 200
    assert max(columns(path, "/curves/ibe/came_true")) == 4_000_000
    rows = columns(path, "/curves/train/return_mean")
    assert len(rows) < 0.6 * 400 * 11


def test_thinning_is_said_in_the_terminal_and_in_the_log(long: tuple[Path, list[str]]) -> None:
    path, said = long
    assert "from now on it holds every 4th watched episode and row of curves; metrics.csv has every row" in said[0]
    assert "viewer.max_recording_mb=4" in said[0]
    assert "all but full" in said[-1] or "holds every 16384th" in said[-1]  # the sizes of the last chunks decide
    assert len(said) == len(set(said)) < 8
    logged = [text for [text] in columns(path, "/log", "TextLog:text")]
    assert [line for line in logged if "metrics.csv" in line] == said


def test_rows_alone_stay_below_the_limit_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ibe_rl.view.recorder.HOLD_S", -1.0)  # every row is sent alone
    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=1)
    for frame in range(5000):
        recorder.batch(frame, ROW)
    recorder.close()
    assert 400_000 < (tmp_path / "a").stat().st_size <= 1_000_000
    frames = columns(tmp_path / "a", "/curves/train/return_mean")
    assert frames[:40] == list(range(40))
    assert max(frames) == 4999
    assert len(frames) < 1000
    assert_whole(tmp_path / "a")


def test_an_episode_larger_than_the_limit_is_left_out(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=1)
    watched, said, real = filmed()
    long = replace(watched, moments=[*watched.moments] * 10)
    recorder.refreshed(replace(event(60_000), rollout=long, said=said * 10, real=real * 10))
    assert "what does not fit is left out" in recorder.news()[0]
    recorder.close()
    assert_whole(tmp_path / "a")
    assert not columns(tmp_path / "a", "/scene/background")
    assert columns(tmp_path / "a", "/vocabulary/centres")


def test_a_limit_reached_against_all_estimates_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_recorder.Thinning, "fits", lambda *_: True)
    monkeypatch.setattr(run_recorder.Thinning, "every", lambda *_, **__: 1)
    said = train(RunRecorder(tmp_path / "a", TASK, "run", max_mb=1), refreshes=12)
    assert [line for line in said if "1,000,000 bytes are reached" in line] == said
    assert (tmp_path / "a").stat().st_size <= 1_000_000
    assert columns(tmp_path / "a", "/vocabulary/centres")


def test_skipped_refreshes_are_shown_thinned_and_counted(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=1)
    for number in range(3000):
        recorder.skipped(number, "no episode has ended yet")
    recorder.close()
    logged = columns(tmp_path / "a", "/log")
    assert 100 < len(logged) < 1000
    assert (tmp_path / "a").stat().st_size <= 1_000_000


def test_nothing_piles_up_in_memory(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=1)
    for number in range(30):
        recorder.batch(number, ROW)
        recorder.refreshed(event(number))
        assert len(recorder._newest) <= 2
        assert len(recorder._newest_row) <= 1
    recorder.close()
    assert recorder._newest == recorder._newest_row == []


def test_a_disk_full_from_the_start_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("/dev/full")
    said = train(RunRecorder(tmp_path / "a", TASK, "run", max_mb=50), refreshes=2)
    assert len(said) == 1
    assert "cannot be written any more (No space left on device)" in said[0]
    assert "until frame" not in said[0]


def test_a_folder_that_is_gone_is_said_once(tmp_path: Path) -> None:
    said = train(RunRecorder(tmp_path / "gone" / "a", TASK, "run", max_mb=50), refreshes=2)
    assert len(said) == 1
    assert "(No such file or directory)" in said[0]


FAILING: dict[str, Callable[[RunRecorder], None]] = {
    "batch": lambda recorder: recorder.batch(0, ROW),
    "refresh": lambda recorder: recorder.refreshed(event(0)),
    "skipped": lambda recorder: recorder.skipped(0, "why"),
    "watched": lambda recorder: recorder.refreshed(event(0)),
    "close": lambda recorder: recorder.close(),
}


@pytest.mark.parametrize("name", FAILING)
def test_errors_are_named_once_and_raised_where_rerun_is_strict(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ValueError("a bug")

    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=50)
    with monkeypatch.context() as patch:
        patch.setattr(run_recorder.Recorder, name, broken)
        with pytest.raises(ValueError, match="a bug"):
            FAILING[name](recorder)
        patch.setattr(run_recorder, "strict", lambda: False)
        FAILING[name](recorder)
        FAILING[name](recorder)
    [line] = recorder.news()
    assert "something could not be recorded (ValueError: a bug)" in line
    recorder.close()
    recorder.close()


def test_a_broken_end_after_a_full_disk_is_a_bug_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> None:
        raise ValueError("a bug")

    (tmp_path / "a").symlink_to("/dev/full")
    monkeypatch.setattr(run_recorder.Thinning, "took", lambda *_: None)
    monkeypatch.setattr(run_recorder.Recorder, "size", lambda _: 0)
    recorder = RunRecorder(tmp_path / "a", TASK, "run", max_mb=50)
    monkeypatch.undo()
    monkeypatch.setattr(run_recorder.Recorder, "close", broken)
    with pytest.raises(ValueError, match="a bug"):
        recorder.skipped(0, "why")


def go_on(path: Path, refreshes: int, state: dict[str, Any] | None = None) -> tuple[RunRecorder, dict[str, Any]]:
    """Record some more and what follows the state that is returned, as if the process then were killed."""
    recorder = RunRecorder(path, TASK, "run", max_mb=4, state=state)
    first = state["refreshes"] if state else 0
    for number in range(first, first + refreshes):
        recorder.batch(number * 1_000 + 500, ROW)
        recorder.refreshed(event((number + 1) * 1_000))
        recorder.batch((number + 1) * 1_000, RARE)
    return recorder, recorder.state_dict()


def test_a_recording_goes_on_where_its_state_was_taken(tmp_path: Path) -> None:
    whole, path = tmp_path / "whole.rrd", tmp_path / "recording.rrd"
    go_on(whole, refreshes=6)[0].close()
    state: dict[str, Any] | None = None
    for _ in range(3):
        if state:
            set_back(path, state["recorder"]["bytes"])
        recorder, state = go_on(path, 2, state)
        recorder.refreshed(event(50_000))  # is cut off, or else of no importance
    recorder, _ = go_on(set_back_again(path, state), 0, state)
    recorder.close()
    assert_whole(path)
    for entity in ("/vocabulary/centres", "/scene/background", "/scene/says"):
        assert sorted(columns(path, entity)) == sorted(columns(whole, entity))
        assert sorted(columns(path, entity, "film")) == sorted(columns(whole, entity, "film"))
    assert not earlier(path).exists()


def set_back_again(path: Path, state: dict[str, Any] | None) -> Path:
    """As one does who was killed before all had been written once more: what is there by then does not count."""
    assert state is not None
    set_back(path, state["recorder"]["bytes"])
    path.write_bytes(earlier(path).read_bytes()[:1_000])
    set_back(path, 500)
    return path


def test_a_recording_that_takes_nothing_has_no_state(tmp_path: Path) -> None:
    recorder = RunRecorder(Path("/dev/full"), TASK, "run", max_mb=4)
    assert recorder.state_dict() == {}
    recorder.close()
    recorder = RunRecorder(tmp_path / "recording.rrd", TASK, "run", max_mb=4)
    recorder.close()
    assert recorder.state_dict() == {}
