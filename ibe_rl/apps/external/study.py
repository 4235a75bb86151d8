"""Explain an externally trained agent: roll it out and learn a vocabulary from its episodes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.apps.external.folder import external_run_config, keep_run
from ibe_rl.apps.external.policy import EpsilonGreedy, as_policy, find_agent
from ibe_rl.collect.rollout import play
from ibe_rl.config.command_line import composed
from ibe_rl.config.hydra_setup import settings_at_hand
from ibe_rl.config.limits import check
from ibe_rl.config.settings import ExplainConfig, TrainConfig
from ibe_rl.envs.make import episode_seed, make_env, make_snapshot_env, task_of
from ibe_rl.evaluation.evaluate import evaluate
from ibe_rl.evaluation.moments import Plan
from ibe_rl.evaluation.narration import check_context, explain_rollout, print_narration
from ibe_rl.evaluation.rollouts import predict_futures, seeds_for, take_moments
from ibe_rl.evaluation.run_predictor import predictor_of, with_processes
from ibe_rl.evaluation.runs import OF_A_NEW_FOLDER, load_run, open_run, settings_named
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.evaluation.verbalise import calibrate, speak
from ibe_rl.ibe.interpret import Reactions
from ibe_rl.instructors import make_instructor
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.predict import is_learnt, make_predictor
from ibe_rl.storage.run_folder import EVALUATION, REFRESHES, create_run_folder, read_json
from ibe_rl.task import RecordedRollout
from ibe_rl.types import ConfigError, Episode, Explanation, Policy, observe
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_in_flight
from ibe_rl.vocabulary.refresh import save_refresh

ENVS_AT_ONCE, EXAMPLES = 16, 3
TASKS = ("episode", "evaluate", "compare")
CALIBRATION_EPISODES, CALIBRATION_STRIDE_STEPS = 12, 12
"""Together a few hundred moments."""


@dataclass(frozen=True)
class Narration:
    """An explained episode; prints as a table.

    Attributes:
        run: the run of the agent.
        watched: the episode, with all its moments.
        said: the explanation at each step.
    """

    run: TrainedRun
    watched: RecordedRollout
    said: Sequence[Explanation]

    def __str__(self) -> str:
        stream = io.StringIO()
        print_narration(self.run, self.watched, self.said, Console(file=stream, highlight=False))
        return stream.getvalue()


@dataclass(frozen=True)
class Study:
    """An agent and the vocabulary learnt from its episodes; ``run.folder`` holds all but the agent.

    Attributes:
        run: as if opened from a run of ``train.py``.
        config: settings of the explanation.
    """

    run: TrainedRun
    config: ExplainConfig

    def explain(self, seed: int = 0, context: str | None = None) -> Narration:
        """Roll out one more episode and explain each step.

        Args:
            seed: of the episode.
            context: of the episode; None draws one.

        Raises:
            ConfigError: for an unknown context.
        """
        check_context(context, self.run)
        torch.set_num_threads(1)
        return Narration(self.run, *explain_rollout(self.run, replace(self.config, seed=seed, context=context)))

    def evaluate(self) -> Any:
        """Evaluate the explanations, as ``task=evaluate``: prints tables, writes ``evaluation/`` and ``figures/``.

        Returns:
            the contents of ``evaluation/quality.json``.
        """
        with settings_at_hand():
            evaluate(self.run, self.config)
        return read_json(self.run.folder / EVALUATION / "quality.json")


def study(
    agent: Any,
    env: str | None = None,
    *,
    episodes: int = 200,
    random_actions: float = 0.0,
    agent_sees_instruction: bool | None = None,
    run_dir: str | Path | None = None,
    seed: int = 0,
    settings: Sequence[str] = (),
) -> Study:
    """Learn a vocabulary from episodes of any agent, to explain it.

    Args:
        agent: a ``.zip`` of stable-baselines3 (loading it runs code), ``module:name``, a model of that library, a
            policy module of TorchRL, or a function from observations ``(N, ·)``, or one ``(·,)``, to actions.
        env: a choice of ``configs/env``; None takes that of ``configs/explain.yaml``.
        episodes: how many to roll out.
        random_actions: share of random actions in them, where all episodes would be alike otherwise.
        agent_sees_instruction: whether the agent reads the instruction after the state; None takes it from the agent.
        run_dir: the folder to make; None makes one below ``runs/``.
        seed: of the episodes and of the clustering.
        settings: of ``explain.py``, as on its command line, such as ``"mapping.horizon_steps=40"``.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    config: ExplainConfig = composed("explain", [*([f"env={env}"] if env else []), *settings])
    folder = run_dir or datetime.now().astimezone().strftime("runs/%Y-%m-%d_%H-%M-%S")
    config = replace(
        config,
        episodes=episodes,
        random_actions=random_actions,
        agent_sees_instruction=agent_sees_instruction,
        run_dir=str(folder),
    )
    check(config)
    return Study(_study(agent, config, seed), config)


def open_study(run: str | Path, agent: Any, settings: Sequence[str] = ()) -> Study:
    """Open a folder made by ``study``, or by the import of a log, for an agent.

    Args:
        run: the folder.
        agent: as in ``study``.
        settings: as in ``study``.

    Raises:
        ConfigError: if it is not such a folder, or the agent does not fit.
    """
    config = replace(composed("explain", settings), run=str(run))
    return Study(_open(agent, config), config)


