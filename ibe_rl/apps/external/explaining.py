"""Explain an externally trained agent: roll it out and learn a vocabulary from its episodes."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.apps.external.adapters import reads_masks
from ibe_rl.apps.external.finding import find_agent, made_without_arguments
from ibe_rl.apps.external.folder import external_run_config, keep_run, print_lines
from ibe_rl.apps.external.policy import EpsilonGreedy, ExternalPolicy, as_policy
from ibe_rl.apps.external.reading import Reading, compared_returns, forgotten, reading_of
from ibe_rl.collect.rollout import play
from ibe_rl.config.command_line import has_default_name
from ibe_rl.config.settings import EnvConfig, ExplainConfig, PredictorConfig, TrainConfig
from ibe_rl.envs.instructed_envs import episode_seed
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.envs.masks import MASKS, has_masks, masks_of
from ibe_rl.envs.wrappers import task_of
from ibe_rl.evaluation.moments import Plan
from ibe_rl.evaluation.rollouts import predict_futures, seeds_for, take_moments
from ibe_rl.evaluation.run_predictor import predictor_of, with_processes
from ibe_rl.evaluation.runs import OF_A_NEW_FOLDER, load_run, open_trained, settings_named
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.evaluation.verbalise import calibrate, speak
from ibe_rl.ibe.interpret import Reactions
from ibe_rl.instructors import make_instructor
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.predict import is_learnt, make_predictor
from ibe_rl.storage.run_folder import REFRESHES, refuse_used
from ibe_rl.storage.whole_folder import unused, whole_folder
from ibe_rl.task import PERCEPT
from ibe_rl.types import ConfigError, Episode, Policy, observe
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_during_rollouts
from ibe_rl.vocabulary.refresh import save_refresh

ENVS_AT_ONCE, EXAMPLES = 16, 5
TASKS = ("episode", "evaluate", "compare", "summary")
CALIBRATION_EPISODES, CALIBRATION_STRIDE_STEPS = 12, 12
"""Together a few hundred moments."""


def open_external(cfg: ExplainConfig) -> TrainedRun:
    """The run of ``explain.py agent=…``: of the folder named there, or of a new one.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if cfg.task not in TASKS:
        raise ConfigError(f"task={cfg.task} with agent=: allowed is {', '.join(TASKS)}; it needs a run of train.py")
    if cfg.run is None:
        return learn_external(cfg.agent_file, cfg, seed=0)
    if superfluous := sorted(OF_A_NEW_FOLDER & settings_named(cfg)):
        raise ConfigError(f"{superfluous[0]}= with run={cfg.run}: allowed only without run=, for a new folder")
    return open_for(cfg.agent_file, cfg)


def open_for(agent: Any, cfg: ExplainConfig, env: EnvConfig | None = None, trusted: Sequence[str] = ()) -> TrainedRun:
    """Open a folder of ``explain_agent``, or of an imported log, for an agent; see ``open_trained``.

    Raises:
        ConfigError: if it is not such a folder, or the agent does not fit.
    """
    torch.set_num_threads(1)
    found = _found(agent)

    def make_policy(config: TrainConfig) -> Policy:
        known = config.agent if isinstance(config.agent, ExternalPolicyConfig) else None
        return _policy(found, config, reading_of(found, cfg, known), cfg.predictor)

    return open_trained(cfg.run, make_policy, env, trusted)


def _found(agent: Any) -> Any:
    return made_without_arguments(find_agent(str(agent)) if isinstance(agent, str | Path) else agent)


def _policy(agent: Any, config: TrainConfig, reading: Reading, predictor: PredictorConfig) -> ExternalPolicy:
    env = make_env(config.env)
    task = task_of(env)
    first = [env.reset(seed=seed) for seed in range(EXAMPLES)]
    states = np.array([state for state, _ in first])
    percepts = np.array([info.get(PERCEPT, state) for state, info in first])
    examples = observe(percepts, task.rule(states), np.ones((EXAMPLES, 1)))
    policy = as_policy(agent, task, env.action_space, reading, examples, [env] * EXAMPLES)
    if reads_masks(policy.agent):
        _check_masks(config.env, config.predictor, predictor)
    elif has_masks(env):
        policy.notes.append(
            f"note: the environment says which actions are allowed ({MASKS}); this agent does not read it"
        )
    return policy


def _check_masks(env: EnvConfig, *predictors: PredictorConfig) -> None:
    """Refuse an agent with masks where its predicted futures would have none."""
    for learnt in filter(is_learnt, predictors):
        raise ConfigError(
            f"predictor={learnt.kind} with an agent that reads masks: a learned predictor has no environment "
            "to ask for them; allowed is predictor=simulator"
        )
    copy = make_snapshot_env(env)
    copy.reset(seed=0)
    masks_of(copy)


def learn_external(agent: Any, cfg: ExplainConfig, seed: int, env: EnvConfig | None = None) -> TrainedRun:
    """Roll out an agent and learn a vocabulary from its episodes; see ``ibe_rl.explain_agent``.

    Args:
        agent: or its name.
        cfg: of the explanation.
        seed: of the episodes and of the clustering.
        env: that a program gave; None: that of the settings.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    torch.set_num_threads(1)
    if has_default_name():
        cfg = replace(cfg, run_dir=str(unused(Path(cfg.run_dir))))
    found = _found(agent)
    reading = reading_of(found, cfg)
    made_from = agent if isinstance(agent, str | Path) else type(agent).__name__
    config = external_run_config(cfg, made_from, seed, env, reading)
    policy = _policy(found, config, reading, cfg.predictor)
    if not is_learnt(cfg.predictor):
        make_snapshot_env(config.env)  # refused before anything is flown
    print_lines(*forgotten(agent, reading), *policy.notes)
    refuse_used(Path(cfg.run_dir))
    episodes = _act(policy, config, cfg)
    print_lines(*_clipped(policy), *([] if cfg.random_actions else compared_returns(found, episodes)))
    rows, seeds = sum(len(episode) + 1 for episode in episodes), _seeds(config, len(episodes))
    with whole_folder(Path(cfg.run_dir)) as folder:
        learnt = keep_run(folder, config, episodes, rows, partial(_reactions, policy, config, episodes), seeds)
        run = load_run(folder, lambda _: policy, env)
        run = replace(run, calibration=first_calibration(run, cfg), folder=Path(cfg.run_dir))
        save_refresh(folder / REFRESHES, learnt, run.config.mapping, run.task, run.calibration)
    return run


def _clipped(policy: ExternalPolicy) -> list[str]:
    if not policy.clipped:
        return []
    return [f"note: actions of the agent lie outside {policy.actions}, such as {policy.clipped[0]:g}; they are clipped"]


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
        return ask_during_rollouts(envs, policy, instructor, predictor, seeds, typical_steps, horizon_steps)


def _act(policy: Policy, config: TrainConfig, cfg: ExplainConfig) -> list[Episode]:
    """Roll out the agent, with the instructions of the environment's rule recorded."""
    envs = [make_env(config.env) for _ in range(min(ENVS_AT_ONCE, cfg.episodes))]
    acting = (
        EpsilonGreedy(policy, cfg.random_actions, envs[0].action_space, config.seed) if cfg.random_actions else policy
    )
    instructor = make_instructor(config.instructor, task_of(envs[0]), config.seed)
    return play(envs, acting, instructor, _seeds(config, cfg.episodes))


def _seeds(config: TrainConfig, episodes: int) -> list[int]:
    return [episode_seed(config.seed, number) for number in range(episodes)]
