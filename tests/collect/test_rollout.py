"""Whole episodes, one for each seed, however many are rolled out at once."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.collect.rollout import moments_at, play, record_rollout, rollouts_with_moments
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.instructors import make_instructor
from ibe_rl.task import Phrases, Task
from ibe_rl.types import Array, Episode


def make(count: int) -> list[Any]:
    return [make_gym(LANDER_ID, {}) for _ in range(count)]


def swing(observations: Array) -> Array:
    """A policy of its own, for crashes at different times: against the tilt, now and then the main engine."""
    side = np.where(observations[:, 4] > 0, 3, 1)
    return np.where((observations[:, 3] < -0.6) & (observations[:, 0] > -0.1), 2, side)


def fly(seeds: list[int], at_once: int) -> list[Episode]:
    return play(make(at_once), swing, make_instructor(InstructorConfig("oracle"), LANDER_TASK), seeds)


def assert_same(one: Episode, other: Episode) -> None:
    for name in ("states", "actions", "rewards", "instructions", "given"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.terminated, one.success, one.context) == (other.terminated, other.success, other.context)


@pytest.mark.parametrize("at_once", [1, 3, 20])
def test_the_same_seeds_fly_the_same_whatever_the_number_at_once(at_once: int):
    seeds = [7, 3, 11, 3, 0, 5, 8]
    together = fly(seeds, at_once)
    assert len(together) == 7
    assert len({len(episode) for episode in together}) > 3
    for seed, episode in zip(seeds, together, strict=True):
        assert_same(episode, fly([seed], 1)[0])


def test_an_episode_is_what_the_environment_said():
    [episode] = fly([7], 1)
    env = make(1)[0]
    state, _ = env.reset(seed=7)
    for t, action in enumerate(episode.actions):
        np.testing.assert_array_equal(episode.states[t], state)
        state, reward, terminated, truncated, info = env.step(action)
        assert episode.rewards[t] == np.float32(reward)
        assert (terminated or truncated) == (t == len(episode) - 1)
    np.testing.assert_array_equal(episode.states[-1], state)
    assert len(episode.states) == len(episode) + 1
    assert (episode.terminated, episode.success) == (terminated, info["landed"])
    assert episode.context == env.unwrapped.pad
    np.testing.assert_array_equal(episode.instructions, LANDER_TASK.rule(episode.states[:-1]))
    assert episode.given.all()


def test_an_episode_that_is_cut_off_is_not_terminated():
    env = make_gym(LANDER_ID, {"max_episode_steps": 20})
    [episode] = play([env], swing, make_instructor(InstructorConfig("silent"), LANDER_TASK), [0])
    assert (len(episode), episode.terminated, episode.success) == (20, False, False)
    assert not episode.given.any()
    assert not episode.instructions.any()


class Row:
    """Tells each row its own number, and notes what it was called with."""

    def __init__(self) -> None:
        self.resets: list[int] = []
        self.counts: list[int] = []
        self.asked = 0

    def reset(self, rows: Array) -> None:
        assert rows.all()
        self.resets.append(len(rows))

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        self.counts.append(len(states))
        self.asked += int(rows.sum())
        return np.arange(len(states), dtype=np.float32)[:, None] / 10, np.ones((len(states), 1), np.float32)


def test_each_row_keeps_its_place_before_the_instructor():
    instructor = Row()
    episodes = play(make(3), swing, instructor, [0, 1, 2, 3, 4])
    assert instructor.resets == [3, 2]
    first, second = (max(len(episode) for episode in part) for part in (episodes[:3], episodes[3:]))
    assert instructor.counts == [3] * first + [2] * second
    assert instructor.asked == sum(len(episode) for episode in episodes)  # not those that have ended
    for row, episode in zip((0, 1, 2, 0, 1), episodes, strict=True):
        assert (episode.instructions == np.float32(row / 10)).all()


def test_the_policy_reads_what_the_instructor_said():
    seen = []

    def noting(observations: Array) -> Array:
        seen.append(observations)
        return swing(observations)

    [episode] = play(make(1), noting, make_instructor(InstructorConfig("oracle"), LANDER_TASK), [2])
    read = np.concatenate(seen)
    np.testing.assert_array_equal(read[:, :9], episode.states[:-1])
    np.testing.assert_array_equal(read[:, 9:10], episode.instructions)
    assert (read[:, 10] == 1).all()
    assert read.dtype == np.float32


@pytest.mark.parametrize("context", [None, "left", "right"])
def test_watching_an_episode_is_flying_it(context: str | None):
    watched = record_rollout(make(1)[0], swing, make_instructor(InstructorConfig("oracle"), LANDER_TASK), 7, context)
    if context is None:
        assert_same(watched.episode, fly([7], 1)[0])
    else:
        assert watched.episode.context == context


def test_a_watched_episode_has_a_moment_for_each_step_and_a_drawing_for_each_state():
    env = make(1)[0]
    watched = record_rollout(env, swing, make_instructor(InstructorConfig("oracle"), LANDER_TASK), 7, "left")
    episode, steps = watched.episode, len(watched.episode)
    assert len(watched.moments) == steps
    assert len(watched.figures) == steps + 1
    for t, moment in enumerate(watched.moments):
        np.testing.assert_array_equal(moment.state, episode.states[t])
        np.testing.assert_array_equal(moment.instruction, episode.instructions[t])
        assert moment.given is True
    snapshots = [moment.snapshot.bodies[0, 0] for moment in watched.moments]
    np.testing.assert_allclose(snapshots, 10 * (episode.states[:-1, 0] + 1), atol=1e-4)
    assert LANDER_TASK.scene_path is not None
    middles = [figure[0].points.mean(axis=0) for figure in watched.figures]
    np.testing.assert_allclose(middles, LANDER_TASK.scene_path(episode.states), atol=0.2)
    assert len(watched.background) == 3  # ground and two flags
    assert [len(shape.points) for shape in watched.figures[0]] == [len(shape.points) for shape in watched.figures[-1]]


class Counter(gymnasium.Env[Array, int]):
    """An environment that cannot be drawn: counts to three."""

    task = Task(
        name="count", state_names=("n",), state_units=("",), rule=lambda states: 0 * states, instruction_values=(0.0,),
        phrases=(Phrases("as it is", "", "", ((0.1, ""),)),), context=lambda _: "here", contexts=("here",),
        context_option="where", success_key="done", explained=(0,), explained_band=(0.5,), max_episode_steps=3,
    )  # fmt: skip

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Array, dict[str, Any]]:
        assert (seed, options) == (4, None)
        self.n = 0
        return np.zeros(1, np.float32), {}

    def step(self, _: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        self.n += 1
        return np.full(1, self.n, np.float32), 1.0, self.n == 3, False, {"done": self.n == 3}

    def snapshot(self) -> int:
        return self.n

    def restore(self, snapshot: int, noise: Any = None) -> None:
        self.n = snapshot


def test_what_cannot_be_drawn_can_be_watched():
    instructor, env = make_instructor(InstructorConfig("oracle"), Counter.task), Counter()
    watched = record_rollout(env, lambda observations: np.zeros(len(observations), int), instructor, 4)
    assert (watched.background, list(watched.figures)) == ([], [[]] * 4)
    assert [moment.snapshot for moment in watched.moments] == [0, 1, 2]
    assert watched.episode.success
    assert watched.episode.total_reward == 3


@pytest.mark.parametrize("at_once", [1, 2])
def test_moments_are_kept_with_each_episode(at_once: int):
    instructor = make_instructor(InstructorConfig("oracle"), LANDER_TASK)
    rolled_out = list(rollouts_with_moments(make(at_once), swing, instructor, [7, 3, 11]))
    for (episode, moments), alone in zip(rolled_out, fly([7, 3, 11], 1), strict=True):
        assert_same(episode, alone)
        assert len(moments) == len(episode)
        for t, moment in enumerate(moments):
            np.testing.assert_array_equal(moment.state, episode.states[t])
            np.testing.assert_array_equal(moment.instruction, episode.instructions[t])
            assert abs(moment.snapshot.bodies[0, 0] - 10 * (episode.states[t, 0] + 1)) < 1e-4


def apart(seeds: list[int], steps: list[int], at_once: int = 4) -> list[Any]:
    instructor = make_instructor(InstructorConfig("oracle"), LANDER_TASK)
    return moments_at(make(at_once), swing, instructor, seeds, steps)


def test_moments_of_several_episodes_are_those_of_playing_them():
    steps = [0, 30, 5, 30]
    for seed, step, moment in zip([7, 3, 11, 7], steps, apart([7, 3, 11, 7], steps), strict=True):
        [episode] = fly([seed], 1)
        np.testing.assert_array_equal(moment.state, episode.states[step])
        np.testing.assert_array_equal(moment.instruction, episode.instructions[step])
        assert moment.given is True
        assert abs(moment.snapshot.bodies[0, 0] - 10 * (episode.states[step, 0] + 1)) < 1e-4


def test_an_episode_that_is_over_has_no_moment():
    """The last step has one, and there is none after it."""
    [last] = [len(episode) - 1 for episode in fly([7], 1)]
    [moment, other] = apart([7, 3], [last, 2])
    np.testing.assert_array_equal(moment.state, fly([7], 1)[0].states[last])
    [only] = apart([7, 3], [last + 1, 2])
    np.testing.assert_array_equal(only.state, other.state)


def test_without_episodes_there_are_no_moments():
    assert apart([], []) == []


def test_an_environment_that_has_stopped_is_not_stepped_again():
    """Nobody goes on once all moments are taken."""
    instructor = Row()
    found = moments_at(make(3), swing, instructor, [7, 3, 11], [0, 2, 1])
    assert len(found) == 3
    assert instructor.resets == [3]
    assert instructor.counts == [3, 3, 3]
    assert instructor.asked == 1 + 3 + 2


def test_moments_of_a_game_that_cannot_be_stopped_have_no_snapshot():
    class Unstoppable(Counter):
        snapshot = property()  # it has none

    instructor = make_instructor(InstructorConfig("oracle"), Counter.task)
    stay = lambda observations: np.zeros(len(observations), int)  # noqa: E731 - a policy in a line
    [stopped] = moments_at([Counter()], stay, instructor, [4], [2])
    [other] = moments_at([Unstoppable()], stay, instructor, [4], [2])
    assert (stopped.snapshot, other.snapshot) == (2, None)
    assert stopped.state.tolist() == other.state.tolist() == [2]