def open_external(cfg: ExplainConfig) -> TrainedRun:
    """The run of ``explain.py agent=…``: of the folder named there, or of a new one.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if cfg.task not in TASKS:
        raise ConfigError(f"task={cfg.task} with agent=: allowed is {', '.join(TASKS)}; it needs a run of train.py")
    if cfg.run is None:
        return _study(cfg.agent_file, cfg, seed=0)
    if superfluous := sorted(OF_A_NEW_FOLDER & settings_named(cfg)):
        raise ConfigError(f"{superfluous[0]}= with run={cfg.run}: allowed only without run=, for a new folder")
    return _open(cfg.agent_file, cfg)


def _open(agent: Any, cfg: ExplainConfig) -> TrainedRun:
    torch.set_num_threads(1)
    found = _found(agent)

    def make_policy(config: TrainConfig) -> Policy:
        sees = cfg.agent_sees_instruction
        known = config.agent.sees_instruction if isinstance(config.agent, ExternalPolicyConfig) else None
        return _policy(found, config, known if sees is None else sees)

    return open_run(cfg.run, make_policy)


def _found(agent: Any) -> Any:
    return find_agent(str(agent)) if isinstance(agent, str | Path) else agent


def _policy(agent: Any, config: TrainConfig, sees_instruction: bool | None) -> Policy:
    env = make_env(config.env)
    task = task_of(env)
    states = np.array([env.reset(seed=seed)[0] for seed in range(EXAMPLES)])
    examples = observe(states, task.rule(states), np.ones((EXAMPLES, 1)))
    return as_policy(agent, task, env.action_space, sees_instruction, examples)


def _study(agent: Any, cfg: ExplainConfig, seed: int) -> TrainedRun:
    torch.set_num_threads(1)
    found = _found(agent)
    config = external_run_config(cfg, agent if isinstance(agent, str | Path) else type(agent).__name__, seed)
    policy = _policy(found, config, cfg.agent_sees_instruction)
    folder = create_run_folder(Path(cfg.run_dir))
    episodes = _act(policy, config, cfg)
    rows = sum(len(episode) + 1 for episode in episodes)
    learnt = keep_run(folder, config, episodes, rows, partial(_reactions, policy, config, episodes))
    run = load_run(folder, lambda _: policy)
    run = replace(run, calibration=first_calibration(run, cfg))
    save_refresh(folder / REFRESHES, learnt, run.config.mapping, run.task, run.calibration)
    return run


def first_calibration(run: TrainedRun, cfg: ExplainConfig) -> Calibration | None:
    """Calibrate the confidence on a few held-out episodes.

    ``task=evaluate`` replaces it, with more episodes.

    Returns:
        None where the future cannot be predicted exactly, or there was no explanation.
    """
    if is_learnt(cfg.predictor) or not _can_be_copied(run):
        return None
    plan, seed = Plan(CALIBRATION_STRIDE_STEPS, cfg.predictor.futures, (run.horizon_steps,)), cfg.evaluate.seed
    taken = take_moments(run, run.policy, seeds_for("held_out", seed, CALIBRATION_EPISODES), plan)
    with predictor_of(run, with_processes(cfg.predictor, 1), seed) as predictor:
        moments = predict_futures(taken, run.policy, predictor, plan, "how sure it can be").judged()
    return calibrate(speak(run.mapping, moments, run.horizon_steps, run.task.phrases)) if len(moments) else None


def _can_be_copied(run: TrainedRun) -> bool:
    try:
        make_snapshot_env(run.config.env)
    except ConfigError:
        return False
    return True


def _reactions(
    policy: Policy, config: TrainConfig, episodes: Sequence[Episode], horizon_steps: int
) -> Reactions | None:
    """The agent's reactions to other instructions, if a predictor needs no training for it."""
    if is_learnt(config.predictor):
        return None
    envs = [make_env(config.env) for _ in range(ASKED_AT)]
    task, typical_steps = task_of(envs[0]), int(np.median([len(episode) for episode in episodes]))
    seeds = [episode_seed(config.seed, len(episodes) + number) for number in range(ASKED_AT)]
    instructor, copies = make_instructor(config.instructor, task, config.seed), partial(make_snapshot_env, config.env)
    with closing(make_predictor(config.predictor, copies, task.rule, config.seed, envs[0], list)) as predictor:
        return ask_in_flight(envs, policy, instructor, predictor, seeds, typical_steps, horizon_steps)


def _act(policy: Policy, config: TrainConfig, cfg: ExplainConfig) -> list[Episode]:
    """Roll out the agent, with the instructions of the environment's rule recorded."""
    envs = [make_env(config.env) for _ in range(min(ENVS_AT_ONCE, cfg.episodes))]
    acting = (
        EpsilonGreedy(policy, cfg.random_actions, envs[0].action_space, config.seed) if cfg.random_actions else policy
    )
    instructor = make_instructor(config.instructor, task_of(envs[0]), config.seed)
    return play(envs, acting, instructor, [episode_seed(config.seed, number) for number in range(cfg.episodes)])
