"""The predictor that a finished run is explained with: the exact one, or one that was learnt from its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from ibe_rl.config.command_line import load_config, named_settings
from ibe_rl.config.settings import EnvConfig, ExplainConfig, PredictorConfig, TrainConfig
from ibe_rl.envs.snapshots import make_copy
from ibe_rl.evaluation.refit import open_log
from ibe_rl.evaluation.runs import TrainedRun
from ibe_rl.predict import KeptPredictor, is_learnt, make_predictor
from ibe_rl.storage.checkpoint import PREDICTOR, as_arrays, load, policies
from ibe_rl.storage.run_folder import CHECKPOINTS, CONFIG, find_run, refuse_special_files
from ibe_rl.types import ConfigError


@contextmanager
def predictor_of(
    run: TrainedRun, config: PredictorConfig, seed: int, env: EnvConfig | None = None, until_frame: int | None = None
) -> Iterator[KeptPredictor]:
    """A predictor for a run, closed at the end.

    One that is learnt is read from the run if it was trained with the same one, and else learnt from its log.

    Args:
        run: whose policy is followed.
        config: of the predictor.
        seed: of its chance.
        env: where an exact one plays; None: where the run was trained.
        until_frame: as it was at this frame of the training; None: as that of the run's last policy.

    Raises:
        ConfigError: if it can neither be read nor learnt.
    """
    make_one = partial(make_copy, env or run.config.env)
    horizons = [run.horizon_steps, *run.config.mapping.spans_steps]
    making = config, make_one, run.task.rule, seed, run.make_env()
    with closing(make_predictor(*making, lambda: horizons)) as predictor:
        if is_learnt(config):
            _prepare(predictor, run, config, run.policy_frame if until_frame is None else until_frame)
        yield predictor


def as_trained(cfg: ExplainConfig) -> ExplainConfig:
    """The same with the predictor that the run learnt, unless another one is named; only inside ``run_script``."""
    if "predictor" in named_settings() or (cfg.agent_file is not None and cfg.run is None):
        return cfg
    folder = find_run(cfg.run, Path("runs"))
    refuse_special_files(folder)
    own: PredictorConfig = load_config(folder / CONFIG, TrainConfig).predictor
    return replace(cfg, predictor=own) if is_learnt(own) else cfg


def can_foresee(run: TrainedRun, config: PredictorConfig, frame: int) -> bool:
    """Whether a predictor as of a frame of the training can be had: it was kept, or the log reaches back far enough."""
    if not is_learnt(config) or _kept(run, config, frame):
        return True
    index = open_log(run).index
    until = index[index["frame"] <= frame]
    needed: int = getattr(config, "newest_frames", 0)
    return len(until) > 0 and (until["number"][0] == 0 or int(until["steps"].sum()) >= needed)


def _kept(run: TrainedRun, config: PredictorConfig, frame: int) -> dict[int, Path]:
    """Training frames to the weights kept by then, if what the run learnt is what ``config`` asks for."""
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
        predictor.learn(open_log(run), frame)
    except ValueError as error:
        raise ConfigError(f"predictor={config.kind} with run={run.folder}: it cannot be learnt: {error}") from None


def _what_is_learnt(config: PredictorConfig) -> dict[str, Any]:
    return {item.name: getattr(config, item.name) for item in fields(config) if item.metadata.get("learnt", True)}


def with_processes(config: PredictorConfig, processes: int) -> PredictorConfig:
    """The exact one sharing its moments among so many, unless something else is asked for."""
    return config if is_learnt(config) else replace(config, processes=config.processes or processes)
