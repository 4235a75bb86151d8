"""Exact explanations, batched, one step after the other, and with nothing but the engine; runs in a child process."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from gymnasium.envs.box2d import lunar_lander as game

from benchmarks.plan import ROOT
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.evaluation.runs import load_run
from ibe_rl.evaluation.trained_run import TrainedRun, explainer_state
from ibe_rl.explain.explainer import explain
from ibe_rl.ibe import phrase
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.predict.simulator import Simulator
from ibe_rl.types import Moment, observe

STEP = (1.0 / game.FPS, 6 * 30, 2 * 30)
"""What gymnasium's game asks of Box2D at each step."""


def rates(moments: int, live_moments: int) -> dict[str, float]:
    """Explanations a second over the same moments in three ways, and milliseconds for one at a time.

    Args:
        moments: how many are explained.
        live_moments: how many of them one at a time.
    """
    torch.set_num_threads(1)
    run = load_run(ROOT / "demo")
    chosen = watched_moments(run, moments)
    explain_all(run, chosen)(chosen)  # to warm up; it keeps its games to itself
    naive_s, actions = naive(run, chosen)
    return {
        "batched": moments / batched(run, chosen),
        "what_if": moments / batched(run, chosen, otherwise=True),
        "naive": moments / naive_s,
        "engine": moments / engine(run, chosen, actions),
        "live_ms": live_ms(run, chosen[:: max(1, moments // live_moments)][:live_moments]),
        "live_what_if_ms": live_ms(run, chosen[:: max(1, moments // live_moments)][:live_moments], otherwise=True),
    }


def watched_moments(run: TrainedRun, count: int) -> list[Moment]:
    """Moments of watched episodes, evenly spaced over as many episodes as hold four times what is asked for."""
    instructor = make_instructor(stand_in(run.config.instructor, run.folder), run.task)
    env, seed, found = run.make_env(), 0, list[Moment]()
    while len(found) < 4 * count:
        found += record_rollout(env, run.policy, instructor, seed).moments
        seed += 1
    return [found[place] for place in np.linspace(0, len(found) - 1, count).astype(int)]


def explain_all(run: TrainedRun, warm: Sequence[Moment], otherwise: bool = False) -> Any:
    """``explain`` with everything but the moments filled in; its games are made already.

    Args:
        run: provides policy and vocabulary.
        warm: moments to make games for.
        otherwise: also what it would do if it were told otherwise.
    """
    simulator = Simulator.make(run.config.predictor, make_snapshot_env=run.make_env, rule=run.task.rule, seed=0)
    simulator.rollout(warm, run.policy, 1)
    explainer = replace(explainer_state(run, what_if=otherwise), futures=1)
    return lambda moments: explain(moments, run.policy, simulator, explainer)


def batched(run: TrainedRun, moments: Sequence[Moment], otherwise: bool = False) -> float:
    """Seconds to explain all moments together."""
    say = explain_all(run, moments, otherwise)
    start = time.perf_counter()
    say(moments)
    return time.perf_counter() - start


def live_ms(run: TrainedRun, moments: Sequence[Moment], otherwise: bool = False) -> float:
    """Median milliseconds to explain one moment at a time."""
    say, spent = explain_all(run, moments[:1], otherwise), []
    for moment in moments:
        start = time.perf_counter()
        say([moment])
        spent.append(1000 * (time.perf_counter() - start))
    return statistics.median(spent)


def naive(run: TrainedRun, moments: Sequence[Moment]) -> tuple[float, list[list[int]]]:
    """Seconds to explain one moment after the other in one game, and the actions that were taken."""
    lander: Any = run.make_env().unwrapped
    lander.reset(seed=0)
    actions = []
    start = time.perf_counter()
    for number, moment in enumerate(moments):
        lander.restore(moment.snapshot, np.random.default_rng(number))
        actions.append(explain_naively(run, lander, moment))
    return time.perf_counter() - start, actions


def explain_naively(run: TrainedRun, lander: Any, moment: Moment) -> list[int]:
    """Step one game with the policy called on one observation at a time, then look the change up."""
    state, taken = moment.state, []
    given = np.array([moment.given], np.float32)
    for _ in range(run.horizon_steps):
        action = int(run.policy(observe(state, moment.instruction, given)[None])[0])
        taken.append(action)
        state, _, terminated, _, _ = lander.step(action)
        if terminated:
            break
    delta = (state - moment.state)[None]
    _ = phrase(run.mapping.express(delta)[0], run.task.phrases), run.mapping.cluster(delta)
    _ = run.mapping.confidence(delta)
    return taken


def engine(run: TrainedRun, moments: Sequence[Moment], actions: Sequence[list[int]]) -> float:
    """Seconds that Box2D alone takes from the same moments with the same actions; taking them up does not count."""
    lander: Any = run.make_env().unwrapped
    lander.reset(seed=0)
    seconds = 0.0
    for moment, taken in zip(moments, actions, strict=True):
        lander.restore(moment.snapshot, np.random.default_rng(0))
        start = time.perf_counter()
        for action in taken:
            if action:
                fire(lander.lander, action)
            lander.world.Step(*STEP)
        seconds += time.perf_counter() - start
    return seconds


def fire(body: Any, action: int) -> None:
    """Push the lander as gymnasium's engines do, without their noise."""
    angle, (x, y) = body.angle, body.position
    tip_x, tip_y = math.sin(angle), math.cos(angle)
    if action == 2:
        along = game.MAIN_ENGINE_Y_LOCATION / game.SCALE
        push, power = (tip_x * along, -tip_y * along), game.MAIN_ENGINE_POWER
        point = (x + push[0], y + push[1])
    else:
        across = (action - 2) * game.SIDE_ENGINE_AWAY / game.SCALE
        push, power = (-tip_y * across, -tip_x * across), game.SIDE_ENGINE_POWER
        below, above = 17 / game.SCALE, game.SIDE_ENGINE_HEIGHT / game.SCALE
        point = (x + push[0] - tip_x * below, y + push[1] + tip_y * above)
    body.ApplyLinearImpulse((-push[0] * power, -push[1] * power), point, True)
