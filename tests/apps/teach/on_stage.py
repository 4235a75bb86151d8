"""A lesson without waiting and without a network: the real game and desk, and a script of what is said when."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import torch
from by_hand import plain

from ibe_rl.agents import GreedyPolicy, make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.apps.teach.classroom import Classroom
from ibe_rl.apps.teach.clock import Clock
from ibe_rl.apps.teach.lesson import Lesson, Stage
from ibe_rl.apps.teach.live_explainer import LiveExplainer
from ibe_rl.apps.teach.messages import Message
from ibe_rl.apps.teach.server import Server
from ibe_rl.apps.teach.session import Said, TeachingSession
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.lander_task import X
from ibe_rl.envs.make import make_gym
from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.ibe import ClusterMapping
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.instructors.recorded import LessonWriter
from ibe_rl.predict.simulator import Simulator
from ibe_rl.runtime.ports import free_port
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.task.words import Words

PAGE = 1
HORIZON_STEPS = 5
make_lander = partial(make_gym, LANDER_ID, {})


class Pages:
    """What would have been shown."""

    def __init__(self) -> None:
        self.posts: list[tuple[str, dict[str, Any]]] = []

    def post(self, kind: str, fields: dict[str, Any]) -> None:
        self.posts.append((kind, fields))

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [fields for name, fields in self.posts if name == kind]


class Script:
    """A clock without waiting: ``says[n]`` is what arrives while the game waits for its n-th step, from 0."""

    def __init__(self, desk: TeachingSession):
        self._desk, self.steps, self.became = desk, 0, list[str]()
        self.says: dict[int, list[Message]] = defaultdict(list)

    def wait(self) -> None:
        self.became += [self._desk.hear(PAGE, message) for message in self.says[self.steps]]
        self.steps += 1


class Watching(TeachingSession):
    """A desk that remembers what was taken from it."""

    def __init__(self, hold_steps: int | None = 0, words: Words | None = None):
        super().__init__(LANDER_TASK.instruction_values, hold_steps, speed=1.0, words=words)
        self.taken: list[Said] = []

    def take(self) -> Said:
        self.taken.append(super().take())
        return self.taken[-1]


class Theatre:
    """A lesson on the lander, with a page that instructs."""

    def __init__(
        self,
        folder: Path,
        hold_steps: int | None = 0,
        seed: int = 3,
        speaker: LiveExplainer | None = None,
        words: Words | None = None,
    ):
        self.record, self.pages, self.desk = folder / "lesson.jsonl", Pages(), Watching(hold_steps, words)
        self.desk.join(PAGE)
        game = make_lander()
        if words is not None:
            game.task = replace(LANDER_TASK, phrases=words)  # type: ignore[attr-defined]  # the outermost one is read
        self.clock, self.stage = Script(self.desk), Stage(game)
        self.stage.reset(seed=seed)
        self.speaker = speaker or speaks()[0]
        server, clock = cast(Server, self.pages), cast(Clock, self.clock)
        self.lesson = Lesson(self.stage, self.desk, server, self.speaker, clock, LessonWriter(self.record))


def greedy(seed: int = 0) -> GreedyPolicy:
    """Of an agent that has not been trained yet."""
    torch.manual_seed(seed)
    actions = make_lander().action_space
    return make_agent(DQNConfig(hidden=[8]), LANDER_TASK.observation_size, actions, 1_000).greedy


def speaks(**settings: Any) -> tuple[LiveExplainer, GreedyPolicy]:
    """A speaker, and the policy that it has."""
    policy = greedy()
    return LiveExplainer(policy, Simulator(make_lander, LANDER_TASK.rule, seed=5), **settings), policy


def explainer_state(expressions: tuple[float, ...] = (-1.0, 0.0, 1.0)) -> ExplainerState:
    """Words for small movements to the left and to the right."""
    k = len(expressions)
    where = np.zeros((k, len(LANDER_TASK.state_names)))
    where[:, X] = np.linspace(-0.05, 0.05, k)
    said, ones = np.reshape(expressions, (k, 1)), np.ones(k)
    mapping = ClusterMapping(plain(where.shape[1]), where, said, said, ones, ones, ones, np.arange(k))
    return ExplainerState(mapping, HORIZON_STEPS, LANDER_TASK.phrases)


class Told:
    """Instead of the link: the newest message of each kind."""

    def __init__(self) -> None:
        self.newest: dict[str, Any] = {}

    def tell(self, kind: str, value: Any) -> None:
        self.newest[kind] = value


def make_classroom(folder: Path, task: Task = LANDER_TASK, **settings: Any) -> Classroom:
    """The trainer's end, of a lander."""
    agent = partial(make_agent, DQNConfig(hidden=[8]), 11, make_lander().action_space, 1_000)
    predictor = partial(Simulator.make, PredictorConfig(), make_snapshot_env=make_lander, rule=LANDER_TASK.rule, seed=0)
    config = HumanConfig(**({"speed": None} | settings))
    about = {"name": "lander", "total_frames": 1_000}
    return Classroom(config, free_port(0, 0), folder / "lesson.jsonl", task, agent, predictor, about)


def begun(
    trainer: Classroom, policy: GreedyPolicy, log: TrajectoryLog | None = None, task: Task = LANDER_TASK
) -> Classroom:
    """In a training whose greedy policy this is."""
    cfg = SimpleNamespace(first_refresh_episodes=100)
    run: Any = SimpleNamespace(agent=SimpleNamespace(greedy=policy), task=task, log=log, cfg=cfg)
    trainer.begin(run)
    return trainer
