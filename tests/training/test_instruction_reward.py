"""Extra reward for following the instruction: by hand, and against the definition step by step."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from by_hand import TASK, WORDS, config, obey, stay
from tensordict import TensorDict, TensorDictBase

from ibe_rl.agents import Agent, make_agent
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import InstructorConfig, ObedienceConfig, TrainConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.instructed_envs import make_vector_env
from ibe_rl.envs.make import make_gym
from ibe_rl.ibe.delay import Delay
from ibe_rl.instructors import make_instructor
from ibe_rl.instructors.taught import told_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.log_columns import TOLD_COLUMN, TOLD_SIZE
from ibe_rl.task import Task
from ibe_rl.training.instruction_reward import (
    InstructionReward,
    Judge,
    check_instruction_reward,
    make_instruction_reward,
    meant,
)
from ibe_rl.types import Array, ConfigError
from ibe_rl.vocabulary.tracker import VocabularyTracker
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR, TEACHER, Delays

ORACLE = ObedienceConfig(judge="oracle", weight=0.5, until_frames=1_000, absorbing=False)


def made(cfg: TrainConfig, development: VocabularyTracker, task: Task = TASK) -> InstructionReward:
    return make_instruction_reward(
        cfg, task, lambda: development.horizons_steps, development.mapping_of, lambda: development.delays
    )


def way(delta: Array) -> Array:
    """What a change means: the way the first number went."""
    return np.sign(delta[:, :1])


def row(
    state: Sequence[float], after: Sequence[float], instructions: Sequence[float | None], done: str = ""
) -> TensorDict:
    """One environment ``[1, T]`` whose state is one number; None is silence, "x" marks an end."""
    steps = len(state)

    def numbers(values: Sequence[float]) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32).reshape(1, steps, 1)

    ends = torch.tensor([mark == "x" for mark in done.ljust(steps)]).reshape(1, steps, 1)
    after_it = TensorDict({"state": numbers(after), "done": ends}, [1, steps])
    given = numbers([float(one is not None) for one in instructions])
    instruction = numbers([one or 0.0 for one in instructions])
    inside = {"state": numbers(state), "instruction": instruction, "instruction_given": given, "next": after_it}
    return TensorDict(inside, [1, steps])


def climbing(instruction: Sequence[float | None], done: str = "", start: float = 0.0) -> TensorDict:
    """One up at each step."""
    places = start + np.arange(len(instruction) + 1)
    return row(places[:-1].tolist(), places[1:].tolist(), instruction, done)


def judged(obedience: InstructionReward, batch: TensorDictBase, frames: int = 0) -> list[float]:
    """What is added to the reward of the first row."""
    obedience.add(batch, frames)
    extra = batch["next", "extra_reward"]
    assert (extra.shape, extra.dtype) == ((*batch.shape, 1), torch.float32)
    return [float(one) for one in extra[0, :, 0]]


def make(horizon_steps: int = 2, judge: Callable[[], Judge | None] = lambda: way) -> InstructionReward:
    return InstructionReward(ORACLE, lambda: horizon_steps, judge)


def test_the_step_that_ends_a_window_gets_what_its_beginning_was_instructed():
    """Told up and gone up: all of the weight. Told nothing to do: none of it. Told down: minus as much."""
    batch = climbing([1, 1, -1, -1, 0, 1])
    found = make().add(batch, 0)
    assert batch["next", "extra_reward"][0, :, 0].tolist() == [0, 0.5, 0.5, -0.5, -0.5, 0]
    assert found == {"obeyed": 0.0, "extra_reward": 0.0}
    found = make().add(climbing([1, 0, 0]), 0)
    assert found == {"obeyed": 0.5, "extra_reward": pytest.approx(0.5 / 3)}


def test_what_is_said_later_does_not_count():
    for later in (1.0, -1.0, None):
        assert judged(make(3), climbing([1, later, later]))[2] == 0.5


def test_over_one_step_each_step_is_judged_by_itself():
    assert judged(make(1), climbing([1, -1, None, 0])) == [0.5, -0.5, 0, 0]


def test_windows_go_on_across_batches():
    obedience = make(3)
    assert judged(obedience, climbing([1, -1])) == [0, 0]
    assert judged(obedience, climbing([0, 1], start=2)) == [0.5, -0.5]
    assert judged(obedience, climbing([1], start=4)) == [0]  # told 0
    assert judged(obedience, climbing([1, 1, 1, 1], start=5)) == [0.5] * 4


def test_windows_do_not_go_on_across_ends():
    """A window may reach to an end; those of the next episode begin in it."""
    assert judged(make(), climbing([1, 1, 1, 1, 1], done="  x")) == [0, 0.5, 0.5, 0, 0.5]
    obedience = make()
    assert judged(obedience, climbing([1, 1], done=" x")) == [0, 0.5]
    assert judged(obedience, climbing([1, 1])) == [0, 0.5]


def test_the_last_state_of_an_episode_is_its_own():
    """Not the first of the next, which is where the batch goes on."""
    batch = row([0, 1, -7, -6], [1, 2, -6, -5], [1, 1, 1, 1], " x")
    assert judged(make(), batch) == [0, 0.5, 0, 0.5]


def test_what_began_in_silence_is_not_judged():
    batch = climbing([None, 1, None, 1])
    assert make().add(batch, 0) == {"obeyed": 1.0, "extra_reward": 0.125}
    assert batch["next", "extra_reward"][0, :, 0].tolist() == [0, 0, 0.5, 0]
    found = make().add(climbing([None] * 4), 0)
    assert np.isnan(found["obeyed"])
    assert found["extra_reward"] == 0


def test_the_weight_falls_to_nothing():
    batch, calls = climbing([1, 1]), []
    obedience = InstructionReward(ORACLE, lambda: 2, lambda: calls.append(1) or way)
    shown = [judged(obedience, batch.clone(), frames)[1] for frames in (0, 250, 500, 999, 1_000, 5_000)]
    assert shown == pytest.approx([0.5, 0.375, 0.25, 0.0005, 0, 0])
    assert shown[-2:] == [0, 0]
    assert len(calls) == 4  # then nothing is judged any more
    found = obedience.add(batch, 1_000)
    assert np.isnan(found["obeyed"])
    assert found["extra_reward"] == 0


def test_of_several_numbers_the_worst_counts():
    batch = TensorDict({"state": torch.zeros(1, 1, 1), "instruction": torch.tensor([[[1.0, -1.0]]])}, [1, 1])
    batch["instruction_given"] = torch.ones(1, 1, 1)
    batch["next"] = TensorDict({"state": torch.ones(1, 1, 1), "done": torch.zeros(1, 1, 1, dtype=torch.bool)}, [1, 1])
    assert judged(make(1, lambda: lambda _: np.array([[0.75, 0.5]])), batch) == [-0.25]


def with_ends(batch: TensorDict, terminated: str) -> TensorDict:
    """The same with "x" where the episode terminates."""
    ends = [[mark == "x"] for mark in terminated.ljust(batch.shape[1])]
    batch["next", "terminated"] = torch.tensor([ends])
    return batch


def absorbing(horizon_steps: int = 1, gamma: float = 0.75) -> InstructionReward:
    return InstructionReward(replace(ORACLE, absorbing=True), lambda: horizon_steps, lambda: way, gamma=gamma)


def test_an_episode_that_has_terminated_counts_as_standing_still():
    """.75 + .75^2 + ... is 3. Told 0, standing still agrees by 1; told up or down, by 0."""
    batch = with_ends(climbing([1, 1, 0], done="  x"), "  x")
    assert judged(absorbing(), batch) == [0.5, 0.5, 0 + 3 * 0.5]
    assert judged(absorbing(), with_ends(climbing([1, 0, 1], done="  x"), "  x")) == [0.5, 0, 0.5]
    assert judged(absorbing(), with_ends(climbing([0, 0], done=" x"), " x"), frames=500) == [0, 3 * 0.25]
    assert judged(absorbing(gamma=0.0), with_ends(climbing([0], done="x"), "x")) == [0]


def test_one_that_was_cut_off_or_ends_in_silence_does_not():
    assert judged(absorbing(), with_ends(climbing([1, 0], done=" x"), "")) == [0.5, 0]
    assert judged(absorbing(), with_ends(climbing([0, None], done=" x"), " x")) == [0, 0]


def test_what_comes_after_the_end_counts_where_no_window_fits():
    reward, batch = absorbing(horizon_steps=5), with_ends(climbing([1, 0], done=" x"), " x")
    found = reward.add(batch, 0)
    assert np.isnan(found["obeyed"])
    assert found["extra_reward"] == 0.75
    assert batch["next", "extra_reward"][0, :, 0].tolist() == [0, 1.5]


def test_where_it_does_as_told_for_ever_it_does_not_matter_when_it_ends():
    """Discounted, the rewards of standing still under 0 add up to the same; without the end they differ."""

    def discounted(steps: int, reward: InstructionReward) -> float:
        still = row([0.0] * steps, [0.0] * steps, [0.0] * steps, "x".rjust(steps))
        extra = judged(reward, with_ends(still, "x".rjust(steps)))
        return float(np.dot(extra, 0.75 ** np.arange(steps)))

    assert discounted(2, absorbing()) == pytest.approx(0.5 / (1 - 0.75))
    assert discounted(9, absorbing()) == pytest.approx(discounted(2, absorbing()))
    assert discounted(9, make(1)) > discounted(2, make(1))


def test_a_state_of_an_earlier_version_is_resumed():
    """It has other columns: windows begin anew."""
    for missing, kept in (("after", {}), (None, {"mean": np.zeros(2)})):
        reward = make(3)
        judged(reward, climbing([1, -1]))
        state = reward.state_dict() | kept
        state.pop(missing, None)
        later = make(3)
        later.load_state_dict(state)
        assert judged(later, climbing([1, -1, 0, 0], start=2)) == [0, 0, 0.5, -0.5]


def late_by(instructor: int, person: int = 0) -> Callable[[], Delays]:
    found = {INSTRUCTOR: instructor, TEACHER: person}
    return lambda: {who: Delay(steps, steps, steps) for who, steps in found.items()}


@pytest.mark.parametrize(("late", "expected"), [(0, [0, 1, -1, -1]), (1, [0, -1, -1, -1]), (2, [0, 0, -1, -1])])
def test_an_instruction_that_comes_late_is_held_against_what_it_is_about(late: int, expected: list[float]):
    """Windows of two steps; told up at first, then down, always gone up. The reward comes once it was heard."""
    reward = InstructionReward(replace(ORACLE, weight=1.0), lambda: 2, lambda: way, late_by(late))
    assert judged(reward, climbing([1, -1, -1, -1])) == expected


def test_a_delay_that_is_found_later_counts_from_then_on():
    delays: dict[str, Delay] = {}
    reward = InstructionReward(replace(ORACLE, weight=1.0), lambda: 1, lambda: way, lambda: delays)
    assert judged(reward, climbing([1, 1])) == [1, 1]
    delays[INSTRUCTOR] = Delay(2, 2, 2)
    assert judged(reward, climbing([1, 1, -1, 1])) == [0, 0, -1, 1]


def told_to(taught: Sequence[int], steps: int) -> torch.Tensor:
    """Who spoke in each environment ``(N, T, 3)``: where it is taught the person, 0 elsewhere."""
    told = torch.zeros(len(taught), steps, TOLD_SIZE, dtype=torch.int32)
    told[..., 0] = torch.tensor(taught)[:, None] * told_of("person")[0]
    return told


def by_the_definition(batch: TensorDictBase, horizon_steps: int, late_steps: Sequence[int]) -> Array:
    """Step by step: agreement ``(N, T)``, 0 where nothing is judged; each row has its delay."""
    done, given = batch["next", "done"][..., 0].numpy(), batch["instruction_given"][..., 0].numpy()
    found = np.zeros(batch.shape)
    for n, t in np.ndindex(*batch.shape):
        late = late_steps[n]
        start = t - max(horizon_steps - 1, late)
        if start < 0 or done[n, start:t].any() or not given[n, start + late]:
            continue
        change = float(batch["next", "state"][n, start + horizon_steps - 1, 0] - batch["state"][n, start, 0])
        found[n, t] = 1 - abs(np.clip(change, -1, 1) - float(batch["instruction"][n, start + late, 0]))
    return found


@pytest.mark.parametrize(("late", "person_late"), [(0, None), (1, None), (6, None), (6, 0), (0, 6), (1, 3)])
@pytest.mark.parametrize("horizon_steps", [1, 2, 5, 13])
@pytest.mark.parametrize("lengths", [[40], [1] * 40, [3, 30, 7], [20, 20]])
def test_batches_of_any_length_are_judged_by_the_definition(
    horizon_steps: int, lengths: list[int], late: int, person_late: int | None
):
    """A person teaches in the second of six environments, or nowhere."""
    random, size = np.random.default_rng(horizon_steps), (6, 40, 1)
    given = torch.from_numpy(random.random(size) < 0.7).float()
    instruction = torch.from_numpy(random.choice([-1.0, 0.0, 1.0], size)).float() * given
    state, after = (torch.from_numpy(random.normal(size=size)).float() for _ in range(2))
    done = torch.from_numpy(random.random(size) < 0.15)
    inside = {"state": state, "instruction": instruction, "instruction_given": given}
    whole = TensorDict(inside | {"next": TensorDict({"state": after, "done": done}, size[:2])}, size[:2])
    late_steps = [late] * 6
    if person_late is not None:
        late_steps[1] = person_late
        whole[TOLD_COLUMN] = told_to([0, 1, 0, 0, 0, 0], 40)
    obedience = InstructionReward(
        ORACLE, lambda: horizon_steps, lambda: lambda delta: np.clip(delta, -1, 1), late_by(late, person_late or 0)
    )
    parts = whole.split(lengths, 1)
    for part in parts:
        obedience.add(part, 0)
    extra = torch.cat([part["next", "extra_reward"] for part in parts], 1)[..., 0]
    np.testing.assert_allclose(extra, 0.5 * by_the_definition(whole, horizon_steps, late_steps), atol=1e-6)


def settings(judge: str, **changes: Any) -> TrainConfig:
    obedience = replace(ORACLE, judge=judge)
    return TrainConfig(
        instructor=InstructorConfig("oracle"),
        obedience=obedience,
        **({"mapping": config(spans_steps=[3, 4]), "agent": PPOConfig()} | changes),
    )


def test_the_vocabulary_judges_once_it_is_there(tmp_path: Path):
    """Over the shortest of its spans of time, with the mapping that stands."""
    cfg, log = settings("mapping"), TrajectoryLog(tmp_path, 10_000, TASK.contexts)
    development = VocabularyTracker(cfg.mapping, TASK, seed=0)
    obedience = made(cfg, development)
    size = (1, 6, 3)
    batch = TensorDict({"state": torch.arange(18.0).reshape(size), "instruction": torch.ones(1, 6, 1)}, size[:2])
    batch["instruction_given"] = torch.ones(1, 6, 1)
    after = {"state": batch["state"] + 3, "done": torch.zeros(1, 6, 1, dtype=torch.bool)}
    batch["next"] = TensorDict(after, size[:2])
    assert [development.mapping_of(steps) for steps in (3, 4, 5)] == [None] * 3
    found = obedience.add(batch, 0)
    assert np.isnan(found["obeyed"])
    assert not batch["next", "extra_reward"].any()
    obey(log)
    development.refresh(log, stay)
    for states in (batch["state"], batch["next", "state"]):
        states += 18  # it goes on from there
    assert development.mapping_of(5) is development.mapping
    assert [development.mapping_of(steps) for steps in (3, 4)] == [development.spans[3], development.spans[4]]
    assert development.mapping_of(6) is None
    meaning = development.spans[3].express(np.full((1, 3), 9.0))[0, 0]
    assert judged(obedience, batch) == pytest.approx([0.5 * (1 - abs(meaning - 1))] * 6)


def test_without_a_judge_nothing_is_added():
    obedience, batch = made(settings("none"), VocabularyTracker(config(), TASK, 0)), climbing([1, 1])
    assert obedience.add(batch, 0) == {}
    assert set(batch["next"].keys()) == {"state", "done"}


def test_what_is_meant_is_the_way_it_went():
    """Beyond the band, which is a fifth as wide over a fifth of the time."""
    delta = np.array([[0.5, 9, 9], [0.51, 9, 9], [-0.51, 9, 9], [0.11, 9, 9], [-0.09, 9, 9]])
    assert meant(TASK, 100, 100)(delta).tolist() == [[0], [1], [-1], [0], [0]]
    assert meant(TASK, 20, 100)(delta).tolist() == [[1], [1], [-1], [1], [0]]
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(0.5, 10.0), explained_range=())
    assert meant(both, 100, 100)(delta[:2]).tolist() == [[0, 0], [1, 0]]
    assert meant(both, 50, 100)(delta[:2]).tolist() == [[1, 1], [1, 1]]


@pytest.mark.parametrize("judge", ["mapping", "oracle"])
def test_as_long_as_no_horizon_was_found_nothing_is_judged(judge: str, tmp_path: Path):
    """Then it begins with the steps that follow."""
    development = VocabularyTracker(config(horizon_steps=None), TASK, 0)
    obedience, batch = made(settings(judge), development), climbing([1] * 6)
    found = obedience.add(batch, 0)
    assert np.isnan(found["obeyed"])
    assert found["extra_reward"] == 0
    assert batch["next", "extra_reward"].shape == (1, 6, 1)
    assert obedience.state_dict() == {}
    log = TrajectoryLog(tmp_path / "log", 10_000, TASK.contexts)
    obey(log)
    development.refresh(log, stay)
    assert development.horizon_steps == 5
    assert judged(obedience, climbing([1] * 6)) == pytest.approx([0, 0, 0, 0, 0.5, 0.5])


def test_the_oracle_judges_over_the_shortest_span():
    obedience = made(settings("oracle"), VocabularyTracker(config(spans_steps=[3, 4]), TASK, 0))
    assert judged(obedience, climbing([1, 1, 1, -1, 0, 0])) == [0, 0, 0.5, 0.5, 0.5, -0.5]


def test_the_delay_that_the_log_tells_is_taken_back():
    """Told down once, a step too late; by the person at once, who takes three steps for it."""
    development = VocabularyTracker(config(spans_steps=[1]), TASK, 0)
    obedience = made(settings("oracle", mapping=config(spans_steps=[1])), development)
    assert judged(obedience, climbing([1, 1, -1, 1])) == [0.5, 0.5, -0.5, 0.5]
    development.delays = late_by(1, person=3)()
    batch = climbing([1, 1, -1, 1])
    assert judged(obedience, batch) == [0, 0.5, -0.5, 0.5]
    batch[TOLD_COLUMN] = told_to([1], 4)
    assert judged(obedience, batch) == [0, 0, 0, 0.5]  # windows begin anew


@pytest.mark.parametrize(
    ("cfg", "expected"),
    [
        (
            replace(settings("oracle"), instructor=InstructorConfig("silent")),
            r"^obedience\.judge=oracle with instructor=silent: allowed is none",
        ),
        (
            settings("oracle", refresh_every_frames=None, mapping=config(horizon_steps=None)),
            r"^obedience\.judge=oracle with refresh_every_frames=null and mapping\.horizon_steps=null, which no",
        ),
        (
            settings("mapping", refresh_every_frames=None),
            r"^obedience\.judge=mapping with refresh_every_frames=null: allowed is none or oracle",
        ),
        (
            replace(settings("oracle", agent=PPOConfig(gamma=1.0)), obedience=ObedienceConfig(judge="oracle")),
            r"^agent\.gamma=1 with obedience\.judge=oracle and obedience\.absorbing=true: allowed is less than 1",
        ),
    ],
)
def test_a_reward_that_nothing_could_be_judged_for_is_refused(cfg: TrainConfig, expected: str):
    with pytest.raises(ConfigError, match=expected):
        check_instruction_reward(cfg)


def test_what_can_be_judged_passes():
    silent = replace(settings("none"), instructor=InstructorConfig("silent"), refresh_every_frames=None)
    endless = settings("oracle", agent=PPOConfig(gamma=1.0))  # the end does not count
    for cfg in (
        silent,
        settings("mapping"),
        settings("oracle"),
        settings("oracle", refresh_every_frames=None),
        endless,
    ):
        check_instruction_reward(cfg)


def learner() -> Agent:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    actions = make_gym(LANDER_ID, {}).action_space
    return make_agent(PPOConfig(hidden=[8], minibatch_size=64), LANDER_TASK.observation_size, actions, 1_000)


def test_ppo_learns_from_the_extra_reward_and_not_at_all_from_none():
    env = make_vector_env(
        [make_gym(LANDER_ID, {}) for _ in range(4)], make_instructor(InstructorConfig("oracle"), LANDER_TASK), 0
    )
    rolled_out = env.rollout(64, learner().policy, break_when_any_done=False)

    def learnt(judge: str | None) -> Array:
        agent, batch, seen = learner(), rolled_out.clone(), np.random.default_rng(0).normal(size=(50, 11))
        if judge:
            cfg = settings(judge)
            made(cfg, VocabularyTracker(cfg.mapping, LANDER_TASK, 0), LANDER_TASK).add(batch, 0)
        agent.update(batch)
        agent.sync_weights()
        return agent.policy.network(torch.from_numpy(seen).float()).detach().numpy()

    np.testing.assert_array_equal(learnt("none"), learnt(None))
    np.testing.assert_array_equal(learnt("mapping"), learnt(None))  # there is no vocabulary yet
    assert (learnt("oracle") != learnt(None)).any()
