"""The run folder of an external agent or log: its config, its episodes and the vocabulary learnt from them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.apps.external.reading import Reading
from ibe_rl.config.command_line import composed
from ibe_rl.config.saved import write_config
from ibe_rl.config.settings import EnvConfig, ExplainConfig, TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.trial import try_out
from ibe_rl.envs.wrappers import task_of
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import REFRESHES, SUMMARY, TRAJECTORIES, write_json
from ibe_rl.types import ConfigError, Episode
from ibe_rl.vocabulary.fitting import check_mapping, learn_vocabulary
from ibe_rl.vocabulary.refresh import Refresh, save_refresh
from ibe_rl.vocabulary.rule_reads import check_dimensions
from ibe_rl.vocabulary.settled_horizon import horizon_of
from ibe_rl.vocabulary.training_episodes import find_steps, horizon_line, settled


def external_run_config(
    cfg: ExplainConfig, made_from: Any, seed: int, env: EnvConfig | None = None, reading: Reading | None = None
) -> TrainConfig:
    """The config of the run folder of an external agent or log.

    Args:
        cfg: of the explanation.
        made_from: what the agent or log is called.
        seed: of the run.
        env: that a program gave; None: that of the settings.
        reading: what the agent reads; None: unknown.

    Raises:
        ConfigError: if the mapping cannot be learnt in this environment.
    """
    config = composed("train", [*cfg.guest_settings, f"seed={seed}"])
    config = replace(config, env=env or config.env)
    made = make_env(config.env)
    check_mapping(config.mapping, task_of(made))
    notes = [*try_out(config.env, simulated=False), *check_dimensions(config.mapping, task_of(made), made)]
    print_lines(*(f"note: {note}" for note in notes))
    return replace(
        config,
        run_dir=cfg.run_dir,
        agent=ExternalPolicyConfig(
            made_from=str(made_from),
            sees_instruction=cfg.agent_sees_instruction,
            frame_stack=reading.frames if reading and reading.frames > 1 else None,
            vec_normalize=reading.normalised_by if reading else None,
        ),
        mapping=replace(config.mapping, newest_frames=None),  # one agent made all episodes
        predictor=cfg.predictor,
        viewer=cfg.viewer,
    )


SEEDS = "seeds.json"
"""The seeds of the episodes, where they are known."""


def keep_run(
    folder: Path,
    config: TrainConfig,
    episodes: Iterable[Episode],
    rows: int,
    react: Callable[[int], Reactions | None] = lambda _: None,
    seeds: Sequence[int | None] = (),
) -> Refresh:
    """Fill a run folder with episodes and the vocabulary learnt from them.

    Args:
        folder: from ``whole_folder``.
        config: from ``external_run_config``.
        episodes: read once.
        rows: number of states in all episodes, final states included.
        react: horizon in steps to the agent's reactions to other instructions; None if it cannot be asked.
        seeds: of the episodes, read after them; None where it is unknown.

    Returns:
        the refresh.

    Raises:
        ConfigError: if no vocabulary can be learnt.
    """
    task = task_of(make_env(config.env))
    log = TrajectoryLog(folder / TRAJECTORIES, rows, task.contexts)
    for episode in episodes:
        log.add(episode.as_steps(), task.context)
    log.flush()
    if any(seed is not None for seed in seeds):
        write_json(folder / SEEDS, {"seeds": list(seeds)})
    config = replace(config, total_frames=log.frames)
    write_config(config, [], folder / ".hydra")
    index = log.index
    summary = {
        "frames": log.frames,
        "episodes": log.episodes_ended,
        "success_rate": float(np.mean(index["success"])),
        "return_mean": float(np.mean(index["total_reward"])),
        "seed": config.seed,
        "agent": config.agent.kind,
        "mapping": config.mapping.kind,
        "versions": {name: version(name) for name in ("ibe_rl", "torch", "gymnasium", "scikit-learn")},
    }
    write_json(folder / SUMMARY, summary)
    try:
        with threadpool_limits(1):  # as in the scripts: the last digits depend on it
            mapping = settled(config.mapping, find_steps(log, config.mapping, task, config.seed))
            learnt = learn_vocabulary(log, mapping, task, config.seed, reactions=react(horizon_of(mapping)))
    except TooLittleDataError as error:
        raise ConfigError(
            f"episodes={len(index)}: no vocabulary can be learnt from them ({error}); allowed are more"
        ) from None
    if config.mapping.horizon_steps is None:
        print_lines(horizon_line(learnt.top.horizon_steps))
    meaning = [one.to_dict() for one in learnt.mapping.meanings]
    write_json(folder / SUMMARY, summary | {"horizon_steps": learnt.top.horizon_steps, "meaning": meaning})
    save_refresh(folder / REFRESHES, learnt, mapping, task)
    return learnt


def print_lines(*lines: str) -> None:
    """Print lines as they are."""
    for line in lines:
        PlainConsole(soft_wrap=True).print(line)
