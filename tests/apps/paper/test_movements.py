"""Whether the best rides follow the instructions more, on rides that do or do not."""

from collections.abc import Sequence

import numpy as np
import pytest
from rides import TASK, ride

from ibe_rl.apps.paper.movements import Movements, claim_effects, effect_json, followed, histogram, holds, movements_of
from ibe_rl.metrics.bootstrap import Estimate
from ibe_rl.metrics.effect import Effect
from ibe_rl.types import Episode

UP, STILL, DOWN = 1.0, 0.0, -1.0


def made(instruction: float, best: Sequence[float], others: Sequence[float]) -> Movements:
    """A window of each change; the first episode is the best, all others are of the second one."""
    change = np.array([*best, *others], float)
    number = np.repeat([0, 1], [len(best), len(others)])
    first, context = np.array([True, False]), np.array(["lower", "lower"])
    return Movements(change, np.full(len(change), instruction), number, first, first, context)


def rides(*groups: tuple[int, float, float, str], instruction: float = UP) -> list[Episode]:
    """So many one-step rides, ``(number, height it goes, reward, context)``, each a little different."""
    return [
        ride([0, went + number / 1_000], instruction, reward - number / 1_000, context)
        for count, went, reward, context in groups
        for number in range(count)
    ]


def claimed(episodes: Sequence[Episode], instruction: float = UP) -> dict[str, str]:
    found = claim_effects(movements_of(episodes, TASK, 5, 0.25), instruction, 300, 0)
    return {over: holds(one) for over, one in found.items()}


def test_changes_go_to_the_end_of_the_episode_and_silence_is_left_out():
    first = ride([0, 1, 3, 6], [UP, DOWN, STILL], reward=1, given=[True, False, True])
    moves = movements_of([first, ride([5, 5, 4], DOWN)], TASK, 2, 0.5)
    assert moves.change.tolist() == [3, 3, -1, -1]
    assert moves.instruction.tolist() == [UP, STILL, DOWN, DOWN]
    assert moves.episode.tolist() == [0, 0, 1, 1]
    assert moves.changes(UP, best=True).tolist() == [3]
    assert moves.changes(DOWN, best=False).tolist() == [-1, -1]
    assert moves.changes(DOWN, best=True).tolist() == moves.changes(UP, best=False).tolist() == []


def test_the_best_are_those_of_all_or_of_each_context():
    of_each = ((10, "upper"), (9, "upper"), (2, "lower"), (3, "lower"))
    moves = movements_of([ride([0, 1], UP, reward, context) for reward, context in of_each], TASK, 1, 0.5)
    assert moves.best.tolist() == [True, True, False, False]
    assert moves.best_of_context.tolist() == [True, False, False, True]
    assert moves.context.tolist() == ["upper", "upper", "lower", "lower"]


def test_an_episode_in_silence_can_be_the_best_but_has_no_windows():
    moves = movements_of([ride([0, 9], UP, 5, given=False), ride([0, 1], UP, 1)], TASK, 1, 0.5)
    assert (moves.change.tolist(), moves.episode.tolist(), moves.best.tolist()) == ([1], [1], [True, False])


def test_a_histogram_by_hand():
    found = histogram(made(UP, [0.25, 0.75, 0.75, 1], [-1, 0.25]), UP, bins=4)
    assert found["edges"] == [-1, -0.5, 0, 0.5, 1]
    assert found["best"] == {"windows": 4, "mean": 0.6875, "density": [0, 0, 0.5, 1.5]}
    assert found["others"] == {"windows": 2, "mean": -0.375, "density": [1, 0, 1, 0]}
    assert found["shown_to"] == 1  # the peak of 1.5 sticks out


def test_densities_add_up_to_the_share_that_is_inside():
    near, far = np.linspace(-1, 1, 1_000), np.full(2, 50.0)
    found = histogram(made(UP, [*near, *far], near), UP, bins=41)
    width = np.diff(found["edges"])
    assert -found["edges"][0] == found["edges"][-1] == pytest.approx(1, abs=0.01)
    assert np.sum(width * found["best"]["density"]) == pytest.approx(1 - 2 / 1_002, abs=0.005)
    assert np.sum(width * found["best"]["density"]) < np.sum(width * found["others"]["density"]) <= 1
    assert found["best"]["mean"] == pytest.approx(100 / 1_002)


def test_without_that_instruction_the_histogram_is_empty():
    moves = made(UP, [1, -1], [])
    for instruction, windows, mean in ((UP, 2, 0), (DOWN, 0, None)):
        found = histogram(moves, instruction, bins=4)
        assert (found["best"]["windows"], found["best"]["mean"]) == (windows, mean)
        assert found["others"] == {"windows": 0, "mean": None, "density": [0] * 4}
        assert found["edges"] == [-1, -0.5, 0, 0.5, 1]
    assert histogram(made(UP, [], []), UP, bins=4)["edges"] == [-1, -0.5, 0, 0.5, 1]


def test_both_groups_are_shown_over_the_changes_after_all_instructions():
    moves = movements_of([ride([0, 2], UP), ride([0, -1], DOWN), ride([0, -1], DOWN)], TASK, 1, 0.5)
    assert histogram(moves, DOWN, 4)["edges"] == histogram(moves, UP, 4)["edges"]
    assert histogram(moves, DOWN, 4)["edges"][-1] == pytest.approx(2, abs=0.02)


