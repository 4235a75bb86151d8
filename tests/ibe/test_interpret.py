"""Which way words are meant: the vote of the sources, and logs of which it is known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from masses import STEPS, Agent, Rule, fly, ignores, obeys, opposes, planned, seen_as, speed_up, to_the_middle

from ibe_rl.ibe import Evidence, Interpretation, Meaning, Reactions, interpret
from ibe_rl.ibe.interpret import decide
from ibe_rl.types import Array, Episode

RIGHT = np.array([1.0, 0.0])
ENDS, LISTENS, PAYS = "what ends the instruction", "how the agent reacts to the instruction", "what is rewarded"
PAID = "the reward favours the opposite of what ends the instruction"
REACTS = "the agent's reaction to the instruction is not what is rewarded"
OPPOSITE = "the agent does the opposite of what ends the instruction"
ALIKE = "the agent did the same under every instruction, and whether following is rewarded is unclear"
NOTHING = "neither the end of instructions, nor the agent's reaction, nor the reward shows it"


# ---- the vote


def votes(**signs: float) -> list[Evidence]:
    """Clear evidence of such a sign; of the effect 0 it is sure that there is none."""
    return [Evidence(name, sign * 0.5, sign * 0.5 - 0.1, sign * 0.5 + 0.1, 30) for name, sign in signs.items()]


TABLE: list[tuple[dict[str, float], bool, int, str]] = [
    # what ends it is enough, unless it is contradicted alone
    ({"satisfaction": 1}, True, 1, f"from {ENDS}"),
    ({"satisfaction": 1, "influence": 0, "pays": 0}, True, 1, f"from {ENDS}"),
    ({"satisfaction": 1, "influence": 1}, True, 1, f"from {ENDS} and {LISTENS}"),
    ({"satisfaction": 1, "pays": 1}, True, 1, f"from {ENDS} and {PAYS}"),
    ({"satisfaction": 1, "influence": 1, "pays": 1}, True, 1, f"from {ENDS} and {LISTENS} and {PAYS}"),
    ({"satisfaction": 1, "influence": -1}, True, 0, OPPOSITE),
    ({"satisfaction": 1, "influence": -1, "pays": 1}, True, 1, f"from {ENDS} and {PAYS}"),
    ({"best": -1, "satisfaction": 1, "influence": 1, "pays": -1}, True, 1, f"from {ENDS} and {LISTENS}"),
    ({"best": -1, "satisfaction": 1, "pays": -1}, True, 0, PAID),
    ({"best": -1, "satisfaction": 1, "influence": -1, "pays": -1}, True, 0, PAID),
    # what is rewarded at once and was not done in the best episodes is something else
    ({"best": 1, "satisfaction": 1, "pays": -1}, True, 1, f"from {ENDS}"),
    ({"best": 0, "satisfaction": 1, "pays": -1}, True, 1, f"from {ENDS}"),
    ({"satisfaction": 1, "pays": -1}, True, 1, f"from {ENDS}"),
    ({"best": 1, "satisfaction": 1, "influence": -1, "pays": -1}, True, 0, OPPOSITE),
    # the others are only enough together
    ({"influence": 1, "pays": 1}, True, 1, f"from {LISTENS} and {PAYS}"),
    ({"best": -1, "influence": 1, "pays": 1}, True, 1, f"from {LISTENS} and {PAYS}"),
    ({"influence": 1, "pays": -1}, True, 0, REACTS),
    ({"influence": 1, "pays": -1}, False, 0, REACTS),
    ({"influence": 1}, True, 0, f"the only evidence is {LISTENS}"),
    ({"pays": 1}, True, 0, f"the only evidence is {PAYS}"),
    ({"pays": 1, "influence": 0}, True, 0, f"the only evidence is {PAYS}"),
    # of a plan the answer of the agent is
    ({"influence": 1}, False, 1, f"from {LISTENS}"),
    ({"influence": 1, "pays": 1}, False, 1, f"from {LISTENS} and {PAYS}"),
    ({"pays": 1}, False, 0, f"the only evidence is {PAYS}"),
    # nothing
    ({"best": 1}, True, 0, NOTHING),
    ({"best": 1}, False, 0, NOTHING),
    ({}, True, 0, NOTHING),
    ({"influence": 0}, True, 0, ALIKE),
    ({"influence": 0, "pays": 0}, True, 0, ALIKE),
]  # fmt: skip


@pytest.mark.parametrize(("signs", "depends", "sign", "reason"), TABLE)
def test_the_sources_vote(signs: dict[str, float], depends: bool, sign: int, reason: str) -> None:
    assert decide(votes(**signs), depends) == (sign, reason)
    turned = {name: -vote for name, vote in signs.items()}
    assert decide(votes(**turned), depends) == (-sign, reason)


@pytest.mark.parametrize("source", ["satisfaction", "influence", "pays"])
def test_what_is_not_clear_has_no_vote(source: str) -> None:
    """Its interval reaches 0, or it is as good as nothing."""
    carrying = votes(satisfaction=1, influence=1, pays=1)
    for effect, low, high in ((0.5, -0.1, 1.1), (0.09, 0.08, 0.1)):
        unclear = [replace(one, effect=effect, low=low, high=high) for one in carrying if one.source == source]
        assert decide(unclear, False) == (0, NOTHING)
    enough = [replace(one, effect=0.1, low=0.05, high=0.2) for one in carrying if one.source == source]
    assert decide(enough, False) != (0, NOTHING)


# ---- reactions


def reactions(up: Sequence[float], down: Sequence[float], moments: int = 12) -> Reactions:
    """The same at all moments: changes of place and speed."""
    return Reactions(*(np.tile(np.asarray(each, float), (moments, 1, 1)) for each in (up, down)))


def test_reactions_come_back_from_json_and_stay_as_they_are() -> None:
    made = Reactions(np.arange(12.0).reshape(2, 3, 2), -np.ones((2, 3, 2)))
    read = Reactions.from_dict(json.loads(json.dumps(made.to_dict())))
    np.testing.assert_array_equal(read.up, made.up)
    np.testing.assert_array_equal(read.down, made.down)
    with pytest.raises(ValueError, match="read-only"):
        read.up[0] = 1


ONE = np.ones((2, 1, 3))


@pytest.mark.parametrize(
    ("up", "down", "message"),
    [
        (ONE, ONE[:1], r"reactions of shapes \(2, 1, 3\) and \(1, 1, 3\): not alike and finite"),
        (ONE, ONE * np.nan, "not alike and finite"),
        (ONE * np.inf, ONE, "not alike and finite"),
        (ONE[0], ONE[0], "up has shape"),
        (ONE, ONE[0], "down has shape"),
    ],
)
def test_reactions_that_are_none_are_refused(up: Array, down: Array, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Reactions(up, down)


SAVED = Reactions(ONE, -ONE).to_dict()
DAMAGED: dict[str, Any] = {
    "nothing": {},
    "a list": [],
    "no value": None,
    "no up": {"down": SAVED["down"]},
    "no down": {"up": SAVED["up"]},
    "words": SAVED | {"up": "up"},
    "null": SAVED | {"up": [[[None]]]},
    "of other lengths": SAVED | {"up": [[[1.0], [1.0, 2.0]]]},
    "of other shapes": SAVED | {"down": ONE[:1].tolist()},
    "too large": SAVED | {"up": [[[10**400]]]},
}


@pytest.mark.parametrize("how", DAMAGED)
def test_damaged_reactions_are_refused(how: str) -> None:
    with pytest.raises(
        ValueError, match=r"the reactions are damaged|has shape|not alike|could not convert|inhomogeneous"
    ):
        Reactions.from_dict(DAMAGED[how])


# ---- logs


def meant(interpretation: Interpretation, towards: Array = RIGHT) -> tuple[float, Meaning]:
    """Which way the only axis points, and what is known of it."""
    assert interpretation.axes.shape == (len(towards), 1)
    [meaning] = interpretation.meanings
    return float(np.sign(interpretation.axes[:, 0] @ towards)), meaning


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
def test_what_ends_a_correction_is_what_it_asks_for_whoever_hears_it(agent: Agent) -> None:
    way, meaning = meant(interpret(fly(agent), 5))
    assert (way, meaning.negative, meaning.positive) == (1, True, True)
    assert meaning.reason == f"from {ENDS}"
    assert meaning.episodes == 40
    instruction = {one.source: one.sign for one in meaning.evidence}
    assert instruction == {"best": {obeys: 1, ignores: 0, opposes: -1}[agent], "satisfaction": 1}


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
def test_so_it_is_in_other_coordinates(agent: Agent) -> None:
    chance = np.random.default_rng(0)
    mixing = chance.normal(size=(2, 2)) * 10.0 ** chance.uniform(-2, 2, 2)
    episodes = seen_as(fly(agent, episodes=20), mixing, chance.normal(size=2))
    way, meaning = meant(interpret(episodes, 5), RIGHT @ mixing)
    assert (way, meaning.known) == (1, True)


def test_an_agent_that_does_the_opposite_contradicts() -> None:
    """As its reactions show, and those who are paid for it."""
    against = reactions([[-1, 0]], [[1, 0]])
    assert meant(interpret(fly(ignores), 5, reactions=against))[1].reason == OPPOSITE
    way, meaning = meant(interpret(fly(obeys, pays=1.0), 5, reactions=against))
    assert (way, meaning.known, meaning.reason) == (1, True, f"from {ENDS} and {PAYS}")


@pytest.mark.parametrize(("agent", "way"), [(obeys, 1), (opposes, -1)])
def test_of_a_plan_the_answer_of_the_agent_is_taken_for_obedience(agent: Agent, way: int) -> None:
    found, meaning = meant(interpret(fly(agent, planned), 5))
    assert (found, meaning.known, meaning.reason) == (way, True, f"from {LISTENS}")
    assert [one.effect > 0 for one in meaning.evidence] == [True, True]  # along the axis as it is told


def test_of_a_plan_that_nobody_follows_nothing_is_known() -> None:
    _, meaning = meant(interpret(fly(ignores, planned), 5))
    assert (meaning.known, meaning.reason) == (False, NOTHING)


def test_a_plan_is_followed_as_the_agent_reacts_if_it_was_asked() -> None:
    """Not as the log looks: nobody follows it there."""
    episodes = fly(opposes, planned)
    way, meaning = meant(interpret(episodes, 5, reactions=reactions([[1, 0.1]], [[-1, -0.1]])))
    assert (way, meaning.known) == (1, True)


@pytest.mark.parametrize(
    ("pays", "asked", "reason"),
    [
        (1.0, True, f"from {LISTENS} and {PAYS}"),
        (0.0, True, f"the only evidence is {LISTENS}"),
        (1.0, False, f"the only evidence is {PAYS}"),
        (0.0, False, NOTHING),
    ],
)
def test_of_a_speed_nothing_ends_the_words(pays: float, asked: bool, reason: str) -> None:
    """Every speed falls by itself, so it is not asked what ends them."""
    obedient = reactions([[1, 0.2]], [[-1, -0.2]]) if asked else None
    episodes = [_paid_for_speed(one, pays) for one in fly(ignores, speed_up)]
    way, meaning = meant(interpret(episodes, 5, reactions=obedient), np.array([0, 1.0]))
    assert (way, meaning.known, meaning.reason) == (1, reason.startswith("from"), reason)
    assert "satisfaction" not in {one.source for one in meaning.evidence}


def _paid_for_speed(one: Episode, much: float) -> Episode:
    return replace(one, rewards=much * one.instructions[:, 0] * np.diff(one.states[:, 1]))


def with_the_speed(state: Array, _step: int, _episode: int) -> float:
    return float(np.sign(state[1]))


def test_words_that_follow_a_speed_may_be_about_where_it_leads() -> None:
    """Told to the right while it goes there; told so it gets farther to the right, and not faster."""
    episodes = fly(ignores, with_the_speed, pays=1.0)
    found = interpret(episodes, 5, reactions=reactions([[1, 0]], [[-1, 0]]))
    way, meaning = meant(found)
    assert (way, meaning.known, meaning.reason) == (1, True, f"from {LISTENS} and {PAYS}")
    place, speed = found.axes[:, 0]
    assert abs(speed) < place  # a speed is ten times smaller than a place
    assert all(one.sign == 1 for one in meaning.evidence)


# ---- what cannot be known


@pytest.mark.parametrize("only", [1.0, -0.5, 0.0])
def test_one_word_alone_has_no_meaning(only: float) -> None:
    found = interpret(fly(ignores, lambda *_: only), 5)
    assert not found.axes.any()
    assert found.meanings == (Meaning.unknown(f"the instructor has only ever said {only:g}", 40),)


def test_silence_has_no_meaning() -> None:
    silent = [replace(one, given=np.zeros(STEPS, bool)) for one in fly(ignores)]
    found = interpret(silent, 5)
    assert not found.axes.any()
    assert found.meanings == (Meaning.unknown("the instructor never said anything", 40),)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_only_the_words_that_were_said_are_known(side: float) -> None:
    def one_sided(state: Array, _step: int, _episode: int) -> float:
        return float(side * (side * state[0] < -0.5))

    way, meaning = meant(interpret(fly(ignores, one_sided), 5))
    assert (way, meaning.positive, meaning.negative) == (1, side > 0, side < 0)


@pytest.mark.parametrize(("times", "known"), [(19, False), (20, True)])
def test_a_word_that_was_hardly_said_is_not_known(times: int, known: bool) -> None:
    left = 0

    def hardly_right(state: Array, step: int, episode: int) -> float:
        nonlocal left
        instruction = to_the_middle(state, step, episode)
        left += instruction > 0
        return instruction if instruction < 0 or left <= times else 0.0

    _, meaning = meant(interpret(fly(ignores, hardly_right), 5))
    assert (meaning.positive, meaning.negative) == (known, True)


def test_words_about_what_does_not_count_have_no_meaning() -> None:
    beside = [
        replace(one, states=np.column_stack([one.states, np.random.default_rng(0).normal(size=STEPS + 1)]))
        for one in fly()
    ]
    found = interpret(beside, 5, dimensions=[2])
    assert not found.axes.any()
    assert found.meanings == (Meaning.unknown("no movement goes with the instruction", 40),)
    counts = interpret(beside, 5, dimensions=[0])
    assert counts.axes[0, 0] > 0
    assert not counts.axes[1:].any()
    assert counts.meanings[0].known


def test_too_short_a_log_of_a_plan_has_no_axis() -> None:
    found = interpret(fly(obeys, planned, episodes=4, steps=8), 2)
    assert not found.axes.any()
    assert not found.meanings[0].known


@pytest.mark.parametrize("rule", [to_the_middle, planned])
def test_seven_episodes_tell_nothing(rule: Rule) -> None:
    _, meaning = meant(interpret(fly(obeys, rule, episodes=7, pays=1.0), 5))
    assert (meaning.known, meaning.evidence, meaning.episodes) == (False, (), 7)


def test_without_episodes_nothing_is_interpreted() -> None:
    with pytest.raises(ValueError, match="needs at least one episode"):
        interpret([], 5)


# ---- settings


def two_at_once(one: Agent, other: Agent) -> list[Episode]:
    """Two points beside each other, the second one told by the second number, the other way round."""
    pairs = zip(fly(one, episodes=25), fly(other, episodes=25, seed=1), strict=True)
    return [
        replace(
            first,
            states=np.column_stack([first.states, second.states]),
            instructions=np.column_stack([first.instructions, -second.instructions]),
        )
        for first, second in pairs
    ]


def test_each_number_has_its_own_meaning() -> None:
    responses = np.zeros((2, 12, 2, 4))
    responses[:, :, 0, 0] = np.array([1, -1])[:, None]  # obeys the first number
    responses[:, :, 1, 2] = np.array([1, -1])[:, None]  # instructed +1, which asks to the left, it goes to the right
    found = interpret(two_at_once(ignores, ignores), 5, reactions=Reactions(*responses))
    first, second = found.axes.T
    assert first[0] > 5 * abs(first[2])
    assert -second[2] > 5 * abs(second[0])
    assert [one.known for one in found.meanings] == [True, False]
    assert found.meanings[1].reason == OPPOSITE


def test_the_best_are_as_many_as_asked_for() -> None:
    """A quarter obeys and earns."""
    episodes = [*fly(obeys, per_step=1.0)[:10], *fly(opposes)[10:]]

    def effect(top_fraction: float) -> float:
        [meaning] = interpret(episodes, 5, top_fraction=top_fraction).meanings
        return {one.source: one.effect for one in meaning.evidence}["best"]

    assert effect(0.25) > 0.5
    assert effect(1.0) < 0


@pytest.mark.parametrize("rule", [to_the_middle, planned, speed_up])
def test_the_same_seed_gives_the_same(rule: Rule) -> None:
    one, other = (interpret(fly(obeys, rule, pays=1.0), 5, seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.axes, other.axes)
    assert one.meanings == other.meanings
