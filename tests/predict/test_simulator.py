"""The simulator goes where the game would go, and leaves the game alone."""

import os
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.envs.box2d.lunar_lander import heuristic
from torch import nn

from ibe_rl.agents.networks import GreedyPolicy, make_network
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig, PredictorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.simulator import Simulator
from ibe_rl.types import Array, Moment, Policy, Predictor

pytestmark = pytest.mark.slow

LEGS = slice(6, 8)
RULE = LANDER_TASK.rule
STEADY = SimpleNamespace(unwrapped=SimpleNamespace(continuous=False))


def make_one() -> Any:
    return make_gym(LANDER_ID, {})


def pilot(observations: Array) -> Array:
    """Gymnasium's rule of thumb, heading for the pad."""
    seen = observations[:, :8].copy()
    seen[:, 0] -= observations[:, 8]
    return np.array([heuristic(STEADY, row) for row in seen])


def fall(observations: Array) -> Array:
    return np.zeros(len(observations), int)


def rolled_out(policy: Policy = pilot, seed: int = 0, kind: str = "oracle") -> tuple[Array, list[Moment]]:
    watched = record_rollout(make_one(), policy, make_instructor(InstructorConfig(kind), LANDER_TASK), seed, "left")
    return watched.episode.states, list(watched.moments)


SETTINGS: dict[str, Callable[..., Predictor]] = {
    f"simulator {future}": partial(Simulator, make_one, RULE, future) for future in ("hold", "rule")
}


@pytest.mark.parametrize("make", SETTINGS.values(), ids=SETTINGS)
def test_every_predictor_keeps_the_protocol(make: Callable[..., Predictor]):
    _, moments = rolled_out()
    several = moments[::40]
    for horizon in (1, 25):
        paths = make().rollout(several, pilot, horizon).paths
        assert paths.shape == (len(several), horizon + 1, 9)
        assert paths.dtype == np.float32
        np.testing.assert_array_equal(paths[:, 0], [moment.state for moment in several])
        assert np.isfinite(paths).all()
        assert (paths[:, 1] != paths[:, 0]).any(axis=1).all()


@pytest.mark.parametrize("make", SETTINGS.values(), ids=SETTINGS)
def test_the_same_seed_predicts_the_same(make: Callable[..., Predictor]):
    _, moments = rolled_out()
    paths, again, other = (make(seed=seed).rollout(moments[::30], pilot, 40).paths for seed in (1, 1, 2))
    np.testing.assert_array_equal(paths, again)
    assert np.abs(paths - other).max() > 1e-3


def test_several_processes_predict_the_same():
    _, moments = rolled_out()
    several = moments[::20]
    torch.manual_seed(0)
    policy = GreedyPolicy(make_network(LANDER_TASK.observation_size, [8], 4, nn.Tanh, 1.0), 0.1)
    settings = PredictorConfig(moments_at_once=4, processes=2)
    found = []
    for _ in range(2):
        with closing(Simulator.make(settings, make_snapshot_env=make_one, rule=RULE, seed=3)) as spread:
            found.append([spread.rollout(several, policy, 30).paths for _ in range(2)])
            assert len(spread._pool._workers) == 2
        assert spread._pool is None
    np.testing.assert_array_equal(*found)
    alone = Simulator.make(PredictorConfig(moments_at_once=4), make_snapshot_env=make_one, rule=RULE, seed=3)
    for paths in found[0]:
        in_flight = ~paths[..., LEGS].any(axis=(1, 2))  # on the ground a copy shows more of whom it played before
        assert np.sum(in_flight) > 4
        np.testing.assert_allclose(paths[in_flight], alone.rollout(several, policy, 30).paths[in_flight], atol=2e-3)


