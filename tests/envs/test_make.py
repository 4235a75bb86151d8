"""The batched environment says what the games below it said: nothing lost, nothing made up."""

from itertools import count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.envs.box2d.lunar_lander import heuristic
from tensordict import TensorDictBase
from torchrl.envs.utils import check_env_specs, step_mdp

from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.instructed_envs import TRAINING_SEEDS, episode_seed, make_vector_env
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.types import Array, ConfigError, observe

ROWS, STEPS, SEED = 3, 500, 110


def make(kind: str = "oracle", rows: int = ROWS, **kwargs: Any) -> Any:
    return make_vector_env(
        [make_gym(LANDER_ID, kwargs) for _ in range(rows)], make_instructor(InstructorConfig(kind), LANDER_TASK), SEED
    )


def pilot(tensordict: TensorDictBase) -> TensorDictBase:
    """Lands some, and lets every second row fall now and then, so that rows end at different times."""
    states = tensordict["state"].numpy().copy()
    states[:, 0] -= states[:, 8]
    game = SimpleNamespace(unwrapped=SimpleNamespace(continuous=False))
    actions = [heuristic(game, state) if row != 1 else 0 for row, state in enumerate(states)]
    return tensordict.set("action", torch.tensor(actions))


@pytest.fixture(scope="module")
def rolled_out() -> TensorDictBase:
    return make().rollout(STEPS, pilot, break_when_any_done=False)


def test_torchrls_checker_passes():
    torch.manual_seed(0)
    check_env_specs(make())


def test_every_row_equals_the_game_played_alone(rolled_out: TensorDictBase):
    """Also the last state of an episode, which is neither zeros nor the first one of the next."""
    for row in range(ROWS):
        game, begun = make_gym(LANDER_ID, {}), count()
        state, _ = game.reset(seed=episode_seed(SEED + row, next(begun)))
        for t in range(STEPS):
            step = rolled_out[row, t]
            np.testing.assert_array_equal(step["state"], state)
            state, reward, terminated, truncated, info = game.step(int(step["action"]))
            after = step["next"]
            np.testing.assert_array_equal(after["state"], state)
            assert after["reward"].item() == np.float32(reward)
            ends = (
                after["terminated"].item(),
                after["truncated"].item(),
                after["done"].item(),
                after["success"].item(),
            )
            assert ends == (terminated, truncated, terminated or truncated, info["landed"])
            if terminated or truncated:
                state, _ = game.reset(seed=episode_seed(SEED + row, next(begun)))


def test_a_step_begins_where_the_one_before_ended(rolled_out: TensorDictBase):
    done = rolled_out["next", "done"][:, :-1, 0]
    assert done.sum(dim=1).min() > 0  # every row
    for key in ("state", "instruction", "instruction_given", "observation"):
        root, after = rolled_out[key][:, 1:], rolled_out["next", key][:, :-1]
        assert torch.equal(root[~done], after[~done])
    assert not (rolled_out["state"][:, 1:] == rolled_out["next", "state"][:, :-1])[done].all(dim=-1).any()
    assert (rolled_out["next", "state"][:, :-1][done][:, 1] < 0.5).all()  # ended on the ground
    assert (rolled_out["state"][:, 1:][done][:, 1] > 1.0).all()  # began in the sky


def test_some_rows_land_and_some_crash(rolled_out: TensorDictBase):
    """Otherwise the tests above would show less than they say."""
    done = rolled_out["next", "done"].squeeze(-1)
    assert rolled_out["next", "success"][done].any()
    assert not rolled_out["next", "success"][done].all()
    assert not rolled_out["next", "success"][~done].any()
    assert (done.sum(dim=0) == 1).any()  # a partial reset


def test_the_instruction_is_the_rule_of_its_own_state(rolled_out: TensorDictBase):
    for part in (rolled_out, rolled_out["next"]):
        np.testing.assert_array_equal(part["instruction"], LANDER_TASK.rule(part["state"].numpy()))
        assert (part["instruction_given"] == 1).all()
    assert set(rolled_out["instruction"].unique().tolist()) == {-1.0, 0.0, 1.0}


@pytest.mark.parametrize("kind", ["oracle", "silent"])
def test_the_policy_reads_state_instruction_given(kind: str):
    torch.manual_seed(0)
    data = make(kind).rollout(80, break_when_any_done=False)
    for part in (data, data["next"]):
        expected = observe(*(part[key].numpy() for key in ("state", "instruction", "instruction_given")))
        np.testing.assert_array_equal(part["observation"], expected)
        assert part["observation"].shape[-1] == LANDER_TASK.observation_size


