"""What each arm says, and what simulated observers then expect, worked out by hand on a lift."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from lifts import DRAWN, HORIZON, LIFT, ride, speaker

from ibe_rl.apps.study.arms import Asked, SpokenFrames, expectations, words_of_others
from ibe_rl.apps.study.scenes import scene_of
from ibe_rl.metrics.observer import Observer
from ibe_rl.types import DOES_NOT_KNOW

OPTIONS = ["going down", "staying", "going a little up", "going up"]


def test_it_speaks_in_its_own_words_and_in_the_papers() -> None:
    said = speaker().say(ride(range(10)).moments[:2])
    assert said["ibe"] == SpokenFrames((1.0, 1.0), ("going up", "going up"), (True, True))
    assert said["paper"].expressions == (1.0, 1.0)
    assert {*speaker(paper=None).say(ride(range(10)).moments[:2])} == {"ibe"}


def test_it_says_that_it_does_not_know_and_the_papers_agent_never_does() -> None:
    said = speaker().say(ride([29, 31, 31]).moments, every_steps=9)
    assert said["ibe"] == SpokenFrames((1.0, 0.0), ("going up", DOES_NOT_KNOW), (True, False))
    assert said["paper"].known == (True, True)


def test_what_really_came_true_is_in_its_own_words() -> None:
    true = speaker().really(np.array([[4.0], [0.0], [-4.0]]))
    assert true == SpokenFrames((1.0, 0.0, -1.0), ("going up", "staying", "going down"), (True,) * 3)
    assert true.as_json() == {"expressions": [1.0, 0.0, -1.0], "phrases": ["going up", "staying", "going down"]}


def test_placebic_words_are_those_of_another_episode_and_as_frequent() -> None:
    said = [SpokenFrames((float(n),) * 3, (f"word {n}",) * 3, (True,) * 3) for n in range(9)]
    for seed in range(20):
        dealt = words_of_others(said, np.random.default_rng(seed))
        assert all(one != other for one, other in zip(said, dealt, strict=True))
        assert Counter(dealt) == Counter(said)


def test_words_are_stretched_over_another_number_of_frames() -> None:
    said = SpokenFrames((0.0, 1.0), ("a", "b"), (True, False))
    assert said.stretched(5).phrases == ("a", "a", "a", "b", "b")
    assert said.stretched(1) == SpokenFrames((0.0,), ("a",), (True,))


def words(expression: float, phrase: str, known: bool = True) -> SpokenFrames:
    return SpokenFrames((9.0, expression), ("staying", phrase), (True, known))


def test_observers_read_the_last_words_and_else_go_on_as_it_moves() -> None:
    """It went from 5 m to 6 m: without words it goes on to 10 m; an expression of 1 is read as 4 m."""
    said = {"ibe": words(1.0, "going up"), "paper": words(-0.5, "going down"), "placebic": words(0, "?", known=False)}
    asked = Asked(np.array([5.0]), np.array([6.0]), HORIZON)
    scene = scene_of(DRAWN, [ride(range(3)).episode], 24)
    found = expectations(asked, said, speaker(), Observer(4.0), scene, OPTIONS)
    assert found == {
        "none": {"at": 0.5, "choice": 3},
        "ibe": {"at": 0.5, "choice": 3},
        "paper": {"at": 0.2, "choice": 0},
        "placebic": {"at": 0.5, "choice": 3},
    }


def test_the_environment_may_say_how_it_moves() -> None:
    moving = replace(DRAWN, motion=lambda states: np.full((len(states), 1), 2.0))
    asked = Asked(np.array([6.0]), np.array([6.0]), HORIZON)
    scene = scene_of(moving, [ride(range(3)).episode], 24)
    found = expectations(asked, {}, speaker(task=moving), Observer(4.0), scene, OPTIONS)
    assert found == {"none": {"at": 0.7, "choice": OPTIONS.index("staying")}}
    assert LIFT.motion is None
