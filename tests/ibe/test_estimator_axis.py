"""Spaces of instructions: movements along an axis that was hidden in the data, and what they are called."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ibe_rl.ibe import ClusterMapping, IBEMapping, TooLittleDataError
from ibe_rl.types import Array

LIKE_AXIS: dict[str, Any] = {"space": "rule", "symmetric": True, "power": 1 / 3, "normalisation": "movement"}
"""As in configs/mapping/axis.yaml."""
LENGTHS = np.array([0, 0.25, 1, 1.75])
"""Of movements, in units of what the instruction 1 typically brings about; those told to move are 1 on average."""


def heard(count: int = 1_500, seed: int = 0) -> tuple[Array, Array]:
    """States of four numbers; told 1 where the second is larger than the first, -1 where it is smaller, 0 if near."""
    states = np.random.default_rng(seed).normal(size=(count, 4))
    ahead = states[:, 1] - states[:, 0]
    return states, np.sign(ahead) * (np.abs(ahead) > 0.3)


def moved(*amounts: float) -> Array:
    """Changes ``(W, 4)``: the first number moves by so much, what happens to the others says nothing."""
    delta = np.random.default_rng(len(amounts)).normal(size=(len(amounts), 4)) * [0, 0, 3, 3]
    delta[:, 0] = amounts
    return delta


def windows(unit: float = 2.0, repeat: int = 20) -> tuple[Array, Array]:
    """Told 1, the first number falls behind: the goal is to the left.

    That is, -1 is told where it shall fall, so told 1 it rises by ``unit`` on average.
    """
    instruction = np.repeat([-1.0, -1, -1, 0, 1, 1, 1], repeat)
    lengths = np.tile(np.repeat([-1.75, -1, -0.25, 0, 0.25, 1, 1.75], repeat), 1)
    return moved(*(unit * lengths)), instruction


def fit(unit: float = 2.0, **settings: Any) -> IBEMapping:
    return IBEMapping(**({"n_clusters": 7, "random_state": 0} | LIKE_AXIS | settings)).fit(*windows(unit), *heard())


def said(mapping: ClusterMapping, *amounts: float) -> list[float]:
    found: list[float] = mapping.express(moved(*amounts))[:, 0].tolist()
    return found


def test_a_movement_is_called_by_how_far_it_goes():
    """1 is what the instruction 1 typically brought about; farther is called 1 too."""
    mapping = fit().mapping_
    expected = [-1, -1, -0.25, 0, 0.25, 1, 1]
    np.testing.assert_allclose(mapping.expressions[:, 0], expected, atol=0.03)
    assert mapping.mean_instructions[:, 0].tolist() == [-1, -1, -1, 0, 1, 1, 1]
    assert said(mapping, -40, 40) == [-1, 1]
    np.testing.assert_allclose(said(mapping, -2, -0.5, 0, 0.5, 2, 4), [-1, -0.25, 0, 0.25, 1, 1], atol=0.03)


def test_expressions_rise_with_the_movement():
    rising = said(fit().mapping_, *np.linspace(-6, 6, 201))
    assert (np.diff(rising) >= -1e-12).all()
    assert len(set(rising)) >= 5


@pytest.mark.parametrize("k", [6, 7, 8, 9])
def test_clusters_come_in_opposite_pairs(k: int):
    """Of a sample that goes right three times as often as left; an odd one is at no movement."""
    random = np.random.default_rng(0)
    amounts = np.concatenate([random.normal(2, 0.7, 600), random.normal(-2, 0.7, 200), random.normal(0, 0.2, 200)])
    instruction = np.repeat([1.0, -1, 0], [600, 200, 200])
    estimator = IBEMapping(k, **LIKE_AXIS, random_state=0).fit(moved(*amounts), instruction, *heard())
    centres, expressions = estimator.mapping_.centres[:, 0], estimator.mapping_.expressions[:, 0]
    np.testing.assert_allclose(np.sort(centres), -np.sort(centres)[::-1], atol=1e-9)
    np.testing.assert_allclose(expressions, -expressions[::-1], atol=1e-9)
    assert (np.diff(expressions) >= 0).all()
    assert abs(said(estimator.mapping_, 0)[0]) < 0.1
    assert (0 in np.round(centres, 12)) == bool(k % 2)
    lopsided = IBEMapping(k, **LIKE_AXIS | {"symmetric": False}, random_state=0).fit(
        moved(*amounts), instruction, *heard()
    )
    assert np.abs(lopsided.mapping_.expressions + lopsided.mapping_.expressions[::-1]).max() > 0.01


def test_a_thing_at_rest_is_called_so_where_nothing_ever_rested():
    """All movements are of half of what the instruction 1 brings about to one and a half times that."""
    random = np.random.default_rng(0)
    instruction = random.choice([-1.0, 1], 2_000)
    amounts = instruction * random.uniform(1, 3, 2_000)
    for power in (1 / 3, 1.0):
        settings = LIKE_AXIS | {"power": power}
        mapping = IBEMapping(8, **settings, random_state=0).fit(moved(*amounts), instruction, *heard()).mapping_
        assert np.abs(said(mapping, 0.0)).max() < 0.0501
        assert np.abs(said(mapping, -3, -1, 1, 3)).min() > 0.3
        expressions = mapping.expressions[:, 0]
        np.testing.assert_allclose(expressions, -expressions[::-1], atol=1e-9)
        again = IBEMapping(8, **settings, random_state=0, last=mapping, memory=0.5)
        assert np.abs(said(again.fit(moved(*amounts), instruction, *heard()).mapping_, 0.0)).max() < 0.0501
        plain = IBEMapping(8, **settings | {"normalisation": "sign"}, random_state=0)
        assert np.abs(plain.fit(moved(*amounts), instruction, *heard()).mapping_.centre_changes()[:, 0]).min() > 0.5


def test_roots_give_small_movements_clusters_of_their_own():
    random = np.random.default_rng(0)
    amounts = random.choice([-1, 1], 2_000) * random.exponential(size=2_000) ** 2
    instruction = np.sign(amounts)

    def second(power: float) -> float:
        """The innermost pair is at rest."""
        settings = LIKE_AXIS | {"power": power}
        mapping = IBEMapping(8, **settings, random_state=0).fit(moved(*amounts), instruction, *heard()).mapping_
        return float(np.sort(np.abs(mapping.centre_changes()[:, 0]))[2])

    assert second(1 / 3) < second(1.0) / 2


def test_the_sign_comes_from_the_windows_that_followed():
    """The best went left when told 1: then left is 1."""
    against = fit(unit=-2).mapping_
    np.testing.assert_allclose(said(against, -2, 2, 0), [1, -1, 0], atol=0.03)
    np.testing.assert_allclose(said(fit(unit=2).mapping_, -2, 2, 0), [-1, 1, 0], atol=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_movements_are_called_the_same_whatever_the_axes_of_the_state_are(seed: int):
    """Turned, mixed and rescaled all at once."""
    random = np.random.default_rng(seed)
    mixing = random.normal(size=(4, 4)) * 10.0 ** random.uniform(-2, 2, 4)
    (delta, instruction), (states, heard_instructions) = windows(), heard()
    settings = {"n_clusters": 7, "n_init": 30, "random_state": 0} | LIKE_AXIS
    mixed = IBEMapping(**settings).fit(delta @ mixing, instruction, states @ mixing, heard_instructions).mapping_
    new = moved(-4, -2, -0.5, 0, 0.5, 2, 4)
    np.testing.assert_allclose(mixed.express(new @ mixing), fit().mapping_.express(new), atol=0.05)


def test_one_axis_for_each_number_of_the_instruction():
    """The first instruction moves the first number, the second the third."""
    random = np.random.default_rng(0)
    states = random.normal(size=(2_000, 4))
    heard_instructions = np.sign(states[:, [1, 3]] - states[:, [0, 2]])
    instruction = random.choice([-1.0, 0, 1], (1_000, 2))
    delta = np.zeros((1_000, 4))
    delta[:, [0, 2]] = instruction * [2, -3] + random.normal(0, 0.05, (1_000, 2))
    settings = LIKE_AXIS | {"power": 1.0}
    mapping = IBEMapping(9, **settings, random_state=0).fit(delta, instruction, states, heard_instructions).mapping_
    assert mapping.expressions.shape == (9, 2)
    new = np.array([[2.0, 0, 3, 0], [-2, 0, 0, 0], [0, 0, -3, 0], [0, 0, 0, 0]])
    np.testing.assert_allclose(mapping.express(new), [[1, -1], [-1, 0], [0, 1], [0, 0]], atol=0.1)


def test_a_dimension_left_out_is_not_on_the_axis():
    mapping = fit(dimensions=[0, 2]).mapping_
    assert (mapping.space.weights[0][[1, 3]] == 0).all()
    np.testing.assert_allclose(said(mapping, -2, 2), [-1, 1], atol=0.05)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.99])
def test_the_same_windows_again_leave_everything_where_it_was(memory: float):
    once = fit().mapping_
    twice = fit(last=once, memory=memory).mapping_
    for name in ("centres", "mean_instructions", "expressions", "sizes", "purities", "ids", "width"):
        np.testing.assert_allclose(getattr(twice, name), getattr(once, name), atol=1e-6, err_msg=name)
    np.testing.assert_allclose(twice.space.weights[0], once.space.weights[0], atol=1e-9)
    np.testing.assert_allclose(twice.evidence, once.evidence * (1 + memory))


def test_what_a_unit_of_instruction_moves_is_remembered():
    """It was 2 and is 4 now: without memory 4, with all 140 earlier windows remembered by half a third of the way."""
    once = fit(unit=2.0).mapping_
    for memory, unit in ((0.0, 4.0), (0.5, 2 / 3 * 4 + 1 / 3 * 2)):
        again = fit(unit=4.0, last=once, memory=memory).mapping_
        np.testing.assert_allclose(again.space.place(moved(unit)), [[1]], atol=0.05)


def test_the_same_seed_learns_the_same():
    assert fit().mapping_.to_dict() == fit().mapping_.to_dict()


def test_windows_in_which_the_instruction_was_ignored_count_less():
    """Three in ten went the other way: the mean instruction of those to the right is 0.4, and nearer to 1 weighed."""
    instruction = np.tile([1.0, -1], 500)
    went = np.where(np.arange(1_000) // 2 % 10 < 3, -instruction, instruction)
    delta = moved(*(went * 2 + np.random.default_rng(0).normal(0, 0.1, 1_000)))
    learnt = {}
    for weigh in (False, True):
        settings = LIKE_AXIS | {"normalisation": "sign", "weigh_followed": weigh}
        learnt[weigh] = IBEMapping(2, **settings, random_state=0).fit(delta, instruction, *heard()).mapping_
    np.testing.assert_allclose(learnt[False].mean_instructions[:, 0], [-0.4, 0.4], atol=0.01)
    assert learnt[True].mean_instructions[0, 0] < -0.7
    assert learnt[True].mean_instructions[1, 0] > 0.7
    assert learnt[True].sizes.tolist() == learnt[False].sizes.tolist()
    assert learnt[True].evidence.sum() < learnt[False].evidence.sum() == 1_000


def test_nobody_ignored_is_left_out():
    """Each counts at least a twentieth."""
    instruction = np.repeat([1.0, -1], 50)
    delta = moved(*np.repeat([2.0, -2], 50), *np.repeat([-2.0, 2], 5))
    instruction = np.append(instruction, np.repeat([1.0, -1], 5))
    settings = LIKE_AXIS | {"weigh_followed": True}
    mapping = IBEMapping(2, **settings, random_state=0).fit(delta, instruction, *heard()).mapping_
    followed = mapping.evidence.sum() - 0.05 * 10
    assert 95 < followed <= 100


def test_a_network_without_clusters_learns_a_relation():
    random = np.random.default_rng(0)
    delta = random.normal(size=(3_000, 3)) * [1, 50, 1]
    instruction = np.sign(delta[:, 0])
    settings = {"space": "network", "membership": "direct", "normalisation": "movement"}
    mapping = IBEMapping(4, **settings, random_state=0).fit(delta, instruction).mapping_
    new = np.array([[-2.0, 30, 0], [2, -30, 0], [-2, 0, 1], [2, 0, -1]])
    np.testing.assert_allclose(mapping.express(new)[:, 0], [-1, 1, -1, 1], atol=0.15)
    rising = mapping.express(np.column_stack([np.linspace(-1, 1, 50), np.zeros((50, 2))]))[:, 0]
    assert np.diff(rising).min() > -0.05
    assert mapping.centre_changes().shape == (0, 3)
    assert np.abs(mapping.express(delta * 100)).max() <= 1


@pytest.mark.parametrize("space", ["lasso", "information"])
def test_other_spaces_find_what_the_instructions_are_about(space: str):
    """What the last two numbers do counts in the paper's space, and hardly in these."""
    delta, instruction = windows()
    mapping = IBEMapping(7, space=space, normalisation="sign", random_state=0).fit(delta, instruction).mapping_
    far = moved(4, -4) + np.array([0, 0, 5, -5])
    np.testing.assert_allclose(np.sign(mapping.express(far)[:, 0]), [1, -1])
    scale = np.linalg.norm(mapping.space.weights[0], axis=1) * delta.std(axis=0)
    assert scale[2:].max() < 0.2 * scale[0]


