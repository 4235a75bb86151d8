"""The recording, read back: what was added is in it, at the right places of both timelines."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from view_data import HORIZON_STEPS, TASK, WATCHED, explain, flights, record, refreshed

from ibe_rl import picture, stream
from ibe_rl.data import Phrases, Task
from ibe_rl.film import SILENCE
from ibe_rl.ibe import ClusterMapping, phrase
from ibe_rl.refresh import Refresh
from ibe_rl.run_recorder import RunRecorder
from ibe_rl.stream import NoRecorder, Recorder

Rows = dict[str, list[dict[str, Any]]]


def read(path: Path) -> Rows:
    """All rows of each entity in the order of the frames and of logging, static ones first."""
    rows: Rows = defaultdict(list)
    for chunk in RrdReader(str(path)).stream():
        rows[str(chunk.entity_path)] += chunk.to_record_batch().to_pylist()

    def order(row: dict[str, Any]) -> tuple[int, bytes]:
        return row.get("frames", -1), row["rerun.controls.RowId"]

    return {entity: sorted(found, key=order) for entity, found in rows.items()}


def column(rows: list[dict[str, Any]], name: str) -> list[Any]:
    return [row[name] for row in rows if row.get(name) is not None and "frames" in row]


def frames(rows: list[dict[str, Any]]) -> list[int]:
    return column(rows, "frames")


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    path = tmp_path_factory.mktemp("stream") / "recording.rrd"
    record(path)
    return read(path)


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path / "recording.rrd", TASK, "run")


def hand_made() -> Refresh:
    """Three clusters side by side in x and apart in angle."""
    centres = np.zeros((3, 9))
    centres[:, 0], centres[:, 4] = (-1, 0, 1), (2, -2, 0)
    expressions = np.array([[-1.0], [0.25], [1.0]])
    weight = np.full(9, 2.0)
    sizes, purities = np.array([5, 6, 7]), np.array([0.9, 0.5, 0.8])
    mapping = ClusterMapping(np.zeros(9), weight, centres, expressions / 2, expressions, sizes, purities)
    return replace(refreshed(), mapping=mapping)


def test_the_curves_hold_every_value_at_its_frame(rows: Rows) -> None:
    success = rows["/curves/train/success_rate"]
    assert frames(success) == list(range(20_000, 300_001, 20_000))
    expected = 1 - np.exp(-np.array(frames(success)) / 200_000)
    assert np.allclose(np.ravel(column(success, "Scalars:scalars")), expected)
    assert (
        frames(rows["/curves/eval/return_mean"]) == frames(rows["/curves/ibe/came_true"]) == [100_000, 200_000, 300_000]
    )
    assert not any("watched_step" in row for row in success)


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
    monkeypatch.setattr(stream, "HOLD_S", 0.0)
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
    steps = column(rows["/scene/trail"], "watched_step")
    assert steps == list(range(sum(lengths) + len(lengths)))


def test_refreshes_lie_where_their_episodes_begin(rows: Rows) -> None:
    lengths = [len(flights()[i].moments) for i in WATCHED]
    for entity in ("/vocabulary/centres", "/expression/positive", "/change/best", "/scene/background"):
        assert frames(rows[entity]) == [100_000, 200_000, 300_000]
        assert column(rows[entity], "watched_step") == [0, lengths[0] + 1, lengths[0] + lengths[1] + 2]


def test_an_episode_longer_than_the_time_between_refreshes_pushes_the_next_back(
    recorder: Recorder, tmp_path: Path
) -> None:
    watched = flights()[WATCHED[1]]
    said = explain(watched, refreshed())
    for at in (1000, 1050):
        recorder.watched(at, watched, said)
    recorder.close()
    length = len(said)
    placed = frames(read(tmp_path / "recording.rrd")["/scene/predicted"])
    assert placed == [*range(1000, 1000 + length), *range(1001 + length, 1001 + 2 * length)]


def test_the_predicted_path_is_the_explanations_path_in_the_scene(rows: Rows) -> None:
    refresh = replace(refreshed(), frame=100_000)
    said = explain(flights()[WATCHED[0]], refresh, 0)
    drawn = np.array(column(rows["/scene/predicted"], "Points2D:positions")[: len(said)])
    expected = TASK.scene_path(np.stack([one.path for one in said]))[:, ::2]
    assert np.allclose(drawn[..., 0], expected[..., 0], atol=1e-4)
    assert np.allclose(drawn[..., 1], TASK.scene_size[1] - expected[..., 1], atol=1e-4)
    ends = np.array(column(rows["/scene/says"], "Points2D:positions")[: len(said)])[:, 0]
    assert np.allclose(ends, drawn[:, -1])


def test_the_way_flown_and_the_way_that_followed_are_the_episodes_own(rows: Rows) -> None:
    states = flights()[WATCHED[0]].episode.states
    path = TASK.scene_path(states) * (1, -1) + (0, TASK.scene_size[1])
    trails = column(rows["/scene/trail"], "LineStrips2D:strips")
    for step in (0, 7, 100, len(states) - 1):
        assert np.allclose(trails[step][0][0], path[0], atol=1e-4)
        assert np.allclose(trails[step][0][-1], path[step], atol=1e-4)
    really = column(rows["/scene/really"], "LineStrips2D:strips")
    assert np.allclose(really[50][0], path[50 : 50 + HORIZON_STEPS + 1 : 2], atol=1e-4)


def test_predictions_stay_once_in_each_horizon(rows: Rows) -> None:
    length = len(flights()[WATCHED[0]].moments)
    kept = [len(lines) for lines in column(rows["/scene/said"], "LineStrips2D:strips")]
    count = -(-length // HORIZON_STEPS)
    assert kept[:count] == list(range(1, count + 1))
    assert frames(rows["/scene/said"])[:count] == [100_000 + HORIZON_STEPS * i for i in range(count)]


def test_the_moving_figures_are_closed_outlines_with_y_down(rows: Rows) -> None:
    figures = flights()[WATCHED[0]].figures
    drawn = column(rows["/scene/figures"], "LineStrips2D:strips")[20]
    assert len(drawn) == len(figures[20])
    for line, shape in zip(drawn, figures[20], strict=True):
        corners = shape.points * (1, -1) + (0, TASK.scene_size[1])
        assert np.allclose(line[: len(corners)], corners, atol=1e-4)
        assert np.allclose(line[len(corners) :], corners[0], atol=1e-4)


def test_signals_break_in_silence_and_at_the_end(rows: Rows) -> None:
    episode = flights()[WATCHED[0]].episode
    length = len(episode)
    instruction = np.ravel(column(rows["/signal/instruction"], "Scalars:scalars")[: length + 1])
    assert np.array_equal(np.isnan(instruction), np.append(~episode.given, True))
    assert np.array_equal(instruction[:-1][episode.given], episode.instructions[episode.given, 0])
    said = explain(flights()[WATCHED[0]], replace(refreshed(), frame=100_000), 0)
    explanation = np.ravel(column(rows["/signal/explanation"], "Scalars:scalars")[: length + 1])
    assert np.allclose(explanation[:-1], [one.expression[0] for one in said])
    assert np.isnan(explanation[-1])


def test_both_lanes_say_the_phrases_and_silence_is_a_state(rows: Rows) -> None:
    watched = flights()[WATCHED[0]]
    told = [phrase(moment.instruction, TASK.phrases) if moment.given else SILENCE for moment in watched.moments]
    said = [one.phrase for one in explain(watched, replace(refreshed(), frame=100_000), 0)]
    for lane, words in (("instructor", told), ("agent", said)):
        starts = picture.changes(words)
        states = [state for [state] in column(rows[f"/says/{lane}"], "StateChange:state")]
        assert states[: len(starts) + 1] == [*(words[i] for i in starts), ""]
        assert frames(rows[f"/says/{lane}"])[: len(starts)] == [100_000 + i for i in starts]
    assert SILENCE in told


def test_the_expressions_are_bars_below_and_above_zero(rows: Rows) -> None:
    expressions = refreshed().mapping.expressions[:, 0]
    for name, expected in (("negative", np.minimum(expressions, 0)), ("positive", np.maximum(expressions, 0))):
        [tensor] = rows[f"/expression/{name}"][0]["BarChart:values"]
        assert np.allclose(tensor["buffer"], expected)


def test_the_densities_are_those_of_the_explained_dimension(rows: Rows) -> None:
    refresh = refreshed()
    middles, width, best, others = picture.histogram(refresh.top.delta[:, 0], refresh.others.delta[:, 0])
    for name, density, drawn in zip(("best", "others"), (best, others), picture.cut([best, others]), strict=True):
        [tensor] = rows[f"/change/{name}"][0]["BarChart:values"]
        assert np.allclose(tensor["buffer"], drawn)
        assert 0.95 < density.sum() * width <= 1
    assert len(middles) == len(best)


def test_clusters_are_drawn_in_the_two_dimensions_that_tell_them_apart(recorder: Recorder, tmp_path: Path) -> None:
    recorder.refresh(hand_made())
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    [names] = rows["/vocabulary/names"]
    [marks] = rows["/vocabulary/marks"]
    assert names["Points2D:labels"] == ["-1.00", "+0.25", "+1.00"]
    assert [label for label in marks["Points2D:labels"] if "Δ" in label] == ["→ Δx (half widths)", "↑ Δangle (rad)"]
    points = np.array(rows["/vocabulary/centres"][0]["Points2D:positions"])
    assert np.all(np.diff(points[:, 0]) > 0)
    assert points[0, 1] < points[2, 1] < points[1, 1]  # y down: the largest angle is on top
    assert len(rows["/vocabulary/windows"][0]["Points2D:positions"][0:]) <= picture.SCATTER_POINTS


def test_the_log_says_changes_only_and_why_a_refresh_was_skipped(recorder: Recorder, tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[0]], replace(refreshed(), frame=5000)
    said = explain(watched, refresh)
    recorder.skipped(1000, "no episode has ended yet")
    recorder.refresh(refresh)
    recorder.watched(5000, watched, said)
    recorder.close()
    lines = [line for [line] in column(read(tmp_path / "recording.rrd")["/log"], "TextLog:text")]
    spoken = [f"+{i}  {said[i].phrase}" for i in picture.changes([one.phrase for one in said])]
    assert lines[0] == "1,000 frames: no new vocabulary, no episode has ended yet"
    assert lines[1].startswith("5,000 frames: vocabulary learnt anew from")
    assert lines[2:-1] == spoken
    assert lines[-1].endswith("success")


def test_now_tells_what_is_said_and_what_the_vocabulary_stands_on(rows: Rows) -> None:
    [text] = column(rows["/now"], "TextDocument:text")[1]  # the refresh itself comes first
    watched, refresh = flights()[WATCHED[0]], refreshed()
    said = explain(watched, replace(refresh, frame=100_000), 0)[0]
    assert f"pad **{watched.episode.context}**" in text
    assert f"Agent: **{said.phrase}** ({said.expression[0]:+.2f}), confidence {said.confidence:.0%}" in text
    assert f"**→ {said.cluster}**" in text
    assert f"Best {refresh.episodes_used} of {refresh.episodes_logged} episodes" in text
    assert all(f"{name}: {number:,}" in text for name, number in refresh.windows_by_instruction.items())


def test_an_environment_without_a_scene_and_with_two_numbers_is_shown_too(tmp_path: Path) -> None:
    words = Phrases("still", "{degree}back", "{degree}forth", ((0.2, ""),))
    task: Task = replace(TASK, scene_path=None, phrases=(words, words))
    watched, refresh = flights()[WATCHED[1]], refreshed()
    given = watched.episode.instructions
    episode = replace(watched.episode, instructions=np.hstack([given, -given]))
    moments = [replace(m, instruction=np.hstack([m.instruction, -m.instruction])) for m in watched.moments]
    said = [replace(one, expression=np.hstack([one.expression, -one.expression])) for one in explain(watched, refresh)]
    recorder = Recorder(tmp_path / "recording.rrd", task, "run")
    recorder.watched(0, replace(watched, episode=episode, moments=moments), said)
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert not any(frames(found) for entity, found in rows.items() if entity.startswith("/scene"))
    assert {len(values) for values in column(rows["/signal/explanation"], "Scalars:scalars")} == {2}
    assert "still and still" in [state for [state] in column(rows["/says/instructor"], "StateChange:state")]


def test_without_other_episodes_and_spread_the_vocabulary_is_drawn_all_the_same(
    recorder: Recorder, tmp_path: Path
) -> None:
    refresh = refreshed()
    still = replace(refresh.top, delta=np.zeros_like(refresh.top.delta))
    recorder.refresh(replace(refresh, top=still, others=refresh.top[:0]))
    recorder.close()
    [others] = read(tmp_path / "recording.rrd")["/change/others"][0]["BarChart:values"]
    assert not np.any(others["buffer"])


@pytest.mark.parametrize("count", [0, 3])
def test_every_step_needs_its_explanation(recorder: Recorder, count: int) -> None:
    watched = flights()[WATCHED[1]]
    with pytest.raises(ValueError, match=f"{count} explanations for an episode of {len(watched.moments)} steps"):
        recorder.watched(0, watched, explain(watched, refreshed())[:count])


def test_closing_twice_is_closing_once(recorder: Recorder) -> None:
    recorder.close()
    recorder.close()


def test_two_runs_are_two_recordings(tmp_path: Path) -> None:
    ids = set()
    for name in ("a", "b"):
        Recorder(tmp_path / name, TASK, "the same name").close()
        ids |= {store.recording_id for store in RrdReader(str(tmp_path / name)).recordings()}
    assert len(ids) == 2


def test_no_recorder_takes_the_same_and_writes_nothing(tmp_path: Path) -> None:
    nothing, watched = NoRecorder(), flights()[WATCHED[1]]
    nothing.batch(0, {"train/return_mean": 1.0})
    nothing.refresh(refreshed())
    nothing.skipped(0, "reason")
    nothing.watched(0, watched, [])
    nothing.flush()
    assert nothing.news() == []
    nothing.close()
    assert not list(tmp_path.iterdir())
    public = {name for name in vars(RunRecorder) if not name.startswith("_")}
    assert public == {name for name in vars(NoRecorder) if not name.startswith("_")}


def test_words_that_all_phrases_begin_with_are_left_out() -> None:
    words = TASK.phrases
    assert picture.short(["falling straight down", "falling far left"], words) == ["straight down", "far left"]
    [falling] = words
    other = replace(falling, zero="standing still")
    assert picture.short(["standing still"], [other]) == ["standing still"]


def test_thinned_paths_keep_their_ends() -> None:
    for points in (60, 61):
        path = np.arange(2.0 * points).reshape(1, points, 2)
        thin = picture.thinned(path)
        assert thin.shape[1] == 31
        assert np.array_equal(thin[:, [0, -1]], path[:, [0, -1]])


def test_a_peak_that_hides_the_rest_is_cut() -> None:
    best, others = picture.cut([np.array([1.0, 30.0, 2.0]), np.array([3.0, 0.0, 0.0])])
    assert best.tolist() == [1.0, 6.0, 2.0]
    assert others.tolist() == [3.0, 0.0, 0.0]
    assert not np.any(picture.cut([np.zeros(3), np.zeros(3)]))