@pytest.mark.parametrize(
    ("instruction", "means"),
    [(UP, [-3.0, 0.5]), (DOWN, [3.0, -0.5]), (STILL, [-3.0, -1.5])],
)
def test_how_far_each_episode_went_the_instructed_way(instruction: float, means: list[float]):
    """One went down by 2 and 4 metres, one up by 2 and down by 1; one was told something else."""
    changes, episodes = np.array([-2.0, -4, 2, -1, 7]), np.array([1, 1, 4, 4, 2])
    none = np.zeros(5, bool)
    moves = Movements(changes, np.array([instruction] * 4 + [9.0]), episodes, none, none, np.array(["lower"] * 5))
    numbers, values = followed(moves, instruction)
    assert numbers.tolist() == [1, 4]
    assert values == pytest.approx(means)


def test_the_claim_by_hand():
    """Best of each four by reward: 4 m up, the others 1, 2 and 5."""
    episodes = [ride([0, went], UP, reward) for went, reward in ((4, 9), (1, 3), (2, 2), (5, 1))]
    found = claim_effects(movements_of(episodes, TASK, 1, 0.25), UP, 20, 0)
    assert list(found) == ["all", "lower", "within"]
    for one in found.values():
        assert one is not None
        assert (one.counts, one.means) == ((1, 3), (4, pytest.approx(8 / 3)))
        assert one.superiority.value == pytest.approx(2 / 3)


@pytest.mark.parametrize("instructions", [UP, DOWN])
def test_where_the_best_go_further_the_claim_holds(instructions: float):
    assert (
        claimed(
            rides((10, 3 * instructions, 9, "lower"), (30, instructions, 1, "lower"), instruction=instructions),
            instructions,
        )["all"]
        == "yes"
    )
    assert (
        claimed(
            rides((10, instructions, 9, "lower"), (30, 3 * instructions, 1, "lower"), instruction=instructions),
            instructions,
        )["all"]
        == "no"
    )


def test_instructed_to_stay_the_claim_holds_where_the_best_move_less_to_either_side():
    still = rides((10, 0, 9, "lower"), (15, 2, 1, "lower"), (15, -2, 1, "lower"), instruction=STILL)
    assert claimed(still, STILL)["all"] == "yes"
    moving = rides((10, -2, 9, "lower"), (30, 0, 1, "lower"), instruction=STILL)
    assert claimed(moving, STILL)["all"] == "no"


def test_where_the_best_do_as_the_others_it_is_open():
    alike = [ride([0, went], UP, reward) for reward in (9, 1, 1, 1) for went in np.linspace(1, 2, 10)]
    assert claimed(alike) == {"all": "open", "lower": "open", "within": "open"}


def test_a_context_with_more_reward_and_longer_ways_makes_the_claim_but_not_within():
    """The best of all are upstairs, where everybody goes far; on each floor the best go less far than the others."""
    upper = ((3, 9, 20, "upper"), (7, 10, 19, "upper"))
    lower = ((8, 1, 2, "lower"), (22, 2, 1, "lower"))
    assert claimed(rides(*upper, *lower)) == {"all": "yes", "lower": "no", "upper": "no", "within": "no"}


def test_contexts_in_which_the_best_follow_more_make_the_claim_within_but_not_for_all():
    upper = ((5, 2, 20, "upper"), (15, 1, 19, "upper"))
    lower = ((5, 10, 2, "lower"), (15, 9, 1, "lower"))
    assert claimed(rides(*upper, *lower)) == {"all": "no", "lower": "yes", "upper": "yes", "within": "yes"}


def test_what_was_never_instructed_to_both_groups_cannot_be_claimed():
    both = rides((4, 1, 9, "lower"), (12, 1, 1, "lower")) + rides((4, 1, 0, "upper"), instruction=DOWN)
    moves = movements_of(both, TASK, 5, 0.25)
    found = claim_effects(moves, UP, 20, 0)
    assert (found["upper"], found["all"] is None, found["within"] is None) == (None, False, False)
    assert claim_effects(moves, DOWN, 20, 0)["all"] is None  # none of those told so is among the best of all
    assert claim_effects(moves, STILL, 20, 0) == dict.fromkeys(["all", "lower", "upper", "within"])


def effect_of(low: float, high: float) -> Effect:
    return Effect((4, 12), (2.0, 1.5), Estimate(0.5, 0.25, 0.75), Estimate((low + high) / 2, low, high))


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        *((0.51, 0.9, "yes"), (0.1, 0.49, "no"), (0.4, 0.6, "open"), (0.5, 0.9, "open"), (0.1, 0.5, "open")),
        (float("nan"), float("nan"), "open"),
    ],
)
def test_a_claim_holds_where_its_interval_is_clear_of_no_difference(low: float, high: float, verdict: str):
    assert holds(effect_of(low, high)) == verdict


def test_without_an_effect_it_is_open():
    assert holds(None) == "open"
    assert effect_json(None) is None


def test_a_claim_as_json():
    assert effect_json(effect_of(0.5, 1.0)) == {
        "best_episodes": 4,
        "other_episodes": 12,
        "best_mean": 2.0,
        "others_mean": 1.5,
        "difference": {"value": 0.5, "low": 0.25, "high": 0.75},
        "superiority": {"value": 0.75, "low": 0.5, "high": 1.0},
        "holds": "open",
    }
