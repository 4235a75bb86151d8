"""Episodes of the real lander, a vocabulary learnt from them and what would be said: data for the view's tests."""

from __future__ import annotations

import os
import socket
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.box2d.lunar_lander import heuristic
from rerun.chunk import RrdReader

import ibe_rl  # noqa: F401 - registers the environment
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.lander_task import LANDER_TASK, X
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe import IBEMapping, cut_windows, keep_identity, phrase, top_episodes
from ibe_rl.metrics.drift import vocabulary_drift
from ibe_rl.metrics.quality import realised_phrases, vocabulary_scores
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import Array, Episode, Explanation, Moment
from ibe_rl.view.address import Ports
from ibe_rl.view.recorder import Recorder
from ibe_rl.vocabulary.refresh import Change, Refresh
from ibe_rl.vocabulary.refresh_columns import figures

TASK: Task = LANDER_TASK
HORIZON_STEPS = 60


@cache
def _lander() -> Any:
    return gymnasium.make(LANDER_ID).unwrapped


def fly(seed: int, wander: float = 0.0, max_steps: int = 400) -> RecordedRollout:
    """Fly one episode by gymnasium's rule of thumb, aimed ``wander`` half widths beside the pad at first."""
    env, random = _lander(), np.random.default_rng(seed)
    state, _ = env.reset(seed=seed)
    states, actions, rewards, figures = [state], [], [], [env.figure()]
    aim, done, info = random.normal(0, wander) if wander else 0.0, False, {}
    while not done and len(actions) < max_steps:
        seen = state[:8].copy()
        seen[X] -= state[8] + aim * max(0.0, float(state[1]))
        action = heuristic(env, seen)
        state, reward, done, _, info = env.step(action)
        for column, value in zip(
            (states, actions, rewards, figures), (state, action, reward, env.figure()), strict=True
        ):
            column.append(value)
    return _watched(np.array(states), actions, rewards, figures, bool(info.get("landed")), env.background())