def test_a_silent_instructor_is_seen_as_silence():
    torch.manual_seed(0)
    data = make("silent").rollout(120, break_when_any_done=False)
    assert data["next", "done"].any()
    for part in (data, data["next"]):
        assert not part["instruction"].any()
        assert not part["instruction_given"].any()


class Noting:
    """Says how often each row was reset, and notes what it was called with."""

    def __init__(self) -> None:
        self.resets: list[Array] = []
        self.asked: list[Array] = []

    def reset(self, rows: Array) -> None:
        self.resets.append(rows.copy())

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        self.asked.append(rows.copy())
        count = np.sum(self.resets, axis=0, dtype=np.float32)[:, None] / 10
        return count.astype(np.float32), np.ones((len(states), 1), np.float32)


def test_the_instructor_is_reset_in_the_rows_that_are_reset():
    instructor = Noting()
    env = make_vector_env([make_gym(LANDER_ID, {}) for _ in range(ROWS)], instructor, SEED)
    instructor.resets.clear()
    torch.manual_seed(0)
    data = env.rollout(200, break_when_any_done=False)
    done = data["next", "done"][:, :-1, 0]
    ended = [done[:, t].numpy() for t in range(199) if done[:, t].any()]
    np.testing.assert_array_equal(instructor.resets, [np.ones(ROWS, bool), *ended])
    episodes = 1 + torch.cat([torch.zeros(ROWS, 1), done.cumsum(dim=1)], dim=1)
    torch.testing.assert_close(data["instruction"][..., 0], episodes / 10)


def test_each_row_is_asked_once_for_each_of_its_steps():
    """Neither again because another row is reset, nor where the game is over."""
    instructor = Noting()
    env = make_vector_env([make_gym(LANDER_ID, {}) for _ in range(ROWS)], instructor, SEED)
    torch.manual_seed(0)
    data = env.rollout(200, break_when_any_done=False)
    over = int(data["next", "terminated"][:, -1].sum())
    assert data["next", "terminated"][:, :-1].any()
    assert np.sum(instructor.asked) == 200 * ROWS + ROWS - over


def test_a_step_leaves_what_was_returned_before_alone():
    env = make()
    torch.manual_seed(0)
    root, kept = env.reset(), []
    for _ in range(10):
        kept.append((root, root.clone()))
        stepped = env.step(env.rand_action(root.clone(recurse=False)))
        for key in ("state", "observation", "instruction"):
            assert stepped[key].data_ptr() != stepped["next", key].data_ptr()
        root = step_mdp(stepped)
    for returned, copy in kept:
        assert (returned == copy).all()


def test_the_same_seed_rolls_out_the_same():
    def fly() -> TensorDictBase:
        torch.manual_seed(0)
        return make().rollout(100, break_when_any_done=False)

    assert (fly() == fly()).all()


def test_every_episode_has_a_seed_of_its_own_below_those_of_evaluations():
    seeds = [episode_seed(row, number) for row in (*range(20), 99_999_999) for number in range(200)]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < TRAINING_SEEDS for seed in seeds)
    assert episode_seed(3, 5) == episode_seed(3, 5)


STOP = 130
"""Steps of ``rolled_out`` after which it is taken up again."""


def standing(rolled_out: TensorDictBase) -> list[PartialEpisode]:
    """Where the rows stood after ``STOP`` steps."""
    found = []
    for row in range(ROWS):
        ends = rolled_out["next", "done"][row, :STOP, 0].nonzero().flatten().tolist()
        begin = ends[-1] + 1 if ends else 0
        state = rolled_out["next", "state"][row, STOP - 1].numpy() if begin < STOP else None
        found.append(PartialEpisode(len(ends), rolled_out["action"][row, begin:STOP].numpy(), state))
    return found


def take_up(rows: list[PartialEpisode], instructor: Any = None) -> Any:
    instructor = instructor or make_instructor(InstructorConfig(), LANDER_TASK)
    return make_vector_env([make_gym(LANDER_ID, {}) for _ in range(ROWS)], instructor, SEED, rows)


def test_episodes_under_way_go_on_to_the_last_bit(rolled_out: TensorDictBase):
    rows = standing(rolled_out)
    assert any(one.ended for one in rows)
    assert all(len(one.actions) > 10 for one in rows)
    again, whole = take_up(rows).rollout(300, pilot, break_when_any_done=False), rolled_out[:, STOP : STOP + 300]
    assert whole["next", "done"].any()
    for name in ("state", "action", "instruction", ("next", "reward"), ("next", "done"), ("next", "state")):
        assert torch.equal(again[name], whole[name]), name


