"""Episodes are cut before what people are asked about, chosen in balance, and written with all that the page needs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lifts import DRAWN, HORIZON, LIFT, ride, speaker

from ibe_rl.apps.study.arms import SpokenFrames
from ibe_rl.apps.study.episode_file import read_episode
from ibe_rl.apps.study.scenes import scene_of
from ibe_rl.apps.study.stimuli import (
    MOST_PHRASES,
    CutEpisode,
    balanced_episodes,
    check_until,
    cut_episode,
    options_of,
    stimuli_of,
)
from ibe_rl.metrics.observer import Observer
from ibe_rl.task import Task
from ibe_rl.types import ConfigError

FRAMES = 20
TOUCHING: Task = replace(LIFT, first_contact=lambda states: int(np.argmin(states[:, 0])))
LANDED = ride([*range(40, 9, -1), *range(11, 21)])
"""It touches the ground after 30 steps and has 40."""


def test_the_frames_end_a_horizon_before_the_contact_or_the_end() -> None:
    at_contact, at_end = (cut_episode(1, LANDED, TOUCHING, HORIZON, until, FRAMES) for until in ("contact", "end"))
    assert at_contact is not None
    assert at_end is not None
    assert (at_contact.first, at_contact.last, at_contact.end) == (26 - FRAMES + 1, 26, 30)
    assert (at_end.last, at_end.end) == (36, 40)


def test_a_moment_by_lot_is_the_same_for_a_seed_and_leaves_room_for_frames_and_horizon() -> None:
    found = [cut_episode(seed, LANDED, TOUCHING, HORIZON, "lot", FRAMES) for seed in range(60)]
    lasts = {one.last for one in found if one is not None}
    assert lasts == {20, 21, 22, 23, 24, 25, 26}
    assert cut_episode(5, LANDED, TOUCHING, HORIZON, "lot", FRAMES) == found[5]


@pytest.mark.parametrize(
    ("watched", "until"),
    [(ride(range(40, 17, -1)), "contact"), (ride(range(40, 0, -1), terminated=False), "contact")],
)
def test_episodes_that_are_too_short_or_never_come_down_do_not_suit(watched: Any, until: str) -> None:
    assert cut_episode(1, watched, TOUCHING, HORIZON, until, FRAMES) is None


def test_where_nothing_touches_the_moment_is_drawn_by_lot() -> None:
    assert check_until(None, LIFT) == "lot"
    assert check_until(None, TOUCHING) == "contact"
    assert check_until("end", LIFT) == "end"
    with pytest.raises(ConfigError, match="until=contact: lift does not declare first_contact; allowed are end, lot"):
        check_until("contact", LIFT)
    with pytest.raises(ConfigError, match="until=contacts: allowed is one of contact, end, lot; did you mean contact"):
        check_until("contacts", LIFT)


def test_two_drawn_moments_of_three_are_before_a_movement() -> None:
    """It stays for 100 steps, moves for 10, and stays again."""
    still = ride([0.0] * 100 + [float(step) for step in range(11)] + [10.0] * 90)
    found = [cut_episode(seed, still, LIFT, HORIZON, "lot", FRAMES) for seed in range(300)]
    moving = [one for one in found if one is not None and abs(one.states[one.end] - one.states[one.last]) > 0.5]
    assert 0.6 < len(moving) / 300 < 0.74
    assert cut_episode(1, ride([0.0] * 60), LIFT, HORIZON, "lot", FRAMES) is not None


def test_options_are_what_is_said_and_what_came_true_and_some_more() -> None:
    order = [f"word {number}" for number in range(20)]
    said = {
        arm: SpokenFrames((0.0, 0.0), ("word 9", phrase), (True, known))
        for arm, phrase, known in (
            ("ibe", "word 17", True),
            ("paper", "I do not know", False),
            ("true", "word 3", True),
        )
    }
    options = options_of(order, said, np.random.default_rng(0))
    assert len(options) == MOST_PHRASES
    assert {"word 3", "word 17"} < {*options}
    assert options == sorted(options, key=order.index)
    assert options_of(order[:5], {"true": said["true"]}, np.random.default_rng(0)) == order[:5]


def ending(places: list[float]) -> Iterator[CutEpisode]:
    for seed, place in enumerate(places):
        yield CutEpisode(seed, ride([0.0] * 23 + [place, place]), 20, 24, FRAMES)


SCENE = scene_of(DRAWN, [], 24)


def test_left_middle_and_right_come_equally_often_and_in_any_order() -> None:
    places = [1.0] * 20 + [10.0] * 20 + [19.0] * 20
    counted: list[int] = []
    chosen = balanced_episodes(ending(places), SCENE, 9, np.random.default_rng(0), lambda: counted.append(1))
    ends = [float(one.states[-1, 0]) for one in chosen]
    assert Counter(ends) == {1.0: 3, 10.0: 3, 19.0: 3}
    assert ends != sorted(ends)
    assert len(counted) == 9


def test_what_is_never_reached_is_filled_up_and_too_few_are_refused() -> None:
    chosen = balanced_episodes(ending([1.0] * 9 + [19.0]), SCENE, 6, np.random.default_rng(0), lambda: None)
    assert Counter(float(one.states[-1, 0]) for one in chosen) == {1.0: 5, 19.0: 1}
    with pytest.raises(ConfigError, match="6 episodes are needed, 3 are long enough for the frames"):
        balanced_episodes(ending([1.0] * 3), SCENE, 6, np.random.default_rng(0), lambda: None)


def test_a_stimulus_has_what_is_seen_what_is_said_and_what_came() -> None:
    up = [CutEpisode(seed, ride(np.arange(start, start + 31) / 4), 20, 24, FRAMES) for seed, start in ((3, 0), (4, 8))]
    [one, other] = stimuli_of(up, speaker(task=DRAWN), Observer(4.0), SCENE, 20.0, np.random.default_rng(0))
    assert (one["seed"], one["context"], one["success"], one["frame_ms"]) == (3, "lower", True, 20.0)
    assert (len(one["frames"]), len(one["later"])) == (FRAMES, 4)
    assert one["frames"][0][0]["points"] == [[0.25, 0.25]]
    assert one["later"][-1][0]["points"][-1] == [6.0, 6.0]
    assert one["phrases"] == ["going down", "going a little down", "staying", "going up"]
    assert one["truth"] == {"at": 0.3, "choice": 2}
    assert one["explanations"]["true_future"]["phrases"] == ["staying"] * FRAMES
    assert one["explanations"]["placebic"] == other["explanations"]["ibe"]
    assert {*one["observers"]} == {"none", "ibe", "paper", "placebic", "true_future"}
    assert one["observers"]["true_future"] == {"at": 0.25, "choice": 2}


# the study of the demo's agent


def stimuli(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(path.read_text()) for path in sorted((folder / "stimuli").glob("*.json"))]


def test_what_is_made_can_be_shown(made: Path) -> None:
    paths = sorted((made / "stimuli").glob("*.json"))
    assert [path.name for path in paths] == [f"{number:03d}.json" for number in range(6)]
    for path in paths:
        for task in ("landing", "next_words"):
            assert len(read_episode(path.read_text(), task, str(path))["frames"]) == FRAMES


def test_the_ends_are_balanced_and_the_ground_tells_nothing(made: Path) -> None:
    shown = stimuli(made)
    assert Counter(min(int(3 * one["truth"]["at"]), 2) for one in shown) == {0: 2, 1: 2, 2: 2}
    assert len({one["seed"] for one in shown}) == 6
    for one in shown:  # no flags, and flat
        [ground] = one["background"]
        assert len({height for _, height in ground["points"]}) == 1


def test_observers_err_least_with_what_came_true(made: Path) -> None:
    shown = stimuli(made)
    error = {
        arm: np.mean([abs(one["observers"][arm]["at"] - one["truth"]["at"]) for one in shown])
        for arm in ("none", "ibe", "true_future")
    }
    assert error["true_future"] <= error["ibe"] + 0.02
    assert error["ibe"] < error["none"]
