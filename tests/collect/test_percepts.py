"""Whole episodes where the agent does not perceive the state: it acts on the percept, and both are kept."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from walker import LIMIT, SIZES, walker

from ibe_rl.collect.rollout import play, record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Episode, observe, percepts_of


class Remembers:
    """A policy that walks right where its observations sum to an even number, else left, and keeps them."""

    def __init__(self) -> None:
        self.seen: list[Array] = []

    def __call__(self, observations: Array) -> Array:
        self.seen.append(observations)
        return np.where(np.floor(observations.sum(axis=1)) % 2 == 0, 2, 0)


def recorded(obs: str) -> tuple[Any, list[Array]]:
    env, policy = walker(obs), Remembers()
    return record_rollout(env, policy, make_instructor(InstructorConfig("oracle"), task_of(env)), 3), policy.seen


@pytest.mark.parametrize("obs", SIZES)
def test_the_policy_reads_the_percept_and_the_instruction(obs: str):
    watched, seen = recorded(obs)
    episode = watched.episode
    percepts = episode.states if episode.percepts is None else episode.percepts
    assert percepts.shape == (LIMIT + 1, SIZES[obs])
    assert (episode.percepts is None) == (obs in ("box", "row"))
    expected = observe(percepts[:-1], episode.instructions, episode.given[:, None])
    np.testing.assert_array_equal(np.concatenate(seen), expected)
    np.testing.assert_array_equal(percepts_of(watched.moments), percepts[:-1])


def episodes_of(obs: str) -> list[Episode]:
    envs = [walker(obs), walker(obs)]
    return play(envs, Remembers(), make_instructor(InstructorConfig("oracle"), task_of(envs[0])), range(5))


@pytest.mark.parametrize("obs", ["box", "image", "dict"])
def test_the_log_keeps_percepts_beside_states(obs: str, tmp_path: Path):
    log, episodes = TrajectoryLog(tmp_path, 10_000, ["any"]), episodes_of(obs)
    for episode in episodes:
        log.add(episode.as_steps(), lambda _: "any")
    log.flush()
    assert (tmp_path / "percept.npy").exists() == (obs != "box")
    for one in (log, TrajectoryLog.open(tmp_path)):
        for episode, plain, whole in zip(episodes, one.read(range(5)), one.read(range(5), percepts=True), strict=True):
            np.testing.assert_array_equal(whole.states, episode.states)
            assert plain.percepts is None
            if episode.percepts is None:
                assert whole.percepts is None
            else:
                assert whole.percepts is not None
                assert whole.percepts.dtype == episode.percepts.dtype
                np.testing.assert_array_equal(whole.percepts, episode.percepts)
        perceived = [each.states if each.percepts is None else each.percepts for each in episodes]
        found = one.percepts_at(np.array([4, 0]), np.array([7, 30]), 10_000)
        np.testing.assert_array_equal(found, [perceived[4][7], perceived[0][30]])
        assert len(one.percepts_at(np.array([4, 0]), np.array([7, 30]), SIZES[obs])) == 1


def test_a_log_goes_on_with_percepts_in_unfinished_episodes(tmp_path: Path):
    [episode] = episodes_of("tuple")[:1]
    steps = episode.as_steps()
    parts = [{name: column[:, cut] for name, column in steps.items()} for cut in (slice(0, 12), slice(12, None))]
    log = TrajectoryLog(tmp_path, 10_000, ["any"])
    log.add(parts[0], lambda _: "any")
    again = TrajectoryLog(tmp_path, 10_000, ["any"])
    again.load_state_dict(log.state_dict())
    again.add(parts[1], lambda _: "any")
    [whole] = again.read([0], percepts=True)
    assert whole.percepts is not None
    np.testing.assert_array_equal(whole.percepts, episode.percepts)
