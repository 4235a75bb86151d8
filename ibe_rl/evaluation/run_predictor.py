"""The predictor that a finished run is explained with: exact, or learnt from its episodes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from dataclasses import fields, replace
from functools import partial
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

import torch

from ibe_rl.config.command_line import given_keys
from ibe_rl.config.limits import check
from ibe_rl.config.settings import EnvConfig, ExplainConfig, PredictorConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.evaluation.trained_run import TrainedRun, open_log
from ibe_rl.predict import KeptPredictor, is_learnt, make_predictor
from ibe_rl.storage.checkpoint import PREDICTOR, as_arrays, load, policies
from ibe_rl.storage.run_folder import CHECKPOINTS
from ibe_rl.types import ConfigError, Policy

PROCESSES = 2
"""Default number of processes that roll out futures."""


@contextmanager
def predictor_of(
    run: TrainedRun, config: PredictorConfig, seed: int, env: EnvConfig | None = None, until_frame: int | None = None
) -> Iterator[KeptPredictor]:
    """Yield a predictor for a run and close it afterwards.

    A learned predictor is loaded if the run was trained with the same one, else learnt from the run's log.

    Args:
        run: provides the policy to predict.
        config: of the predictor.
        seed: of its random numbers.
        env: of an exact predictor; None: that of the run's training.
        until_frame: training frame of its data at the latest; None: the frame of the run's last policy.

    Raises:
        ConfigError: if it can neither be loaded nor learnt.
    """
    make_one = partial(make_snapshot_env, env or run.config.env)
    horizons = [run.horizon_steps, *run.config.mapping.spans_steps]
    made = make_predictor(
        config,
        make_snapshot_env=make_one,
        rule=run.task.rule,
        seed=seed,
        env=run.make_env(),
        horizons_steps=lambda: horizons,
    )
    with closing(made) as predictor:
        if is_learnt(config):
            _prepare(predictor, run, config, run.policy_frame if until_frame is None else until_frame)
        yield predictor


@contextmanager
def shared_predictor(run: TrainedRun, cfg: ExplainConfig, seed: int | None = None) -> Iterator[KeptPredictor]:
    """Yield the predictor of many episodes, with several processes, and close it; ``seed`` None: ``evaluate.seed``."""
    torch.set_num_threads(1)
    config = with_processes(cfg.predictor, processes_for(cfg.predictor.processes, run.policy))
    with predictor_of(run, config, cfg.evaluate.seed if seed is None else seed) as predictor:
        yield predictor


def as_trained(cfg: ExplainConfig, run: TrainedRun, named: Collection[str] | None = None) -> ExplainConfig:
    """The config with the run's own predictor if that is learnt, and its instruction inside rollouts, unless named.

    A single setting such as ``predictor.futures`` changes the run's own predictor; ``predictor=KIND`` chooses another.

    Args:
        cfg: of the explanation.
        run: opened.
        named: the keys that were named; None: those on the command line.

    Raises:
        ConfigError: if the run's own predictor does not allow a value that is named.
    """
    own, told = run.config.predictor, given_keys() if named is None else named
    if is_learnt(own) and not {"predictor", "predictor.kind"} & set(told):
        changes = {name: getattr(cfg.predictor, name) for key in told for name in _setting_of_predictor(key)}
        check(changed := replace(own, **changes), "predictor.")
        return replace(cfg, predictor=changed)
    if "predictor.future_instruction" in told:
        return cfg
    return replace(cfg, predictor=replace(cfg.predictor, future_instruction=own.future_instruction))


def _setting_of_predictor(key: str) -> list[str]:
    return [key.removeprefix("predictor.")] if key.startswith("predictor.") else []


def can_predict(run: TrainedRun, config: PredictorConfig, frame: int) -> bool:
    """Whether a predictor of a training frame is available: saved, or learnable as the log reaches back far enough."""
    if not is_learnt(config) or _kept(run, config, frame):
        return True
    index = open_log(run.folder).index
    until = index[index["frame"] <= frame]
    needed: int = getattr(config, "newest_frames", 0)
    return len(until) > 0 and (until["number"][0] == 0 or int(until["steps"].sum()) >= needed)


def _kept(run: TrainedRun, config: PredictorConfig, frame: int) -> dict[int, Path]:
    """Training frames to the weights saved by then, if the run trained the predictor of ``config``."""
    if _what_is_learnt(config) != _what_is_learnt(run.config.predictor):
        return {}
    return {at: path for at, path in policies(run.folder / CHECKPOINTS, PREDICTOR).items() if at <= frame}


def _prepare(predictor: KeptPredictor, run: TrainedRun, config: PredictorConfig, frame: int) -> None:
    kept = _kept(run, config, frame)
    if kept:
        path = kept[max(kept)]
        try:
            predictor.load_state_dict(as_arrays(load(path)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ConfigError(f"{path}: not a predictor of this run ({' '.join(str(error).split())[:200]})") from None
        return
    try:
        predictor.learn(open_log(run.folder), frame)
    except ValueError as error:
        raise ConfigError(f"predictor={config.kind} with run={run.folder}: it cannot be learnt: {error}") from None


def _what_is_learnt(config: PredictorConfig) -> dict[str, Any]:
    return {item.name: getattr(config, item.name) for item in fields(config) if item.metadata.get("learnt", True)}


def with_processes(config: PredictorConfig, processes: int) -> PredictorConfig:
    """The config with that many processes for the exact predictor, unless it sets another number."""
    return config if is_learnt(config) else replace(config, processes=config.processes or processes)


def processes_for(asked: int | None, policy: Policy) -> int:
    """Number of processes that roll out futures; 1 for a policy that cannot be pickled.

    Raises:
        ConfigError: if more are configured for such a policy.
    """
    if (asked or PROCESSES) == 1 or crosses_processes(policy):
        return asked or PROCESSES
    if asked:
        raise ConfigError(f"predictor.processes={asked}: the agent cannot be sent to other processes; allowed is 1")
    return 1


def crosses_processes(policy: Policy) -> bool:
    """Whether a policy can be pickled for other processes."""
    try:
        sent = bytes(ForkingPickler.dumps(policy))
        return b"__main__" not in sent  # classes of the script itself are unknown in other processes
    except Exception:  # pickling may raise anything
        return False
