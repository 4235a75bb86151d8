"""Two agents side by side: each flies the same episodes, and people say which one is better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.apps.study.arms import Speaker, SpokenFrames, instructor_of, words_of_others
from ibe_rl.apps.study.scenes import FORMAT, Scene, about_episode
from ibe_rl.apps.study.settings import IBE, NONE, PLACEBIC, TRUE_FUTURE
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.ibe.delta import delta_states
from ibe_rl.task import RecordedRollout

MOST_FRAMES = 150
"""Of a recording; a longer one shows every second step, and so on, at the same pace."""
HELD_FRAMES = 10
"""How long words stay: fewer to read, and to compute."""


@dataclass(frozen=True)
class Recording:
    """What is shown of one agent's episode: from its beginning to a horizon before its end.

    Attributes:
        watched: the episode.
        steps: that are shown.
        said: the words, by arm.
        hits: by arm, how many of its words came true; their share.
    """

    watched: RecordedRollout
    steps: range
    said: dict[str, SpokenFrames]
    hits: dict[str, float]

    @property
    def reward(self) -> float:
        """Earned in what is seen."""
        return float(np.sum(self.watched.episode.rewards[: self.steps[-1] + 1]))


def record_side(speaker: Speaker, seed: int) -> Recording:
    """Fly one episode, and let the agent speak."""
    run = speaker.run
    env = run.make_env()
    watched = record_rollout(env, run.policy, instructor_of(run), seed)
    env.close()
    shown = max(2, len(watched.episode) - run.horizon_steps)
    steps = range(0, min(shown, len(watched.episode)), -(-shown // MOST_FRAMES))
    asked = [*steps][::HELD_FRAMES]
    spoken = speaker.say([watched.moments[step] for step in asked], every_steps=steps.step * HELD_FRAMES)
    true = speaker.really(delta_states(watched.episode.states, run.horizon_steps, "clamp")[asked])
    said = {**spoken, TRUE_FUTURE: true}
    hits = {arm: float(np.mean(np.array(words.phrases) == true.phrases)) for arm, words in said.items()}
    return Recording(watched, steps, {arm: words.stretched(len(steps)) for arm, words in said.items()}, hits)


def pairs_of(
    better: Speaker,
    other: Speaker,
    scene: Scene,
    seeds: Sequence[int],
    frame_ms: float,
    random: np.random.Generator,
    step: Callable[[], None] = lambda: None,
) -> list[dict[str, Any]]:
    """Pairs of recordings as JSON; the better agent is as often on the one side as on the other.

    Args:
        better: the agent that is better.
        other: the other one.
        scene: how both are drawn.
        seeds: one for each pair; both agents begin the same episode.
        frame_ms: time of a step.
        random: draws the sides, and deals the placebic words.
        step: called for each pair.
    """
    recorded = []
    for seed in seeds:
        recorded.append((record_side(better, seed), record_side(other, seed)))
        step()
    for agent in zip(*recorded, strict=True):
        for one, placebo in zip(agent, words_of_others([one.said[IBE] for one in agent], random), strict=True):
            one.said[PLACEBIC] = placebo
    right = random.permutation(np.arange(len(seeds)) % 2)
    return [
        _pair(pair if not flip else pair[::-1], int(flip), scene, seed, frame_ms)
        for pair, flip, seed in zip(recorded, right, seeds, strict=True)
    ]


def _pair(pair: Sequence[Recording], truth: int, scene: Scene, seed: int, frame_ms: float) -> dict[str, Any]:
    arms = [arm for arm in pair[0].said if arm in pair[1].said]
    without = int(np.argmax([one.reward for one in pair]))
    return {
        "format": FORMAT,
        "size": list(scene.size),
        "frame_ms": frame_ms,
        "background": [],
        "frames": [],
        "later": [],
        "phrases": [],
        "explanations": {arm: {"expressions": [], "phrases": []} for arm in arms},
        "sides": [_side(one, arms, scene, frame_ms) for one in pair],
        "truth": {"choice": truth},
        "observers": {
            NONE: {"choice": without},
            **{arm: {"choice": _truer(pair, arm, without)} for arm in arms},
        },
        **about_episode(seed, pair[truth].watched.episode),
    }


def _side(one: Recording, arms: Sequence[str], scene: Scene, frame_ms: float) -> dict[str, Any]:
    return {
        "size": list(scene.size),
        "frame_ms": frame_ms * one.steps.step,
        "background": scene.background(one.watched),
        "frames": [scene.frame(one.watched, step, 0) for step in one.steps],
        "explanations": {arm: one.said[arm].as_json() for arm in arms},
    }


def _truer(pair: Sequence[Recording], arm: str, without: int) -> int:
    """Whose words came true more often; a simulated observer takes that for skill. Else as without words."""
    left, right = (one.hits.get(arm, 0.0) for one in pair)
    return without if left == right else int(right > left)