def test_a_process_that_is_killed_is_done_without():
    _, moments = rolled_out()
    several, policy = moments[::20], GreedyPolicy(make_network(LANDER_TASK.observation_size, [8], 4, nn.Tanh, 1.0), 0.1)
    with closing(
        Simulator.make(PredictorConfig(moments_at_once=4, processes=2), make_snapshot_env=make_one, rule=RULE, seed=3)
    ) as spread:
        whole = spread.rollout(several, policy, 30).paths
        [process] = spread._pool._workers[1]._processes.values()
        process.kill()
        assert spread.rollout(several, policy, 30).paths.shape == whole.shape
        assert spread._pool is None


def test_processes_stay_and_forget_the_episodes_that_they_played():
    """What a run predicts after it was resumed is what it would have predicted."""
    _, moments = rolled_out()
    several, policy = moments[::5], GreedyPolicy(make_network(LANDER_TASK.observation_size, [8], 4, nn.Tanh, 1.0), 0.1)
    settings = PredictorConfig(moments_at_once=4, processes=2)
    make = partial(Simulator.make, settings, make_snapshot_env=make_one, rule=RULE, seed=3)
    with closing(make()) as stays, closing(make()) as new, closing(make()) as remembers:
        for one in (stays, remembers):
            one.rollout(several, policy, 60)
        before = processes_of(stays)
        stays.forget()
        new.load_state_dict(stays.state_dict())
        found, expected, other = (one.rollout(several, policy, 60).paths for one in (stays, new, remembers))
        np.testing.assert_array_equal(found, expected)
        assert (found != other).any()
        assert processes_of(stays) == before
        for worker in stays._pool._workers:
            with pytest.raises(BrokenProcessPool):
                worker.submit(os._exit, 1).result()
        stays.forget()
        assert stays._pool is None


def processes_of(simulator: Simulator) -> list[int]:
    return [process for worker in simulator._pool._workers for process in worker._processes]


def test_few_moments_start_no_process():
    _, moments = rolled_out()
    simulator = Simulator(make_one, RULE, processes=2)
    simulator.rollout(moments[:3], pilot, 2)
    assert simulator._pool is None


def test_processes_are_started_after_few_moments_were_predicted_without_them():
    """They get no games of this process, which cannot be sent there."""
    _, moments = rolled_out()
    policy = GreedyPolicy(make_network(LANDER_TASK.observation_size, [8], 4, nn.Tanh, 1.0), 0.1)
    settings = PredictorConfig(moments_at_once=4, processes=2)
    with closing(Simulator.make(settings, make_snapshot_env=make_one, rule=RULE, seed=3)) as spread:
        spread.rollout(moments[:3], policy, 2)
        assert spread.rollout(moments[::20], policy, 2).paths.shape == (len(moments[::20]), 3, 9)
        assert len(spread._pool._workers) == 2


def test_nobody_knows_the_noise_of_the_future():
    """Each prediction draws its own, also of the same moment."""
    _, moments = rolled_out()
    predictor = Simulator(make_one, RULE)
    once, twice = predictor.rollout([moments[0], moments[0]], pilot, 40).paths
    later = predictor.rollout([moments[0]], pilot, 40).paths[0]
    for other in (twice, later):
        assert 1e-3 < np.abs(once - other).max() < 0.5


def test_with_the_same_noise_and_rule_it_predicts_what_really_happens():
    errors, on_ground = [], []
    predictor = Simulator(make_one, RULE, "rule", own_noise=False)
    for seed in range(6):
        states, moments = rolled_out(seed=seed)
        starts = range(0, len(moments) - 60, 10)
        paths = predictor.rollout([moments[start] for start in starts], pilot, 60).paths
        for start, path in zip(starts, paths, strict=True):
            errors.append(np.abs(path - states[start : start + 61])[:, :6].max())
            on_ground.append(states[start : start + 61, 6:8].any())
    air, ground = (np.array(errors)[np.array(on_ground) == value] for value in (False, True))
    assert min(len(air), len(ground)) > 20
    assert np.percentile(air, 95) < 1e-4
    assert np.median(ground) < 1e-4