def test_episodes_under_way_with_continuous_actions_go_on_to_the_last_bit():
    def acting(actions: torch.Tensor) -> Any:
        """Do these ``(N, T, 2)``, one step after the other."""
        left = iter(actions.unbind(1))

        def act(tensordict: TensorDictBase) -> TensorDictBase:
            return tensordict.set("action", next(left))

        return act

    drawn = 2 * torch.rand(2, 160, 2, generator=torch.Generator().manual_seed(1)) - 1
    whole = make(continuous=True, rows=2).rollout(160, acting(drawn), break_when_any_done=False)
    rows = []
    for row in whole[:, :STOP]:
        ends = [-1, *row["next", "done"][:, 0].nonzero().flatten().tolist()]
        rows.append(
            PartialEpisode(len(ends) - 1, row["action"][ends[-1] + 1 :].numpy(), row["next", "state"][-1].numpy())
        )
    assert all(len(one.actions) for one in rows)
    games = [make_gym(LANDER_ID, {"continuous": True}) for _ in rows]
    again = make_vector_env(games, make_instructor(InstructorConfig(), LANDER_TASK), SEED, rows)
    data = again.rollout(160 - STOP, acting(drawn[:, STOP:]), break_when_any_done=False)
    for name in ("state", "instruction", ("next", "reward"), ("next", "done"), ("next", "state")):
        assert torch.equal(data[name], whole[name][:, STOP:]), name


def test_a_row_between_two_episodes_begins_its_next_one(rolled_out: TensorDictBase):
    rows = [PartialEpisode(7, np.zeros(0, np.int64), None), *standing(rolled_out)[1:]]
    state = make_gym(LANDER_ID, {}).reset(seed=episode_seed(SEED, 7))[0]
    states = take_up(rows).reset()["state"]
    np.testing.assert_array_equal(states[0], state)
    assert torch.equal(states[1:], rolled_out["state"][1:, STOP])


@pytest.mark.parametrize("actions", [[0, 1, 2], [0] * 600])
def test_an_episode_that_comes_out_otherwise_is_left_and_the_next_one_begun(
    rolled_out: TensorDictBase, actions: list[int]
):
    """Another machine or library may calculate otherwise: then the state is another one, or the game is over."""
    rows = [PartialEpisode(2, np.array(actions), np.ones(9, np.float32)), *standing(rolled_out)[1:]]
    instructor = Noting()
    state = make_gym(LANDER_ID, {}).reset(seed=episode_seed(SEED, 3))[0]
    np.testing.assert_array_equal(take_up(rows, instructor).reset()["state"][0], state)
    np.testing.assert_array_equal(instructor.resets, [[True] * ROWS, [True, False, False]])
    assert np.sum(instructor.asked, axis=0)[1:].tolist() == [len(one.actions) + 1 for one in rows[1:]]


def test_arguments_reach_the_environment():
    data = make(pad="left", rows=4).rollout(2)
    assert (data["state"][..., 8] == np.float32(-0.6)).all()


def test_continuous_engines_take_a_row_of_numbers_each():
    torch.manual_seed(0)
    check_env_specs(make(continuous=True, rows=2))
    data = make(continuous=True, rows=2).rollout(5)
    assert data["action"].shape == (2, 5, 2)
    for row in range(2):
        game = make_gym(LANDER_ID, {"continuous": True})
        game.reset(seed=episode_seed(SEED + row, 0))
        for step in data[row]:
            state, *_ = game.step(step["action"].numpy())
            np.testing.assert_array_equal(step["next", "state"], state)


def test_make_gym_makes_one_with_its_time_limit():
    env = make_gym(LANDER_ID, {"pad": "right"})
    assert env.spec is not None
    assert env.spec.max_episode_steps == task_of(env).max_episode_steps == 1000
    assert env.reset(seed=0)[0][8] == np.float32(0.6)


def test_an_unknown_environment_is_refused():
    with pytest.raises(ConfigError, match=rf"env\.id=Moon-v7: not registered .* {LANDER_ID}"):
        make_gym("Moon-v7", {})


def test_an_environment_without_a_task_is_refused():
    with pytest.raises(ConfigError, match=r"env\.id=LunarLander-v3: it declares no task"):
        make_gym("LunarLander-v3", {})


@pytest.mark.parametrize("kwargs", [{"pad": "up"}, {"fuel": 3}, {"gravity": 5.0}])
def test_arguments_that_cannot_work_are_refused(kwargs: dict[str, Any]):
    with pytest.raises(ConfigError, match=rf"env\.kwargs=.*{next(iter(kwargs))}"):
        make_gym(LANDER_ID, kwargs)
