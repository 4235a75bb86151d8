"""What became of what the agent said, and the films of it."""

from __future__ import annotations

import numpy as np
import pytest
from on_stage import HORIZON_STEPS, explainer_state

from ibe_rl.apps.teach.outcomes import MOST_FILMS, Outcomes
from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.lander_task import X
from ibe_rl.explain.phrasing import put_in_words
from ibe_rl.types import Array, Explanation

EXPLAINER, SCENE = explainer_state(), {"size": [600, 400], "background": []}


def state(x: float) -> Array:
    made = np.zeros(len(LANDER_TASK.state_names), np.float32)
    made[X] = x
    return made


def says(x: float) -> Explanation:
    """That it will be there, from the middle."""
    path = np.linspace(state(0.0), state(x), HORIZON_STEPS + 1)
    return put_in_words(path[None, None], EXPLAINER)[0]


def begun(episode: int = 0) -> Outcomes:
    outcomes = Outcomes(LANDER_TASK)
    outcomes.begin({"episode": episode, **SCENE})
    return outcomes


@pytest.mark.parametrize(("went", "true"), [(0.05, True), (-0.05, False)])
def test_it_is_due_after_so_many_steps_and_true_if_the_movement_has_that_phrase(went: float, true: bool):
    outcomes, said = begun(3), says(0.05)
    outcomes.hear(3, 2, state(0.0), said, EXPLAINER)
    assert all(outcomes.step(step, state(went), [step]) is None for step in range(2, 2 + HORIZON_STEPS))
    outcome = outcomes.step(2 + HORIZON_STEPS, state(went), ["last"])
    expected = says(went).phrase
    assert outcome == {"episode": 3, "step": 2, "said": said.phrase, "went": expected, "came_true": true}
    assert outcomes.step(3 + HORIZON_STEPS, state(went), []) is None
    assert outcomes.films[said.phrase] == {**outcome, **SCENE, "pictures": [[3], [6]]}


def test_what_is_not_about_this_episode_or_not_known_has_no_outcome():
    outcomes = begun(3)
    outcomes.hear(2, 0, state(0.0), says(0.05), EXPLAINER)
    outcomes.hear(3, 0, state(0.0), put_in_words(np.zeros((1, 1, 6, 9)), explainer_state())[0], EXPLAINER)
    outcomes.begin({"episode": 4, **SCENE})  # it ended before it was due
    assert outcomes.step(50, state(0.1), []) is None


def test_of_several_that_are_due_the_newest_is_told():
    outcomes = begun()
    for step in (0, 1):
        outcomes.hear(0, step, state(0.0), says(0.05), EXPLAINER)
    outcome = outcomes.step(40, state(0.05), [])
    assert outcome is not None
    assert outcome["step"] == 1


def test_one_that_came_true_is_kept_as_a_film_and_not_too_many():
    outcomes = begun()
    for number, went in enumerate((0.05, -0.05)):
        outcomes.hear(0, 10 * number, state(0.0), says(0.05), EXPLAINER)
        outcomes.step(10 * number + 9, state(went), [number])
    assert [film["came_true"] for film in outcomes.films.values()] == [True]
    outcomes.films |= {str(number): outcomes.films[says(0.05).phrase] for number in range(MOST_FILMS)}
    outcomes.hear(0, 30, state(0.0), says(-0.05), EXPLAINER)
    outcomes.step(39, state(-0.05), [0])
    assert says(-0.05).phrase not in outcomes.films
