"""The watched episode in the recording, read back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from view_data import (
    HORIZON_STEPS,
    TASK,
    WATCHED,
    Rows,
    column,
    developed,
    explain,
    flights,
    frames,
    read,
    real,
    refreshed,
)

from ibe_rl.ibe import phrase
from ibe_rl.task import Phrases, Task
from ibe_rl.types import CANNOT_TELL, DOES_NOT_KNOW, Explanation
from ibe_rl.view import lanes, picture, sentences, wording
from ibe_rl.view import palette as colours
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.wording import SILENCE


def test_the_predicted_path_is_the_explanations_path_in_the_scene(rows: Rows) -> None:
    said = explain(flights()[WATCHED[0]], developed()[0], 0)
    drawn = np.array(column(rows["/scene/predicted"], "Points2D:positions")[: len(said)])
    expected = TASK.scene_path(np.stack([one.path for one in said]))[:, ::2]
    assert np.allclose(drawn[..., 0], expected[..., 0], atol=1e-4)
    assert np.allclose(drawn[..., 1], TASK.scene_size[1] - expected[..., 1], atol=1e-4)
    ends = np.array(column(rows["/scene/says"], "Points2D:positions")[: len(said)])[:, 0]
    assert np.allclose(ends, drawn[:, -1])


def test_the_way_flown_is_the_episodes_own(rows: Rows) -> None:
    states = flights()[WATCHED[0]].episode.states
    path = TASK.scene_path(states) * (1, -1) + (0, TASK.scene_size[1])
    trails = column(rows["/scene/trail"], "LineStrips2D:strips")
    for step in (0, 7, 100, len(states) - 1):
        assert np.allclose(trails[step][0][0], path[0], atol=1e-4)
        assert np.allclose(trails[step][0][-1], path[step], atol=1e-4)


def test_at_the_end_of_each_window_it_is_judged(rows: Rows) -> None:
    watched, refresh = flights()[WATCHED[0]], developed()[0]
    said, happened = explain(watched, refresh, 0), real(watched, refresh)
    length, begun = len(said), np.arange(len(said) - HORIZON_STEPS + 1)
    assert len(begun) > 0
    verdicts = rows["/scene/verdict"]
    labels = [labels for [labels] in column(verdicts, "Points2D:labels")][: len(begun)]
    assert labels == [wording.verdict_line(HORIZON_STEPS, said[i].phrase, happened[i]) for i in begun]
    assert {label.rsplit(": ", 1)[1] == "it did" for label in labels} == {True, False}
    placed = [row["frames"] for row in verdicts if row.get("Points2D:labels") is not None]
    assert placed[: len(begun)] == (100_000 + HORIZON_STEPS + begun).tolist()
    lines = [np.array(line) for [line] in column(rows["/scene/then"], "LineStrips2D:strips")[: len(begun)]]
    assert TASK.scene_path is not None
    expected = TASK.scene_path(np.stack([said[i].path for i in begun]))[:, ::2]
    assert np.allclose(np.array(lines)[..., 0], expected[..., 0], atol=1e-4)
    assert length > HORIZON_STEPS


def test_a_held_explanation_is_judged_once(tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[1]], refreshed()
    new, happened = explain(watched, refresh), real(watched, refresh)
    said = [new[i - i % 5] for i in range(len(new))]
    recorder = Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, happened)
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    judged = [row["film"] for row in rows["/scene/verdict"] if row.get("Points2D:labels") is not None]
    assert judged == list(range(HORIZON_STEPS, len(said) + 1, 5))


def test_an_episode_shorter_than_the_horizon_is_not_judged(tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[1]], refreshed()
    said = [replace(one, horizon_steps=len(watched.moments) + 1) for one in explain(watched, refresh)]
    recorder = Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, real(watched, refresh))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert not [row for row in rows["/scene/verdict"] if row.get("Points2D:labels") is not None]
    assert not any("steps ago" in text for [text] in column(rows["/now"], "TextDocument:text"))


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
    said = explain(flights()[WATCHED[0]], developed()[0], 0)
    explanation = np.ravel(column(rows["/signal/explanation"], "Scalars:scalars")[: length + 1])
    assert np.allclose(explanation[:-1], [one.expression[0] for one in said])
    assert np.isnan(explanation[-1])


def test_now_tells_what_is_said_and_what_the_vocabulary_stands_on(rows: Rows) -> None:
    watched, refresh = flights()[WATCHED[1]], developed()[1]
    at = dict(zip(frames(rows["/now"]), column(rows["/now"], "TextDocument:text"), strict=True))
    [text] = at[refresh.frame]
    said = explain(watched, refresh, 1)[0]
    assert f"pad **{watched.episode.context}**" in text
    shown = f"(expression {said.expression[0]:+.2f}, confidence {said.confidence:.0%})"
    assert f"next {HORIZON_STEPS} steps: **{said.phrase}** {shown}" in text
    at = dict(zip(frames(rows["/words"]), column(rows["/words"], "TextDocument:text"), strict=True))
    [text] = at[refresh.frame]  # the first step of the episode comes after the refresh itself
    assert f"| → [#{said.cluster}](recording://said/{said.cluster}) |" in text
    assert f"Since 100,000 frames {'; '.join(sentences.moved(refresh))}." in text
    assert f"Best {refresh.episodes_used} of the newest {refresh.episodes_counted} episodes" in text
    assert all(f"{name}: {number:,}" in text for name, number in refresh.windows_by_instruction.items())


def test_now_says_whether_what_was_said_before_came_true(rows: Rows) -> None:
    watched, refresh = flights()[WATCHED[1]], developed()[1]
    said, happened = explain(watched, refresh, 1), real(watched, refresh)
    at = [
        (frame, text)
        for frame, [text] in zip(frames(rows["/now"]), column(rows["/now"], "TextDocument:text"), strict=True)
        if refresh.frame + HORIZON_STEPS <= frame < refresh.frame + len(said)
    ]
    assert len(at) > 3
    for frame, text in at:
        then = frame - refresh.frame - HORIZON_STEPS
        assert wording.verdict_line(HORIZON_STEPS, said[then].phrase, happened[then]) in text


def test_an_environment_without_a_scene_and_with_two_numbers_is_shown_too(tmp_path: Path) -> None:
    words = Phrases("still", "{degree}back", "{degree}forth", ((0.2, ""),))
    two = {"phrases": (words, words), "explained": (0, 3), "explained_band": (1, 1), "explained_range": ()}
    task: Task = replace(TASK, scene_path=None, mirror=None, **two)
    watched, refresh = flights()[WATCHED[1]], refreshed()
    given = watched.episode.instructions
    episode = replace(watched.episode, instructions=np.hstack([given, -given]))
    moments = [replace(m, instruction=np.hstack([m.instruction, -m.instruction])) for m in watched.moments]
    said = [replace(one, expression=np.hstack([one.expression, -one.expression])) for one in explain(watched, refresh)]
    recorder = Recorder(tmp_path / "recording.rrd", task, "run")
    recorder.watched(0, replace(watched, episode=episode, moments=moments), said, ["still"] * len(said))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert not any(frames(found) for entity, found in rows.items() if entity.startswith("/scene"))
    for number, sign in (("x", 1), ("vy", -1)):
        drawn = np.ravel(column(rows[f"/signal/{number}/explanation"], "Scalars:scalars"))[: len(said)]
        assert np.allclose(drawn, [sign * one.expression[0] for one in said])
    assert "still and still" in rows["/spoken"][0]["TextDocument:text"][0]


def test_each_cluster_is_marked_where_in_the_film_it_is_said(rows: Rows) -> None:
    said = explain(flights()[WATCHED[0]], developed()[0], 0)
    starts = picture.changes([one.cluster for one in said])
    for cluster in {said[step].cluster for step in starts}:
        at = [step for step in starts if said[step].cluster == cluster]
        assert [frame for frame in frames(rows[f"/said/{cluster}"]) if frame < 200_000] == [100_000 + i for i in at]
        [value, *_] = column(rows[f"/said/{cluster}"], "Scalars:scalars")
        assert value == pytest.approx(said[at[0]].expression)


def test_all_that_was_said_stands_in_the_table_of_the_episode(rows: Rows) -> None:
    watched, refresh = flights()[WATCHED[0]], developed()[0]
    said = explain(watched, refresh, 0)
    [text] = column(rows["/spoken"], "TextDocument:text")[0]
    told = [phrase(moment.instruction, TASK.phrases) if moment.given else SILENCE for moment in watched.moments]
    changes = picture.changes(list(zip(told, [one.phrase for one in said], strict=True)))
    assert len(text.splitlines()) == 2 + len(changes)
    assert f"| steps | instruction | next {HORIZON_STEPS} steps | expression | confidence | as predicted |" in text
    assert SILENCE in text


def spoken_in_time(tmp_path: Path) -> tuple[list[Explanation], list[str], Rows]:
    """A film of which the agent does not know the steps 10 to 29; of ten steps ahead it always says the same."""
    watched, refresh = flights()[WATCHED[1]], refreshed()
    now = explain(watched, refresh)[0]
    soon = replace(now, phrase="falling far left", horizon_steps=10)
    said = [
        replace(one, known=not 10 <= step < 30, spans=(soon,)) for step, one in enumerate(explain(watched, refresh))
    ]
    happened, recorder = real(watched, refresh), Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, happened)
    recorder.close()
    return said, happened, read(tmp_path / "recording.rrd")


def test_where_the_agent_does_not_know_its_lane_is_grey_and_nothing_is_judged(tmp_path: Path) -> None:
    said, _, rows = spoken_in_time(tmp_path)
    [bands] = [row for row in rows["/lanes/bands"] if row.get("LineStrips2D:strips") is not None]
    grey = int.from_bytes(bytes([*colours.SILENT_GREY, 255]))
    steps, span = len(said), lanes.LAST_X - lanes.FIRST_X
    drawn = [
        (
            (line[0][0] - lanes.PEN - lanes.FIRST_X) / span * steps,
            (line[1][0] + lanes.PEN - lanes.FIRST_X) / span * steps,
        )
        for line, shade in zip(bands["LineStrips2D:strips"], bands["LineStrips2D:colors"], strict=True)
        if shade == grey and line[0][1] > 2 * lanes.LANE_HEIGHT  # the lane of the longer span
    ]
    assert drawn == [pytest.approx([10, 30], abs=1e-3)]
    judged = {row["film"] for row in rows["/scene/verdict"] if row.get("Points2D:labels") is not None}
    drawn = {row["film"] for row in rows["/scene/then"] if row.get("LineStrips2D:strips") is not None}
    assert judged == drawn == {i + HORIZON_STEPS for i in range(len(said) - HORIZON_STEPS + 1) if said[i].known}
    assert len(judged) < len(said) - HORIZON_STEPS


def test_an_agent_that_never_knows_is_not_judged_at_all(tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[1]], refreshed()
    said = [replace(one, known=False) for one in explain(watched, refresh)]
    recorder = Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, real(watched, refresh))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    assert not [row for row in rows["/scene/verdict"] if row.get("Points2D:labels") is not None]
    assert not any(entity.startswith("/said/") for entity in rows)
    [words] = [row["Points2D:labels"] for row in rows["/lanes/words"]]
    assert DOES_NOT_KNOW in words


def test_the_panels_tell_what_is_said_of_all_spans_of_time(tmp_path: Path) -> None:
    said, happened, rows = spoken_in_time(tmp_path)
    shorten = wording.shortener(TASK.phrases)
    assert said[0].in_time() == f"now falling far left, later {said[0].phrase}"
    assert said[10].in_time() == f"now falling far left, later {DOES_NOT_KNOW}"
    labels = [label for [label] in column(rows["/scene/says"], "Points2D:labels")]
    assert labels == [f"says: {one.in_time(shorten)}" for one in said]
    lines = [line for [line] in column(rows["/log"], "TextLog:text")]
    starts = picture.changes([one.in_time() for one in said])
    assert lines[: len(starts)] == [f"+{i}  {said[i].in_time(shorten)}" for i in starts]
    at = dict(zip(column(rows["/now"], "film"), column(rows["/now"], "TextDocument:text"), strict=True))
    assert f"next 10 steps: **falling far left**  \nnext {HORIZON_STEPS} steps: **{DOES_NOT_KNOW}** (" in at[10][0]
    assert f"said {HORIZON_STEPS} steps ago: {DOES_NOT_KNOW}: it was {happened[10]}" in at[10 + HORIZON_STEPS][0]


def test_the_log_keeps_what_a_moment_alone_says(tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[1]], refreshed()
    said = explain(watched, refresh)
    alone = {3: "falling far left", 4: "falling far left", 8: "falling far right"}
    said = [replace(one, of_the_moment=alone.get(i)) for i, one in enumerate(said)]
    said[8] = replace(said[8], meant=False, known=False)
    recorder = Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, [one.phrase for one in said])
    recorder.close()
    rows = read(tmp_path / "recording.rrd")["/log/alone"]
    short = wording.shortener(TASK.phrases)("falling far left")
    assert column(rows, "TextLog:text") == [[f"+3  this moment alone: {short}"]]
    assert column(rows, "TextLog:level") == [["TRACE"]]


def test_words_without_a_known_meaning_are_nowhere_in_the_film(tmp_path: Path) -> None:
    watched, refresh = flights()[WATCHED[1]], refreshed()
    said = [replace(one, meant=False, known=False) for one in explain(watched, refresh)]
    recorder = Recorder(tmp_path / "recording.rrd", TASK, "run", training=False)
    recorder.watched(0, watched, said, [CANNOT_TELL] * len(said))
    recorder.close()
    rows = read(tmp_path / "recording.rrd")
    gauge = np.ravel(column(rows["/signal/explanation"], "Scalars:scalars"))
    assert np.isnan(gauge).all()
    assert {label for [label] in column(rows["/scene/says"], "Points2D:labels")} == {f"says: {CANNOT_TELL}"}
    [words] = [row["Points2D:labels"] for row in rows["/lanes/words"]]
    assert CANNOT_TELL in words
    assert not [row for row in rows["/scene/verdict"] if row.get("Points2D:labels") is not None]
    for [text] in column(rows["/now"], "TextDocument:text"):
        assert f"steps: **{CANNOT_TELL}**" in text
        assert "confidence" not in text
    spoken = [line for [line] in column(rows["/log"], "TextLog:text")]
    assert spoken[0] == f"+0  {CANNOT_TELL}"
