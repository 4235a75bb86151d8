"""Each source on points on a line, of which it is obvious what they were told and what they did."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from masses import Agent, Rule, fly, ignores, obeys, opposes, planned, seen_as, to_the_middle

from ibe_rl.ibe import Evidence
from ibe_rl.ibe.delta import LoggedSteps
from ibe_rl.ibe.evidence import _regressors, compliance, influence, influence_of_plan, pays, pays_at_once, satisfaction
from ibe_rl.types import Array, Episode

RIGHT = np.array([1.0, 0.0])
"""Where +1 asks to go."""
ALL = np.ones(40, bool)
Source = Callable[[LoggedSteps, Array], Evidence | None]
SOURCES: dict[str, Source] = {
    "satisfaction": lambda record, axis: satisfaction(record, axis, 0, 0),
    "best": lambda record, axis: compliance(record, axis, 0, np.ones(record.episode_count, bool), 0),
    "pays": lambda record, axis: pays(record, axis, 0, 0),
    "influence": lambda record, axis: influence_of_plan(record, axis, 0, 0),
}


def record(agent: Agent = obeys, rule: Rule = to_the_middle, horizon_steps: int = 5, **settings: float) -> LoggedSteps:
    return LoggedSteps.of(fly(agent, rule, **settings), horizon_steps)


def sure(evidence: Evidence | None) -> int:
    """The sign of what there must be."""
    assert evidence is not None
    assert evidence.low <= evidence.effect <= evidence.high
    return evidence.sign


def by_hand(
    places: Sequence[Sequence[float]], instruction: Sequence[Sequence[float]], horizon_steps: int = 1
) -> LoggedSteps:
    """One number that moves."""
    like = fly(episodes=1, steps=1)[0]
    each = [
        replace(
            like,
            states=np.array(path, float)[:, None],
            actions=np.zeros(len(said)),
            rewards=np.zeros(len(said)),
            instructions=np.array(said, float)[:, None],
            given=np.ones(len(said), bool),
        )
        for path, said in zip(places, instruction, strict=True)
    ]
    return LoggedSteps.of(each, horizon_steps)


# ---- what ends it


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
@pytest.mark.parametrize("seed", range(3))
def test_what_ends_an_instruction_is_the_same_whoever_hears_it(agent: Agent, seed: int) -> None:
    log = record(agent, episodes=100, seed=seed)
    assert sure(satisfaction(log, RIGHT, 0, seed)) == 1
    assert sure(satisfaction(log, -RIGHT, 0, seed)) == -1


@pytest.mark.parametrize("agent", [ignores, opposes])
def test_it_is_seen_where_the_instructor_is_rarely_heard(agent: Agent) -> None:
    assert sure(satisfaction(record(agent, heard_every=4), RIGHT, 0, 0)) == 1


def only_right(state: Array, _step: int, _episode: int) -> float:
    return float(state[0] < -0.5)


def test_one_word_and_silence_are_enough() -> None:
    """Who never says 0 is silent where they ask for nothing."""
    spoken = [replace(one, given=one.instructions[:, 0] != 0) for one in fly(ignores, only_right)]
    log = LoggedSteps.of(spoken, 5)
    assert set(log.instruction[log.given, 0]) == {1}
    assert sure(satisfaction(log, RIGHT, 0, 0)) == 1


def test_who_says_what_is_happening_anyway_looks_the_other_way_round() -> None:
    """As documented: told to speed up while it speeds up."""

    def with_it(state: Array, _step: int, _episode: int) -> float:
        return float(np.sign(state[0]) * (abs(state[0]) > 0.5))

    assert sure(satisfaction(record(ignores, with_it), RIGHT, 0, 0)) == -1


def test_it_is_the_slope_of_movements_on_changes_of_the_instruction() -> None:
    """All begin at 0 with the instruction +1. Four go on by 2 and get 0 then; five stay and still get +1."""
    log = by_hand([[0, 2, 2]] * 8 + [[0, 0, 0]] * 8, [[1, 0]] * 8 + [[1, 1]] * 8)
    found = satisfaction(log, np.ones(1), 0, 0)
    assert found is not None
    assert found.effect == pytest.approx(2 / np.std(log.delta))
    assert (found.source, found.episodes) == ("satisfaction", 8)


def test_only_windows_from_similar_places_are_compared() -> None:
    """Far away all go 10 and are instructed +1 still; near the goal those who go 1 have arrived, others have not."""
    places = [[-100, -90, -90]] * 8 + [[0, 1, 1]] * 8 + [[0, 0, 0]] * 8
    log = by_hand(places, [[1, 1]] * 8 + [[1, 0]] * 8 + [[1, 1]] * 8)
    found = satisfaction(log, np.ones(1), 0, 0)
    assert found is not None
    assert found.effect == pytest.approx(1 / np.std(log.delta))


def test_it_needs_eight_episodes_in_which_an_instruction_ended() -> None:
    for ended, expected in ((7, False), (8, True)):
        log = by_hand([[0, 2, 2]] * ended + [[0, 0, 0]] * 20, [[1, 0]] * ended + [[1, 1]] * 20)
        assert (satisfaction(log, np.ones(1), 0, 0) is not None) == expected


def test_an_instruction_that_never_ends_has_none() -> None:
    assert satisfaction(record(obeys, lambda *_: 1.0), RIGHT, 0, 0) is None


# ---- how the best moved


@pytest.mark.parametrize(("agent", "sign"), [(obeys, 1), (ignores, 0), (opposes, -1)])
def test_the_best_moved_as_they_did(agent: Agent, sign: int) -> None:
    assert sure(compliance(record(agent, planned), RIGHT, 0, ALL, 0)) == sign


def test_only_those_that_count_do() -> None:
    episodes = fly(obeys, planned)[:20] + fly(opposes, planned, seed=1)[20:]
    log, first = LoggedSteps.of(episodes, 5), np.arange(40) < 20
    assert [sure(compliance(log, RIGHT, 0, some, 0)) for some in (first, ~first)] == [1, -1]
    assert compliance(log, RIGHT, 0, first & (np.arange(40) < 6), 0) is None  # too few


def test_it_is_the_mean_movement_that_was_instructed() -> None:
    """Instructed +1 it goes by 3, instructed -1 by -1, without instruction by 100, which does not count."""
    log = by_hand([[0, 3, 2, 102]] * 8, [[1, -1, 0]] * 8)
    found = compliance(log, np.ones(1), 0, np.ones(8, bool), 0)
    assert found is not None
    assert found.effect == pytest.approx(2 / np.std(log.delta))
    assert found.low == found.high == pytest.approx(found.effect)  # all episodes are alike
    assert found.episodes == 8


def test_who_was_not_instructed_did_nothing() -> None:
    assert compliance(record(obeys, lambda *_: 0.0), RIGHT, 0, ALL, 0) is None
    assert compliance(record(), RIGHT, 0, ~ALL, 0) is None


# ---- what pays


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
@pytest.mark.parametrize("reward", [1.0, -1.0])
def test_following_pays_or_does_not_whoever_does_it(agent: Agent, reward: float) -> None:
    log = record(agent, planned, pays=reward)
    assert sure(pays_at_once(log, RIGHT, 0, 0)) == reward
    assert sure(pays_at_once(log, -RIGHT, 0, 0)) == -reward


def test_a_reward_for_something_else_says_nothing() -> None:
    chance = np.random.default_rng(0)
    log = LoggedSteps.of([replace(one, rewards=chance.normal(size=40)) for one in fly(ignores, planned)], 5)
    assert sure(pays_at_once(log, RIGHT, 0, 0)) == 0


def test_what_could_be_expected_of_the_place_is_no_merit() -> None:
    """The reward is the place itself, which the movement only follows from: pulled back to 0, it is paid on the right.

    Always told to go right, it moves as the place makes it, and not as told.
    """

    def pulled(state: Array, _instruction: float, _chance: np.random.Generator) -> float:
        return float(-2 * state[0] - 3 * state[1])

    logged = [replace(one, rewards=one.states[:-1, 0]) for one in fly(pulled, lambda *_: 1.0)]
    log = LoggedSteps.of(logged, 5)
    moved, earned = log.delta[log.complete, 0], log.window_return[log.complete]
    assert np.corrcoef(moved, earned)[0, 1] < -0.5
    assert pays_at_once(log, RIGHT, 0, 0) is None
    coarse = [replace(one, states=one.states.astype(np.float32)) for one in logged]  # as a log keeps them
    assert pays_at_once(LoggedSteps.of(coarse, 5), RIGHT, 0, 0) is None


def test_with_many_dimensions_what_is_expected_is_linear() -> None:
    """Eleven more numbers that say nothing."""
    chance = np.random.default_rng(0)
    crowd = [
        replace(one, states=np.column_stack([one.states, chance.normal(size=(41, 11))]))
        for one in fly(ignores, planned, pays=1.0)
    ]
    assert sure(pays_at_once(LoggedSteps.of(crowd, 5), np.append(RIGHT, np.zeros(11)), 0, 0)) == 1
    states, signs = chance.normal(size=(20, 13)), np.ones(20)
    assert _regressors(states, signs).shape == (20, 2 * 14)
    assert _regressors(states[:, :12], signs).shape == (20, 2 * 13 + 78)


def paid_at_the_end(agent: Agent, sign: float, count: int = 40, per_step: float = -1.0) -> list[Episode]:
    """Every step costs the same, and who follows more of a plan is there sooner."""
    made = []
    for number, one in enumerate(fly(agent, planned, episodes=count)):
        followed = sign * float((np.diff(one.states[:, 0]) * one.instructions[:, 0]).sum())
        steps = int(np.clip(25 - 10 * followed, 11, 40))
        cut = {name: getattr(one, name)[:steps] for name in ("actions", "instructions", "given")}
        rewards, context = np.full(steps, per_step), "here" if number % 2 else "there"
        made.append(replace(one, states=one.states[: steps + 1], rewards=rewards, context=context, **cut))
    return made


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_where_all_steps_earn_the_same_episodes_are_compared(sign: float) -> None:
    log = LoggedSteps.of(paid_at_the_end(ignores, sign), 5)
    assert pays_at_once(log, RIGHT, 0, 0) is None
    assert sure(pays(log, RIGHT, 0, 0)) == sign


def test_episodes_are_compared_within_their_context() -> None:
    """There they obey and are paid a lot in the end, here they do not and are not; within a context nothing pays."""
    there = [replace(one, context="there") for one in paid_at_the_end(obeys, 0.0)]
    here = paid_at_the_end(opposes, 0.0)
    chance = np.random.default_rng(0)

    def paid(one: Episode, much: float) -> Episode:
        """In the last step, that no whole window begins before."""
        return replace(one, rewards=np.append(np.zeros(len(one) - 1), much + chance.normal()))

    def log(context: str) -> LoggedSteps:
        good, bad = [paid(one, 100) for one in there], [paid(replace(one, context=context), 0) for one in here]
        found = LoggedSteps.of(good + bad, 30)
        assert not found.complete.any()
        return found

    assert sure(pays(log("there"), RIGHT, 0, 0)) == 1
    assert sure(pays(log("here"), RIGHT, 0, 0)) == 0


@pytest.mark.parametrize("agent", [obeys, ignores])
def test_where_all_episodes_earn_the_same_nothing_pays(agent: Agent) -> None:
    assert pays(record(agent, planned, per_step=-1.0), RIGHT, 0, 0) is None
    assert pays(record(agent, planned), RIGHT, 0, 0) is None


def test_a_movement_that_is_always_the_same_pays_nothing() -> None:
    """The rewards differ by chance; nothing moved more than usual."""
    log = by_hand([np.arange(8.0).tolist()] * 10, [[1.0] * 7] * 10)
    rewards = np.random.default_rng(0).normal(size=len(log))
    assert pays_at_once(replace(log, window_return=rewards), np.zeros(1), 0, 0) is None


def test_too_few_windows_with_an_instruction_pay_nothing() -> None:
    def once(_state: Array, step: int, episode: int) -> float:
        return float(episode < 4 and step == 3)

    assert pays_at_once(record(ignores, once, pays=1.0), RIGHT, 0, 0) is None


def test_an_episode_that_was_hardly_instructed_does_not_count() -> None:
    """Four windows an episode are too few where episodes are compared."""
    some = paid_at_the_end(ignores, 1.0)
    for windows, expected in ((4, False), (5, True)):
        instruction = [
            replace(one, instructions=np.where(np.arange(len(one)) < windows, 1.0, 0)[:, None]) for one in some
        ]
        assert (pays(LoggedSteps.of(instruction, 5), RIGHT, 0, 0) is not None) == expected


# ---- what the agent does


def test_what_the_agent_does_otherwise_is_half_of_the_difference() -> None:
    log = by_hand([[0, 1, -1]] * 8, [[1, -1]] * 8)
    up, down = np.full((8, 1), 5.0), np.full((8, 1), -1.0)
    found = influence(log, np.ones(1), up, down, 0)
    assert found is not None
    assert found.effect == pytest.approx(3 / np.std(log.delta))
    assert (found.source, found.episodes, found.sign) == ("influence", 8, 1)
    other = influence(log, np.ones(1), down, up, 0)
    assert other is not None
    assert other.sign == -1


def test_who_does_the_same_has_no_influence() -> None:
    found = influence(record(), RIGHT, np.ones((9, 2)), np.ones((9, 2)), 0)
    assert found == Evidence("influence", 0, 0, 0, 9)
    assert found.sign == 0


def test_who_does_anything_is_not_sure() -> None:
    chance = np.random.default_rng(0)
    assert sure(influence(record(), RIGHT, *chance.normal(size=(2, 24, 2)), 0)) == 0


@pytest.mark.parametrize(("asked", "expected"), [(7, False), (8, True)])
def test_seven_moments_are_too_few(asked: int, expected: bool) -> None:
    found = influence(record(), RIGHT, np.ones((asked, 2)), -np.ones((asked, 2)), 0)
    assert (found is not None) == expected


@pytest.mark.parametrize(("agent", "sign"), [(obeys, 1), (ignores, 0), (opposes, -1)])
@pytest.mark.parametrize("seed", range(3))
def test_a_plan_shows_who_follows_it(agent: Agent, sign: int, seed: int) -> None:
    assert sure(influence_of_plan(record(agent, planned, seed=seed), RIGHT, 0, seed)) == sign


def test_a_plan_is_read_from_every_other_episode() -> None:
    """From those that an axis has not been looked for in."""
    follow, oppose = fly(obeys, planned), fly(opposes, planned)
    odd = [follow[number] if number % 2 else oppose[number] for number in range(40)]
    assert sure(influence_of_plan(LoggedSteps.of(odd, 5), RIGHT, 0, 0)) == 1


@pytest.mark.parametrize("only", [1.0, -1.0])
def test_a_plan_with_one_word_shows_nothing(only: float) -> None:
    assert influence_of_plan(record(obeys, lambda _s, step, _e: only * (step % 2)), RIGHT, 0, 0) is None


# ---- all of them


@pytest.mark.parametrize("source", SOURCES)
def test_seven_episodes_are_too_few(source: str) -> None:
    few, many = (LoggedSteps.of(fly(obeys, planned, episodes=count, pays=1.0), 5) for count in (7, 40))
    assert SOURCES[source](few, RIGHT) is None
    assert SOURCES[source](many, RIGHT) is not None


@pytest.mark.parametrize("rule", [planned, to_the_middle])
@pytest.mark.parametrize("source", SOURCES)
def test_it_is_the_same_in_other_coordinates(source: str, rule: Rule) -> None:
    """Mixed, scaled and shifted, with an axis that goes with them."""
    chance = np.random.default_rng(0)
    episodes = fly(obeys, rule, pays=1.0)
    expected = SOURCES[source](LoggedSteps.of(episodes, 5), RIGHT)
    assert expected is not None
    for _ in range(3):
        mixing = chance.normal(size=(2, 2)) * 10.0 ** chance.uniform(-2, 2, 2)
        log = LoggedSteps.of(seen_as(episodes, mixing, chance.normal(size=2)), 5)
        found = SOURCES[source](log, np.linalg.solve(mixing, RIGHT))
        assert found is not None
        assert found.episodes == expected.episodes
        np.testing.assert_allclose(
            [found.effect, found.low, found.high], [expected.effect, expected.low, expected.high], rtol=1e-3, atol=1e-4
        )


@pytest.mark.parametrize("source", SOURCES)
def test_the_same_seed_gives_the_same(source: str) -> None:
    log = record(obeys, planned, pays=1.0)
    assert SOURCES[source](log, RIGHT) == SOURCES[source](log, RIGHT)


def test_another_seed_resamples_otherwise() -> None:
    log = record(obeys, planned)
    one, other = (compliance(log, RIGHT, 0, ALL, seed) for seed in (0, 1))
    assert one is not None
    assert other is not None
    assert one.effect == other.effect
    assert one.low != other.low
