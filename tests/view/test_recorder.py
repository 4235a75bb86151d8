"""The recording, read back: what was added is in it, at the right places of both timelines."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader
from view_data import TASK, WATCHED, Rows, column, developed, explain, flights, frames, read, real, refreshed

from ibe_rl.view import picture, sentences, wording
from ibe_rl.view import recorder as module
from ibe_rl.view.recorder import INTRO_STEPS, Recorder


def test_the_curves_hold_every_value_at_its_frame(rows: Rows) -> None:
    success = rows["/curves/train/success_rate"]
    assert frames(success) == list(range(20_000, 300_001, 20_000))
    expected = 1 - np.exp(-np.array(frames(success)) / 200_000)
    assert np.allclose(np.ravel(column(success, "Scalars:scalars")), expected)
    assert (
        frames(rows["/curves/eval/return_mean"]) == frames(rows["/curves/ibe/came_true"]) == [100_000, 200_000, 300_000]
    )


def test_in_the_film_curves_grow_by_what_is_trained_from_one_episode_to_the_next(rows: Rows) -> None:
    lengths = [len(flights()[i].moments) + 1 for i in WATCHED]
    steps = np.array(column(rows["/curves/train/success_rate"], "film")).reshape(3, 5)
    begins = np.cumsum([INTRO_STEPS, *lengths])
    assert steps[:, -1].tolist() == begins[:3].tolist()
    assert np.all(np.diff(steps.ravel()) > 0)
    assert column(rows["/curves/eval/return_mean"], "film")[-1] == begins[3]


def test_before_the_first_refresh_the_panels_say_so(rows: Rows) -> None:
    assert column(rows["/words"], "TextDocument:text")[0] == [module.NO_VOCABULARY]
    assert column(rows["/now"], "TextDocument:text")[0] == [module.GREETING]
    assert frames(rows["/now"])[0] == 0


def test_curves_leave_out_what_is_missing_or_not_finite(recorder: Recorder, tmp_path: Path) -> None:
    recorder.batch(10, {"frames": 10, "train/return_mean": float("nan"), "train/success_rate": 0.5})
    recorder.batch(20, {"frames": 20, "train/return_mean": -3.0})
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert frames(rows["/curves/train/return_mean"]) == [20]
    assert frames(rows["/curves/train/success_rate"]) == [10]
    assert "/curves/frames" not in rows


def test_curves_wait_for_the_next_episode_but_not_for_ever(
    recorder: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder.batch(10, {"train/return_mean": 1.0})
    recorder.size()
    assert not frames(read(tmp_path / "recording.rrd")["/curves/train/return_mean"])
    monkeypatch.setattr(module, "HOLD_S", 0.0)
    recorder.batch(20, {"train/return_mean": 2.0})
    recorder.size()
    assert frames(read(tmp_path / "recording.rrd")["/curves/train/return_mean"]) == [10, 20]


def test_flush_writes_all_so_far(recorder: Recorder, tmp_path: Path) -> None:
    recorder.batch(10, {"train/return_mean": 1.0})
    recorder.flush()
    assert frames(read(tmp_path / "recording.rrd")["/curves/train/return_mean"]) == [10]
    recorder.close()


def test_watched_episodes_lie_behind_their_frame_and_one_after_the_other(rows: Rows) -> None:
    lengths = [len(flights()[i].moments) for i in WATCHED]
    predicted = rows["/scene/predicted"]
    expected = [100_000 * (i + 1) + j for i, length in enumerate(lengths) for j in range(length)]
    assert frames(predicted) == expected
    steps = column(rows["/scene/trail"], "film")
    assert steps == list(range(INTRO_STEPS, INTRO_STEPS + sum(lengths) + len(lengths)))


def test_refreshes_lie_where_their_episodes_begin(rows: Rows) -> None:
    lengths = [len(flights()[i].moments) for i in WATCHED]
    for entity in ("/vocabulary/centres", "/change/best", "/scene/background"):
        assert frames(rows[entity]) == [100_000, 200_000, 300_000]
        steps = np.array(column(rows[entity], "film")) - INTRO_STEPS
        assert steps.tolist() == [0, lengths[0] + 1, lengths[0] + lengths[1] + 2]


def test_an_episode_longer_than_the_time_between_refreshes_pushes_the_next_back(
    recorder: Recorder, tmp_path: Path
) -> None:
    watched = flights()[WATCHED[1]]
    said = explain(watched, refreshed())
    for at in (1000, 1050):
        recorder.watched(at, watched, said, real(watched, refreshed()))
    recorder.close()
    length = len(said)
    placed = frames(read(tmp_path / "recording.rrd")["/scene/predicted"])
    assert placed == [*range(1000, 1000 + length), *range(1001 + length, 1001 + 2 * length)]


def test_the_log_says_changes_only_and_why_a_refresh_was_skipped(recorder: Recorder, tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[0]], replace(refreshed(), frame=5000)
    said = explain(watched, refresh)
    recorder.skipped(1000, "no episode has ended yet")
    recorder.refresh(refresh)
    recorder.watched(5000, watched, said, real(watched, refresh))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    lines = [line for [line] in column(rows["/log"], "TextLog:text")]
    assert ["1,000 frames: no new vocabulary, no episode has ended yet"] in column(rows["/now"], "TextDocument:text")
    short = wording.short([one.phrase for one in said], TASK.phrases)
    spoken = [f"+{i}  {short[i]}" for i in picture.changes(short)]
    assert lines[0] == "1,000 frames: no new vocabulary, no episode has ended yet"
    assert lines[1] == "5,000 frames: vocabulary learnt anew"
    assert lines[2:-1] == spoken
    assert lines[-1].endswith("success")


def test_the_log_says_what_became_of_each_cluster(rows: Rows) -> None:
    for refresh in developed()[1:]:
        at = [
            line
            for [line], frame in zip(column(rows["/log"], "TextLog:text"), frames(rows["/log"]), strict=True)
            if frame == refresh.frame
        ]
        expected = [*sentences.moved(refresh), *sentences.transitions(refresh, TASK.phrases)]
        assert len(expected) >= 5
        assert at[: 1 + len(expected)] == [f"{refresh.frame:,} frames: vocabulary learnt anew", *expected]


def test_a_vocabulary_that_is_kept_stays_in_the_picture(recorder: Recorder, tmp_path: Path) -> None:
    first, second = developed()[:2]
    recorder.refresh(first)
    recorder.refresh(replace(second, taken=False))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert frames(rows["/vocabulary/centres"]) == [first.frame]
    lines = [line for [line] in column(rows["/log"], "TextLog:text")]
    assert lines[1:3] == ["200,000 frames: vocabulary kept", "it acts otherwise in 25% of the probed states"]
    assert lines[3].endswith(", so they stay")
    assert len(lines) == 4
    [words] = column(rows["/words"], "TextDocument:text")[-1]
    assert all(f"| [#{name}](" in words for name in first.mapping.ids)


@pytest.mark.parametrize("count", [0, 3])
def test_every_step_needs_its_explanation(recorder: Recorder, count: int) -> None:
    watched = flights()[WATCHED[1]]
    said, happened = explain(watched, refreshed()), real(watched, refreshed())
    steps = len(watched.moments)
    with pytest.raises(ValueError, match=f"{count} explanations and {steps} phrases for an episode of {steps} steps"):
        recorder.watched(0, watched, said[:count], happened)
    with pytest.raises(ValueError, match=f"{steps} explanations and {count} phrases"):
        recorder.watched(0, watched, said, happened[:count])


def test_closing_twice_is_closing_once(recorder: Recorder) -> None:
    recorder.close()
    recorder.close()


def test_two_runs_are_two_recordings(tmp_path: Path) -> None:
    ids = set()
    for name in ("a", "b"):
        Recorder(tmp_path / name, TASK, "the same name").close()
        ids |= {store.recording_id for store in RrdReader(str(tmp_path / name)).recordings()}
    assert len(ids) == 2
