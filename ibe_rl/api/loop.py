"""Resume a run, and run the loop of ``train.py`` for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from ibe_rl.api.settings import env_config
from ibe_rl.config.arguments import quoted
from ibe_rl.config.command_line import composed
from ibe_rl.config.overrides import as_overrides, kind_name
from ibe_rl.envs.given import GivesEnv
from ibe_rl.runtime.installation import shipped
from ibe_rl.task import Task
from ibe_rl.training.build import build
from ibe_rl.training.resume import Resumption
from ibe_rl.training.run import Run
from ibe_rl.vocabulary.listener import Listener


@contextmanager
def resume(
    folder: str | Path,
    *changes: str,
    env: str | GivesEnv | None = None,
    task: Task | None = None,
    listeners: Sequence[Listener] = (),
    metrics: Sequence[Any] = (),
    trusted: Sequence[str | type] = (),
    **values: Any,
) -> Iterator[Run]:
    """Continue a run that was stopped or killed, as ``train.py resume=FOLDER``; see ``ibe_rl.build``.

    Args:
        folder: of the run.
        changes: settings to change, as on the command line.
        env: as in ``ibe_rl.settings``; needed if the run was given one.
        task: of that environment; None: its own attribute ``task``.
        listeners: objects to notify; those of the run's settings are made anew.
        metrics: objects that add columns at each refresh.
        trusted: kinds whose code may be run although no config file names them: classes, or ``module:Class``.
        values: settings to change, by name.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    known = env_config(env, task)
    names = [kind_name("trusted", one) for one in trusted]
    resumption = Resumption([*changes, *as_overrides(values)], known, names)
    cfg = composed("train", [f"resume={quoted(str(folder))}"])
    with build(cfg, listeners=listeners, metrics=metrics, resumption=resumption) as run:
        yield run


def train(run: Run) -> dict[str, Any]:
    """Run the loop of ``train.py`` to its end: collect, learn, log, refresh, explain, evaluate.

    Args:
        run: from ``ibe_rl.build`` or ``ibe_rl.resume``.

    Returns:
        the contents of summary.json.
    """
    summary: dict[str, Any] = _loop()(run)
    return summary


@cache
def _loop() -> Callable[[Run], dict[str, Any]]:
    """The function ``train`` of train.py, which is no module of the package."""
    spec = spec_from_file_location("ibe_rl_train_script", shipped("train.py"))
    assert spec is not None
    assert spec.loader is not None
    script = module_from_spec(spec)
    spec.loader.exec_module(script)
    loop: Callable[[Run], dict[str, Any]] = script.train
    return loop
