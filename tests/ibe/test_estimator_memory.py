"""The paper's mapping once more: from where the last one was, with what is remembered of earlier windows."""

import numpy as np
import pytest
from by_hand import on_a_line
from groups import fit, weight
from sklearn.cluster import KMeans

from ibe_rl.ibe import IBEMapping


def test_clusters_start_where_asked():
    """Six groups in a row, three clusters: k-means stays in the grouping it is started in, or finds its own."""
    delta = np.repeat([0.0, 1.0, 10.0, 11.0, 20.0, 21.0], 5)[:, None]
    instruction = np.repeat([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0], 5)
    start = on_a_line([0.0, 1.0, 15.5])  # a poor grouping that no step of k-means leaves
    learnt = IBEMapping(3, last=start, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(np.sort(learnt.centre_changes(), axis=0), start.centres, atol=1e-9)
    free = IBEMapping(3, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(np.sort(free.centre_changes(), axis=0), [[0.5], [10.5], [20.5]], atol=1e-9)


def remembering(memory: float) -> IBEMapping:
    """Ten old windows at -4 told -1 and twenty at 4 told 1; now five at -2 told 0 and ten at 6 told 1."""
    last = on_a_line([-4, 4], evidence=[10, 20])
    delta, instruction = np.repeat([-2.0, 6.0], [5, 10])[:, None], np.repeat([0.0, 1.0], [5, 10])
    return IBEMapping(2, last=last, memory=memory, random_state=0).fit(delta, instruction)


def test_earlier_windows_count_as_much_as_is_remembered_of_them():
    """At one half: five old windows with five new ones, ten with ten."""
    mapping = remembering(0.5).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-3], [5]])
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.5], [1]])
    assert mapping.evidence.tolist() == [10, 20]
    assert mapping.sizes.tolist() == [5, 10]
    assert mapping.purities.tolist() == [1, 1]  # of what is really there
    np.testing.assert_allclose(remembering(0.9).mapping_.centre_changes(), [[-4 + 2 * 5 / 14], [4 + 2 * 10 / 28]])
    np.testing.assert_allclose(remembering(0.9).mapping_.mean_instructions[0], -9 / 14)


def test_standardisation_remembers_too():
    """At one half: fifteen old windows of mean 0 and variance 1, fifteen new ones of mean 10/3 and variance 128/9."""
    mapping = remembering(0.5).mapping_
    np.testing.assert_allclose(mapping.space.mean, (0 + 10 / 3) / 2)
    np.testing.assert_allclose(weight(mapping), ((1 + 128 / 9) / 2) ** -0.5)
    more = remembering(0.9).mapping_  # 27 against 15
    np.testing.assert_allclose(more.space.mean, 15 / 42 * 10 / 3)
    np.testing.assert_allclose(weight(more), (27 / 42 * 1 + 15 / 42 * 128 / 9) ** -0.5)


def test_without_memory_the_last_vocabulary_is_a_start_only():
    mapping = remembering(0.0).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-2], [6]])
    np.testing.assert_allclose(mapping.mean_instructions, [[0], [1]])
    assert mapping.evidence.tolist() == mapping.sizes.tolist() == [5, 10]
    np.testing.assert_allclose([mapping.space.mean[0], weight(mapping)[0]], [10 / 3, (128 / 9) ** -0.5])


@pytest.mark.parametrize("seed", range(5))
def test_without_memory_it_is_k_means_from_the_last_centres(seed: int):
    random = np.random.default_rng(seed)
    earlier, delta, instruction = (
        random.normal(1, 3, (200, 2)),
        random.normal(size=(300, 2)),
        random.uniform(-1, 1, 300),
    )
    last = IBEMapping(5, random_state=0).fit(earlier, np.ones(200)).mapping_
    learnt = IBEMapping(5, last=last, random_state=0).fit(delta, instruction).mapping_
    scale = delta.std(axis=0)
    plain = KMeans(5, init=(last.centre_changes() - delta.mean(axis=0)) / scale, n_init=1)
    expected = plain.fit((delta - delta.mean(axis=0)) / scale).cluster_centers_ * scale + delta.mean(axis=0)
    found = learnt.centre_changes()
    np.testing.assert_allclose(found[np.argsort(found[:, 0])], expected[np.argsort(expected[:, 0])], atol=1e-6)


def test_evidence_fades_geometrically():
    """Four, six and two windows a refresh, half of the earlier ones remembered: n, n + n/2, n + n/2 + n/4, ..."""
    last, found = None, []
    for _ in range(6):
        last = fit(last=last, memory=0.5).mapping_
        found.append(last.evidence.tolist())
    for refresh, evidence in enumerate(found):
        np.testing.assert_allclose(evidence, np.array([4, 6, 2]) * (2 - 0.5**refresh))