def test_a_soft_vocabulary_is_as_wide_as_its_clusters_are_apart():
    """Roots of 0, 0.25, 1 and 1.75 are 0, 0.63, 1 and 1.21; the nearest other is 0.21, 0.37 or 0.63 off."""
    mapping = fit(membership="soft").mapping_
    gaps = np.sort(np.diff(np.cbrt(LENGTHS)))  # 0.21, 0.37, 0.63
    assert mapping.width == pytest.approx(np.median([*gaps[[0, 0, 1]].repeat(2), gaps[2]]), abs=0.02)
    assert len(set(np.round(said(mapping, *np.linspace(-4, 4, 50)), 6))) == 50


def test_if_all_clusters_are_one_place_their_width_is_one():
    delta, instruction = windows()
    learnt = IBEMapping(7, membership="soft", random_state=0).fit(delta, instruction)
    mapping, _ = learnt._name(
        _Plain(delta, instruction), np.zeros((len(delta), 4)), np.zeros((7, 4)), learnt.mapping_.space
    )
    assert mapping.width == 1


class _Plain(SimpleNamespace):
    """Lessons that all count alike."""

    def __init__(self, delta: Array, instructions: Array):
        super().__init__(
            delta=delta, instruction=instructions[:, None], weight=np.ones(len(delta)), interpretation=None
        )