def test_the_live_game_goes_on_as_if_nothing_had_been_explained():
    games = [make_one(), make_one()]
    predictor = Simulator(lambda: make_gym(LANDER_ID, {}), RULE)
    for game in games:
        game.reset(seed=5)
    state = games[0].unwrapped.step(0)[0]
    games[1].unwrapped.step(0)
    for step in range(150):
        if step % 10 == 0:
            moment = Moment(state, RULE(state), True, games[0].unwrapped.snapshot())
            predictor.rollout([moment, moment], pilot, 30)
        action = int(pilot(state[None])[0])
        (state, *rest), (expected, *expected_rest) = games[0].step(action), games[1].step(action)
        np.testing.assert_array_equal(state, expected)
        assert rest == expected_rest


def test_a_prediction_that_ends_repeats_its_last_state():
    states, moments = rolled_out(fall)
    last = len(states) - 1
    paths = Simulator(make_one, RULE).rollout([moments[0], moments[last - 10]], fall, last + 30).paths
    assert (paths[0, last:] == paths[0, last]).all()
    assert (paths[1, 10:] == paths[1, 10]).all()
    assert (paths[1, 9] != paths[1, 10]).any()
    np.testing.assert_allclose(paths[1, 10], states[-1], atol=1e-4)


class Noting:
    """Falls, and notes the instructions it is given: a list of steps, each ``(flying, 2)``."""

    def __init__(self) -> None:
        self.seen: list[Array] = []

    def __call__(self, observations: Array) -> Array:
        self.seen.append(observations.copy())
        return fall(observations)


@pytest.mark.parametrize("kind", ["oracle", "silent"])
def test_hold_tells_the_policy_the_moments_instruction_all_the_way(kind: str):
    _, moments = rolled_out(kind=kind)
    moment, policy = moments[20], Noting()
    Simulator(make_one, RULE, "hold").rollout([moment], policy, 15)
    assert len(policy.seen) == 15
    for seen in policy.seen:
        assert seen[0, 9:].tolist() == [moment.instruction[0], moment.given]


def test_hold_holds_where_the_rule_would_change_its_mind():
    _, moments = rolled_out()
    instructions = [int(moment.instruction[0]) for moment in moments]
    change = next(t for t in range(len(instructions) - 1) if instructions[t] != instructions[t + 1])
    held, ruled = Noting(), Noting()
    for policy, future in ((held, "hold"), (ruled, "rule")):
        Simulator(make_one, RULE, future, own_noise=False).rollout([moments[change - 5]], policy, 40)
    assert {seen[0, 9] for seen in held.seen} == {instructions[change]}
    assert len({seen[0, 9] for seen in ruled.seen}) == 2


@pytest.mark.parametrize("kind", ["oracle", "silent"])
def test_rule_asks_the_rule_in_the_predicted_states(kind: str):
    _, moments = rolled_out(kind=kind)
    policy = Noting()
    paths = Simulator(make_one, RULE, "rule").rollout([moments[20]], policy, 15).paths
    assert policy.seen[0][0, 9:].tolist() == [moments[20].instruction[0], moments[20].given]  # that is known
    for seen, state in zip(policy.seen[1:], paths[0, 1:], strict=False):
        np.testing.assert_array_equal(seen[0, :9], state)
        assert seen[0, 9:].tolist() == [RULE(state)[0], 1]


def test_only_unfinished_rollouts_are_asked():
    states, moments = rolled_out(fall)
    policy = Noting()
    Simulator(make_one, RULE).rollout([moments[-5], moments[0]], policy, 20)
    assert [len(seen) for seen in policy.seen] == [2] * 5 + [1] * 15
    np.testing.assert_allclose(policy.seen[5][0, :9], states[5], atol=1e-4)


def test_many_moments_need_few_games():
    _, moments = rolled_out()
    several, made = moments[:140:20], []

    def count() -> Any:
        made.append(1)
        return make_one()

    together = Simulator(make_one, RULE, seed=3).rollout(several, pilot, 30).paths
    parts = Simulator(count, RULE, moments_at_once=3, seed=3).rollout(several, pilot, 30).paths
    assert len(several) == 7
    assert len(made) == 3
    np.testing.assert_allclose(parts, together, atol=1e-3)