def test_an_old_instruction_fades_with_it():
    """A cluster was told -1 once and 0 ever since; at one half its mean goes from -1 over -1/3 and -1/7 to 0."""
    delta, last, found = np.repeat([-4.0, 4.0], 8)[:, None], None, []
    for instruction in (-1.0, 0.0, 0.0, 0.0):
        instructions = np.repeat([instruction, 1.0], 8)
        last = IBEMapping(2, last=last, memory=0.5, random_state=0).fit(delta, instructions).mapping_
        found.append(last.mean_instructions[0, 0])
    np.testing.assert_allclose(found, [-1, -1 / 3, -1 / 7, -1 / 15])


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.99])
def test_the_same_windows_again_leave_everything_where_it_was(memory: float):
    once = fit().mapping_
    twice = fit(last=once, memory=memory).mapping_
    np.testing.assert_allclose(twice.space.mean, once.space.mean, atol=1e-9)
    np.testing.assert_allclose(weight(twice), weight(once), atol=1e-9)
    for name in ("centres", "mean_instructions", "expressions", "sizes", "purities", "ids", "width"):
        np.testing.assert_allclose(getattr(twice, name), getattr(once, name), atol=1e-9, err_msg=name)
    np.testing.assert_allclose(twice.evidence, once.evidence * (1 + memory))


def test_clusters_that_became_one_remember_together():
    """Those at 3 and 5 end up in one; the third goes where the new windows are."""
    last = on_a_line([-4, 3, 5], [-1, 0, 1], evidence=[10, 10, 20])
    delta, instruction = np.repeat([-4.0, 3.5, 20.0], 100)[:, None], np.repeat([-1.0, 0.5, 1.0], 100)
    mapping = IBEMapping(3, last=last, memory=0.1, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(mapping.evidence, [101, 103, 100])
    np.testing.assert_allclose(mapping.centre_changes()[:, 0], [-4, (350 + 3 + 2 * 5) / 103, 20])
    np.testing.assert_allclose(mapping.mean_instructions[:, 0], [-1, (50 + 0 + 2 * 1) / 103, 1])


def test_a_cluster_without_a_new_window_lives_on_what_is_remembered():
    last = on_a_line([-4, 0, 30], [-1, 0, 0.5], evidence=[10, 10, 10])
    delta, instruction = np.array([[-4.0], [-4.1], [0.0], [0.1]]), np.array([-1.0, -1, 1, 1])
    mapping = IBEMapping(3, last=last, memory=0.9, random_state=0).fit(delta, instruction).mapping_
    assert mapping.sizes.tolist() == [2, 2, 0]
    assert mapping.evidence.tolist() == [11, 11, 9]
    np.testing.assert_allclose(mapping.mean_instructions, [[-1], [2 / 11], [0.5]])
    assert mapping.purities.tolist() == [1, 1, 0]


def test_windows_that_are_drawn_stand_for_all_of_them_against_memory():
    """2,000 new windows each side, half of them clustered, against 2,000 remembered: the centre is in the middle."""
    last = on_a_line([-4, 4], evidence=[4_000, 4_000])
    delta = np.repeat([-2.0, 6.0], 2_000)[:, None]
    settings = {"last": last, "memory": 0.5, "max_fit_windows": 2_000, "random_state": 0}
    mapping = IBEMapping(2, **settings).fit(delta, np.repeat([-1.0, 1.0], 2_000)).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-3], [5]], atol=0.05)
    assert mapping.evidence.tolist() == [4_000, 4_000]


def test_a_dimension_left_out_stays_left_out():
    once = fit(n_clusters=2, dimensions=[0]).mapping_
    twice = fit(n_clusters=2, dimensions=[0], last=once, memory=0.75).mapping_
    assert (weight(twice) > 0).tolist() == [True, False]
    np.testing.assert_allclose(weight(twice), weight(once))
    np.testing.assert_allclose(twice.space.mean, once.space.mean)


@pytest.mark.parametrize("memory", [-0.01, 1.0, 2.0, float("nan")])
def test_a_memory_outside_its_limits_is_refused(memory: float):
    with pytest.raises(ValueError, match=f"memory={memory}: at least 0 and below 1"):
        fit(memory=memory)


def test_a_last_vocabulary_with_fewer_clusters_is_remembered_but_no_start():
    """There were two places, now there are three: ten old windows at -4 count as five."""
    last = on_a_line([-4, 4], [-1, 1], evidence=[10, 10])
    delta, instruction = np.repeat([-4.0, 0.0, 4.0], 5)[:, None], np.repeat([-1.0, 0.0, 1.0], 5)
    learnt = IBEMapping(3, last=last, memory=0.5, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(learnt.centre_changes(), [[-4], [0], [4]], atol=1e-9)
    assert learnt.evidence.tolist() == [10, 5, 10]


def test_a_last_vocabulary_of_another_state_is_refused():
    for dimensions in (1, 3):  # numpy would stretch one to all, and refuse three in words of its own
        delta = np.random.default_rng(0).normal(size=(20, dimensions))
        last = IBEMapping(3, random_state=0).fit(delta, np.zeros(20)).mapping_
        with pytest.raises(ValueError, match=rf"last has shape \(3, {dimensions}\), expected \(None, 2\)"):
            fit(last=last)
