"""An episode in words, its film and lanes, and the parts of the page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from by_hand import TASK, on_a_line, plain

from ibe_rl.apps.summary.episode_in_words import DRAWN_EVERY_STEPS
from ibe_rl.apps.summary.films import FILM_PICTURES, film_of, spans_of
from ibe_rl.apps.summary.page import OTHER, bar, shown_phrases
from ibe_rl.apps.summary.phrase_colours import phrase_colours, told_colours
from ibe_rl.apps.summary.played import put_steps_in_words
from ibe_rl.config.settings import InstructorConfig, TrainConfig
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.explain.phrasing import ExplainerState, put_in_words
from ibe_rl.task import RecordedRollout, Shape, Task
from ibe_rl.task.words import Words
from ibe_rl.types import DOES_NOT_KNOW, Episode, Moment
from ibe_rl.view import palette
from tests.apps.summary.hand_played import played

HEIGHTS = np.array([0, 1, 2, 3, 3, 3, 3, 2, 1, 0], float)
MAPPING = replace(on_a_line([0, 0, 0], [-1, 0, 1]), space=plain(3), centres=np.eye(3)[[0, 0, 0]] * [[-2], [0], [2]])
DRAWN = replace(TASK, scene_path=lambda states: states[..., :2], scene_size=(4.0, 3.0))
BLUE, GREY, ORANGE = palette.NEGATIVE, palette.ZERO, palette.POSITIVE


def run_of(task: Task) -> TrainedRun:
    config = TrainConfig(instructor=InstructorConfig())
    return TrainedRun(Path("run"), config, task, lambda seen: seen, 9, MAPPING, 9, 2, {}, None)


def rollout(task: Task, instruction: float = 1.0) -> Any:
    """Up, level, down; it is told to go up but at the first step, and its next two steps are foreseen rightly."""
    states = np.column_stack([HEIGHTS, np.zeros((len(HEIGHTS), 2))])
    steps = len(states) - 1
    told, given = np.full((steps, 1), instruction), np.arange(steps) > 0
    episode = Episode(states, np.zeros(steps), np.zeros(steps), told, given, True, True, "lower")
    moments = [Moment(states[t], told[t], bool(given[t])) for t in range(steps)]
    square = Shape(np.array([[0, 0], [1, 0], [1, 1]], float), (1, 2, 3), closed=True)
    figures = [[square] if task.scene_path else []] * (steps + 1)
    ahead = np.minimum(np.arange(steps)[:, None] + np.arange(3), steps)
    said = put_in_words(states[ahead][:, None], ExplainerState(MAPPING, 2, task.phrases))
    return RecordedRollout(episode, moments, [square] if task.scene_path else [], figures), said


def test_an_episode_in_words_says_what_was_told_said_and_came() -> None:
    one = put_steps_in_words(run_of(TASK), 7, *rollout(TASK))
    assert (one.seed, len(one), one.contact) == (7, 9, None)
    assert one.told == ["(silent)", *["going up"] * 8]
    assert [one.said[0], one.said[3], one.said[7]] == ["going up", "staying", "going down"]
    assert list(one.said) == list(one.came)
    np.testing.assert_array_equal(one.true, np.ones(9))
    np.testing.assert_array_equal(one.against, [np.nan, 0, 0, 1, 1, 1, 1, 1, 1])
    np.testing.assert_array_equal(one.said_against[3:], np.ones(6))
    assert one.watched.moments == []
    assert one.paths.shape == (3, 3, 3)


def test_a_declared_contact_is_found() -> None:
    task = replace(TASK, first_contact=lambda states: int(np.argmax(states[:, 0] >= 3)))
    assert put_steps_in_words(run_of(task), 0, *rollout(task)).contact == 3


def test_a_film_has_a_picture_of_every_third_step_and_the_way_ahead() -> None:
    one = put_steps_in_words(run_of(DRAWN), 0, *rollout(DRAWN))
    film = film_of(one, DRAWN, phrase_colours([one], DRAWN))
    assert (film["at"], film["steps"], film["size"]) == ([0, 3, 6], 9, [4.0, 3.0])
    ahead, figure = film["pictures"][0][:-1], film["pictures"][0][-1]
    assert figure == {"points": [[0, 0], [1, 0], [1, 1]], "colour": [1, 2, 3], "closed": True}
    middles = np.array([shape["points"] for shape in ahead]).mean(axis=1)
    np.testing.assert_allclose(middles[[0, -1]], [[0, 0], [2, 0]], atol=1e-3)
    assert {tuple(shape["colour"]) for shape in ahead} == {ORANGE}
    json.dumps(film, allow_nan=False)


def test_an_environment_without_a_drawing_has_lanes_only() -> None:
    one = put_steps_in_words(run_of(TASK), 0, *rollout(TASK))
    film = film_of(one, TASK, phrase_colours([one], TASK))
    assert "pictures" not in film
    assert [lane["name"] for lane in film["lanes"]] == ["told", "says", "came"]
    assert film["lanes"][0]["spans"] == [(0, 1, "(silent)"), (1, 8, "going up")]


def test_what_is_drawn_without_a_path_is_a_film_without_the_way_ahead() -> None:
    one = put_steps_in_words(run_of(DRAWN), 0, *rollout(DRAWN))
    pictures = film_of(one, TASK, phrase_colours([one], TASK))["pictures"]
    assert [len(shapes) for shapes in pictures] == [1, 1, 1]


def test_a_long_film_leaves_pictures_out() -> None:
    long = played("u" * 1_000, "u" * 1_000, "u" * 1_000)
    at = film_of(long, TASK, {})["at"]
    assert len(at) <= FILM_PICTURES
    assert at[1] == 4 * DRAWN_EVERY_STEPS


def test_stretches_of_equal_words() -> None:
    assert spans_of(["a", "b", "b"]) == [(0, 1, "a"), (1, 2, "b")]


def test_phrases_go_from_blue_to_orange_and_what_is_unknown_is_last() -> None:
    one = played("ud-", "?us", "dus")
    colours = phrase_colours([one], TASK)
    assert colours == {
        "going down": BLUE,
        "staying": GREY,
        "going up": ORANGE,
        DOES_NOT_KNOW: palette.SILENT_GREY,
    }
    assert [*colours][-1] == DOES_NOT_KNOW
    assert told_colours([one], TASK) == {"going up": ORANGE, "going down": BLUE}


def test_words_have_a_colour_each() -> None:
    task = replace(TASK, phrases=Words(["up", "down"]))
    colours = phrase_colours([played("uu", "uu", "ud")], task)
    assert [*colours] == ["going up", "going down"]
    assert len({*colours.values()}) == 2
    assert told_colours([], task) == {}


def test_an_agent_that_never_speaks_has_one_colour() -> None:
    silent = replace(played("uu", "??", "ss"), came=[DOES_NOT_KNOW] * 2)
    assert phrase_colours([silent], TASK) == {DOES_NOT_KNOW: palette.SILENT_GREY}


def test_a_bar_joins_what_is_rare() -> None:
    shares = {str(number): (20 - number) / 210 for number in range(20)}
    colours = {name: (number, 0, 0) for number, name in enumerate(shares)}
    shown = shown_phrases({"said": shares, "came": {}}, colours)
    assert shown == [str(number) for number in range(12)]
    parts = bar(shares, shown, colours)
    assert sum(one["share"] for one in parts) == 1
    assert (parts[-1]["phrase"], parts[-1]["dark"]) == (OTHER, True)
    assert bar({"0": 1.0}, shown, colours) == [{"phrase": "0", "share": 1.0, "colour": "rgb(0 0 0)", "dark": True}]