def test_the_rule_needs_to_hear_the_instructor():
    for states, instruction in ((None, None), (heard()[0], None), (None, heard()[1])):
        with pytest.raises(ValueError, match="space='rule': needs states and state_instructions"):
            IBEMapping(space="rule").fit(*windows(), states, instruction)


def test_an_instructor_who_always_says_the_same_is_too_little():
    states, _ = heard()
    with pytest.raises(TooLittleDataError, match="the instructor has only ever said 0"):
        IBEMapping(space="rule").fit(*windows(), states, np.zeros(len(states)))


def test_if_the_best_were_never_instructed_to_move_it_is_too_little():
    delta, instruction = windows()
    with pytest.raises(TooLittleDataError, match="nothing has moved under an instruction other than 0"):
        IBEMapping(space="rule").fit(delta, 0 * instruction, *heard())


def test_a_last_vocabulary_of_another_state_or_instruction_is_refused():
    last, (delta, instruction), (states, heard_instructions) = fit().mapping_, windows(), heard()
    with pytest.raises(ValueError, match=r"last\.space\.mean has shape \(4,\), expected \(3,\)"):
        IBEMapping(7, **LIKE_AXIS, last=last).fit(delta[:, :3], instruction, states[:, :3], heard_instructions)
    two = np.column_stack([instruction, instruction])
    with pytest.raises(ValueError, match=r"last has shape \(7, 1\), expected \(None, 2\)"):
        IBEMapping(7, **LIKE_AXIS, last=last).fit(
            delta, two, states, np.column_stack([heard_instructions, heard_instructions])
        )
