"""A made-up outcome of the experiments: as many numbers and as long words as of a real run; and flights to draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from by_hand import TASK as LIFT
from by_hand import on_a_line

from ibe_rl.apps.paper.agents import PaperAgent
from ibe_rl.apps.paper.experiments import correct, prediction
from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    DEFAULT,
    OBSERVER_LABELS,
    PAPERS,
    SIGNS_KEPT,
    SPLIT_MINMAX,
)
from ibe_rl.apps.paper.prediction_task import ObservedEpisodes, ShownEpisode
from ibe_rl.config.report_settings import FiguresConfig
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.task import RecordedRollout, Shape, Task
from ibe_rl.types import Array, Episode

TASK: Task = replace(
    LIFT,
    name="a sledge",
    explained_range=(20.0,),
    scene_path=lambda states: states[..., :2],
    scene_size=(20.0, 13.0),
)
"""Its state is where it is in a scene of 20 by 13; what is explained is how far to the right."""
HORIZON_STEPS = 60
STEPS = 100
SAID = {
    PAPERS: (-1.0, -0.4, -0.1, -0.01, 0.13, 0.27, 0.77, 1.0),
    DEFAULT: (-1.0, -0.71, -0.16, -0.01, 0.01, 0.16, 0.71, 1.0),
}
SIZES = (2209, 619, 2907, 2519, 230, 788, 2897, 986)
UNKNOWN: dict[str, Any] = {"value": None, "low": None, "high": None}


def estimate(value: float, around: float = 0.1) -> dict[str, Any]:
    """A value and its interval."""
    return {"value": value, "low": value - around, "high": value + around}


def found(agents: Sequence[str] = ("A", "B", "C"), run: str = "dqn0") -> dict[str, Any]:
    """As paper.json; vocabularies and what follows are of B and C if they are there."""
    skilled = [name for name in agents if name != "A"] or list(agents)
    made: dict[str, Any] = {
        "protocol": PROTOCOL | {"run": run},
        "phrases": {"-1.0": "falling to the left", "0.0": "falling straight down", "1.0": "falling to the right"},
        "change_label": "change of x (half widths)",
        "screened": [
            {"frame": 30_000 * each, "episodes": (30, 80, 300)[each % 3], "success": min(1.0, each / 50)}
            for each in range(1, 68)
        ],
        "agents": [
            agent("A", 670_720, 0.745, 19 / 30, near=False),
            agent("B", 880_640, 0.865, 25 / 30, near=True),
            agent("C", 2_000_896, 0.975, None, near=True),
        ],
        "preliminary": [preliminary(name) for name in agents],
        "expressions": [expressions(name) for name in skilled],
        "straight": [straight(name) for name in skilled],
        "prediction": [foretold(name) for name in skilled],
    }
    correct(made["prediction"])
    return made


PROTOCOL: dict[str, Any] = {
    "agent": "dqn",
    "environment": "Lunar Lander with pads",
    "actions": "greedy",
    "horizon_steps": HORIZON_STEPS,
    "n_clusters": 8,
    "top_fraction": 0.25,
    "default_mapping": "axis",
    "seen_steps": SEEN_STEPS,
    "futures": 3,
    "band": 0.05,
    "context": "pad",
    "seed": 0,
    "seeds": {"flown": [2_090_000_000, 2_090_000_199], "checked": [2_100_000_000, 2_100_000_099]},
    "clusterings": 8,
    "shuffles": 20,
    "resamples": 1000,
}


def agent(name: str, frame: int, success: float, wanted: float | None, near: bool) -> dict[str, Any]:
    return {
        "name": name,
        "frame": frame,
        "wanted": wanted,
        "episodes": 200,
        "success": estimate(success, 0.025),
        "near": near,
        "return_mean": 234.4,
        "steps_mean": 397.6,
    }


def preliminary(name: str) -> dict[str, Any]:
    return {"agent": name, "told": {str(value): histogram(value) for value in (-1.0, 0.0, 1.0)}}


def histogram(value: float) -> dict[str, Any]:
    """Told left it goes left; the peak of who is told nothing is cut."""
    edges = np.linspace(-0.36, 0.36, 42)
    middles = (edges[1:] + edges[:-1]) / 2
    density = np.exp(-(((middles - value * 0.15) / 0.08) ** 2)) * 5
    peaked = density + 20 * (np.abs(middles) < 0.005)
    claims = {over: claim(0.67) for over in ("all", "center", "left", "within")} | {"right": None}
    return {
        "edges": edges.tolist(),
        "shown_to": 5.0,
        "best": {"windows": 3629, "mean": value * 0.15, "density": density.tolist()},
        "others": {"windows": 11569, "mean": value * 0.1, "density": peaked.tolist()},
        "claim": claims,
    }


def claim(superiority: float) -> dict[str, Any]:
    return {
        "best_episodes": 19,
        "other_episodes": 77,
        "best_mean": 0.15,
        "others_mean": -0.125,
        "difference": estimate(-0.002, 0.03),
        "superiority": estimate(superiority),
        "holds": "yes",
    }


def expressions(name: str) -> dict[str, Any]:
    words = {
        kind: {
            "expressions": list(said),
            "mean_instructions": list(said),
            "sizes": list(SIZES),
            "ids": list(range(8)),
            "skew": 0.08,
            "below_zero": 4,
            "above_zero": 4,
            "minmax_of_zero": -0.01,
            "straight_below": 0.15,
        }
        for kind, said in SAID.items()
    }
    return {"agent": name, "vocabularies": words}


def straight(name: str) -> dict[str, Any]:
    edges = np.array([-0.4, -0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4])
    rows = [
        {"from": low, "to": high, "windows": 39, **estimate(0.5 - abs(low + high) / 2)}
        for low, high in pairwise(edges.tolist())
    ]
    rates = {
        kind: {
            "straight_left": estimate(share),
            "straight_right": estimate(share / 2),
            "wrong_left": estimate(0.07),
            "wrong_right": estimate(0.12),
            "left_minus_right": estimate(0.24),
        }
        for kind, share in {PAPERS: 0.36, SIGNS_KEPT: 0.3, SPLIT_MINMAX: 0.1, DEFAULT: 0.0}.items()
    }
    return {
        "agent": name,
        "clusterings": 8,
        "small": [[0.05, 0.25]],
        "by_movement": {PAPERS: rows, DEFAULT: rows},
        "rates": rates,
        "skews": {kind: [0.08] * 8 for kind in rates},
    }


def foretold(name: str, episodes: int = 20) -> dict[str, Any]:
    """The prediction task over the flights that are drawn."""
    skilled = PaperAgent(name, None, 0, lambda observations: observations, [])
    return prediction(
        skilled, {cut: flights(cut, episodes) for cut in (AT_END, AT_CONTACT)}, FiguresConfig(resamples=20)
    )


def flights(cut: str = AT_END, episodes: int = 20) -> ObservedEpisodes:
    """Episodes in which the sledge slides down to the right, each from a little further to the right.

    No explanation expects it 1 too far to the right, the paper's vocabulary 3, ours half as much, all others 2.
    """
    shown = [ShownEpisode(7 + row, sledge(row), {AT_END: STEPS, AT_CONTACT: 90}) for row in range(episodes)]
    lasts = np.array([one.ends[cut] - HORIZON_STEPS for one in shown])
    ends = np.array([one.ends[cut] for one in shown])
    position, landing = (
        np.array([one.watched.episode.states[at, 0] for one, at in zip(shown, where, strict=True)], float)
        for where in (lasts, ends)
    )
    off = dict.fromkeys(OBSERVER_LABELS, 2.0) | {
        "true_future": 0.0,
        "no_explanation": 1.0,
        PAPERS: 3.0,
        DEFAULT: 0.5,
    }
    expected = {name: (landing + each)[None] for name, each in off.items()}
    said = {name: np.tile(np.resize(SAID[name], SEEN_STEPS), (episodes, 1)) for name in (PAPERS, DEFAULT)}
    words = {name: on_a_line(np.arange(8.0).tolist(), SAID[name]) for name in (PAPERS, DEFAULT)}
    return ObservedEpisodes(shown, cut, TASK, HORIZON_STEPS, words, said, position, landing, expected)


def sledge(row: int) -> RecordedRollout:
    """One way down, from (2 + row / 4, 9) to 8 further right and 5 further down."""
    way = np.linspace((2 + row / 4, 9, 0), (10 + row / 4, 4, 0), STEPS + 1).astype(np.float32)
    episode = Episode(
        states=way,
        actions=np.zeros(STEPS, int),
        rewards=np.zeros(STEPS, np.float32),
        instructions=np.ones((STEPS, 1), np.float32),
        given=np.ones(STEPS, bool),
        terminated=True,
        success=True,
        context="lower",
    )
    ground = Shape(np.array([(0.0, 4.0), (20.0, 4.0)]), (190, 190, 200))
    return RecordedRollout(episode, [], [ground], [[outline(state[:2])] for state in way])


def outline(at: Array) -> Shape:
    return Shape(at + np.array([(-0.5, 0.0), (0.5, 0.0), (0.0, 1.0)]), (150, 140, 255), closed=True)