def _watched(
    states: Array, actions: Any, rewards: Any, figures: Any, success: bool, background: Any
) -> RecordedRollout:
    steps = len(actions)
    given = np.ones(steps, bool)
    given[steps // 2 : steps // 2 + 15] = False  # the instructor falls silent for a while
    instructions = TASK.rule(states[:-1]) * given[:, None]
    episode = Episode(
        states, np.array(actions), np.array(rewards), instructions, given, True, success, TASK.context(states[0])
    )
    moments = [Moment(states[t], instructions[t], bool(given[t])) for t in range(steps)]
    return RecordedRollout(episode, moments, background, figures)


@cache
def flights(count: int = 12) -> tuple[RecordedRollout, ...]:
    return tuple(fly(seed, wander=0.4) for seed in range(count))


@cache
def refreshed(frame: int = 50_000, count: int = 12, n_clusters: int = 8) -> Refresh:
    """What a refresh at ``frame`` would have learnt from the first ``count`` flights."""
    episodes = [watched.episode for watched in flights(count)]
    best = top_episodes(np.array([episode.total_reward for episode in episodes]), 0.5)
    top = [episode for episode, is_best in zip(episodes, best, strict=True) if is_best]
    others = [episode for episode, is_best in zip(episodes, best, strict=True) if not is_best]
    windows = cut_windows(top, HORIZON_STEPS)
    fitted = IBEMapping(n_clusters, random_state=frame).fit(windows.delta, windows.instruction)
    return Refresh(
        frame=frame,
        mapping=fitted.mapping_,
        spans={},
        top=windows,
        others=cut_windows(others, HORIZON_STEPS),
        episodes_logged=len(episodes),
        episodes_counted=len(episodes),
        episodes_used=len(top),
        episodes_by_context=Counter(episode.context for episode in top),
        windows_by_context=Counter(top[i].context for i in windows.episode),
        windows_by_instruction=Counter(f"{value + 0.0:+g}" for value in windows.instruction[:, 0]),
    )


def explain(watched: RecordedRollout, refresh: Refresh, seed: int = 0) -> list[Explanation]:
    """Explain every step from the real future, bent a little as a predictor would bend it."""
    states, random = watched.episode.states, np.random.default_rng(seed)
    steps = len(watched.moments)
    ahead = np.minimum(np.arange(steps)[:, None] + np.arange(HORIZON_STEPS + 1), steps)
    paths = states[ahead].copy()
    bend = random.normal(0, 0.05, (steps // 20 + 1, 1, 2)).repeat(20, axis=0)[:steps]
    paths[:, :, :2] += bend * np.linspace(0, 1, HORIZON_STEPS + 1)[:, None]
    delta = paths[:, -1] - paths[:, 0]
    mapping = refresh.standing
    expressions, clusters, confidence = mapping.express(delta), mapping.cluster(delta), mapping.confidence(delta)
    return [
        Explanation(
            expression=expressions[t],
            phrase=phrase(expressions[t], TASK.phrases),
            cluster=int(mapping.ids[clusters[t]]),
            delta_state=delta[t],
            horizon_steps=HORIZON_STEPS,
            confidence=float(confidence[t]),
            path=paths[t],
            futures=delta[t : t + 1],
        )
        for t in range(steps)
    ]


ASKED_EVERY = 20


def asked(said: list[Explanation], listens: float = 0.5) -> list[Explanation]:
    """Every 20 steps it is asked what if: to each value it would do as it says, to the second one a little aside."""
    answers = [dict(zip(values_of(TASK), (one, replace(one, path=one.path + 0.1), one), strict=True)) for one in said]
    return [
        replace(one, what_if=answers[step], listens=listens) if step % ASKED_EVERY == 0 else one
        for step, one in enumerate(said)
    ]


WATCHED = (6, 1, 4)
"""Which flights the recording of ``record`` shows; each after a refresh, 100,000 frames apart."""
COUNTS = (5, 9, 12)
"""How many flights each of its refreshes has learnt from."""


@cache
def developed() -> tuple[Refresh, ...]:
    """The refreshes of ``record``, each held against the one before."""
    taken = [replace(refreshed(count=COUNTS[0]), frame=100_000)]
    for number, count in enumerate(COUNTS[1:], start=2):
        taken.append(held_against(taken[-1], replace(refreshed(count=count), frame=100_000 * number)))
    return tuple(taken)


def held_against(before: Refresh, after: Refresh) -> Refresh:
    """Give a refresh its lasting ids, and what it changed."""
    probe, last = after.top.delta[::3], before.mapping
    mapping, transition = keep_identity(last, after.mapping, probe, int(last.ids.max()) + 1)
    scores = [vocabulary_scores(each, after.others, TASK) for each in (last, mapping)]
    change = Change(
        last=last,
        since_frame=before.frame,
        transition=transition,
        drift=vocabulary_drift(last, mapping, probe, TASK.phrases),
        policy_drift=0.25,
        last_scores=scores[0],
        staleness=scores[1]["motion_auc"] - scores[0]["motion_auc"],
    )
    return replace(after, mapping=mapping, change=change, scores=scores[1])


def real(watched: RecordedRollout, refresh: Refresh) -> list[str]:
    """What the vocabulary calls what happened."""
    return realised_phrases(watched.episode, HORIZON_STEPS, refresh.standing, TASK.phrases)


def filmed(number: int = 1, refresh: Refresh | None = None) -> tuple[RecordedRollout, list[Explanation], list[str]]:
    """A flight with what is said of it and what happened, as ``watched`` of a recorder takes them."""
    watched, words = flights()[number], refresh or refreshed()
    return watched, explain(watched, words), real(watched, words)


def record(path: Path) -> None:
    """Write a whole small run: curves, refreshes and the episodes watched after them."""
    recorder, frames, random = Recorder(path, TASK, "a small run"), 0, np.random.default_rng(0)
    for number, refresh in enumerate(developed()):
        for _ in range(5):
            frames += 20_000
            progress = 1 - np.exp(-frames / 200_000)
            noise = random.normal(0, 0.03)
            recorder.batch(
                frames, {"train/return_mean": 300 * (progress + noise) - 200, "train/success_rate": progress}
            )
        watched = flights()[WATCHED[number]]
        recorder.refresh(refresh)
        said = explain(watched, refresh, number)
        recorder.watched(frames, watched, asked(said) if number == 2 else said, real(watched, refresh))
        recorder.batch(frames, {"eval/return_mean": 350 * progress - 180, "eval/success_rate": progress})
        recorder.batch(frames, {"ibe/came_true": 0.5 + 0.3 * progress} | figures(refresh))
    recorder.close()


Rows = dict[str, list[dict[str, Any]]]


def read(path: Path) -> Rows:
    """All rows of each entity in the order of the frames and of logging, static ones first."""
    rows: Rows = defaultdict(list)
    for chunk in RrdReader(str(path)).stream():
        rows[str(chunk.entity_path)] += chunk.to_record_batch().to_pylist()

    def order(row: dict[str, Any]) -> tuple[int, bytes]:
        return row.get("frames", -1), row["rerun.controls.RowId"]

    return {entity: sorted(found, key=order) for entity, found in rows.items()}


def column(rows: list[dict[str, Any]], name: str) -> list[Any]:
    return [row[name] for row in rows if row.get(name) is not None and "frames" in row]


def frames(rows: list[dict[str, Any]]) -> list[int]:
    return column(rows, "frames")


def needed(there: bool, what: str) -> None:
    """Skip a test that needs something of the system, or fail it where everything has to be there."""
    if not there and os.environ.get("CI"):
        pytest.fail(f"{what} is missing")
    if not there:
        pytest.skip(f"{what} is missing")


def free_ports() -> Ports:
    """Two ports that nothing listens on."""
    with socket.socket() as one, socket.socket() as other:
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return Ports(one.getsockname()[1], other.getsockname()[1])


def eventually(condition: Callable[[], object], within_s: float = 240.0) -> bool:
    """Wait until ``condition`` holds; False if it does not, however busy the machine may be."""
    end = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True
