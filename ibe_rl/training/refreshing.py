"""Relearns the vocabulary during training; training continues if that fails."""

from __future__ import annotations

from collections.abc import Sequence
from traceback import format_exception

import numpy as np
from torchrl import timeit

from ibe_rl.collect.rollout import EVALUATION_SEED
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.errors import GateError
from ibe_rl.explain.phrasing import Asking, ExplainerState
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.instructors import speaks
from ibe_rl.metrics.quality import outcomes
from ibe_rl.metrics.stability import stability
from ibe_rl.predict import asks_policy, is_learnt
from ibe_rl.runtime.printed import raised
from ibe_rl.storage.checkpoint import PREDICTOR, as_tensors, save_policy
from ibe_rl.storage.run_folder import CHECKPOINTS, REFRESHES, write_atomically
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.training.run import Run
from ibe_rl.types import Explanation
from ibe_rl.vocabulary.listener import Refreshed
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_during_rollouts
from ibe_rl.vocabulary.refresh import Refresh
from ibe_rl.vocabulary.refresh_columns import figures
from ibe_rl.vocabulary.rule_reads import lead_on

ASKING_SEED = EVALUATION_SEED + 100_000


def learn(run: Run) -> Refresh:
    """Relearn the vocabulary from the current log, or leave everything as it was.

    Raises:
        TooLittleDataError: if the log holds too little.
    """
    vocabulary, counts = run.vocabulary, run.counts
    with vocabulary.all_or_nothing():
        with timeit("refresh"):
            horizon_steps = vocabulary.settle(run.log)
        with timeit("explain"):
            learn_to_predict(run)
            reactions = ask_otherwise(run, horizon_steps)
        with timeit("refresh"):
            refresh = vocabulary.refresh(run.log, run.agent.greedy, reactions)
            vocabulary.save(run.folder / REFRESHES, refresh)
    counts.refreshes += refresh.taken
    counts.kept += not refresh.taken
    return refresh


def learn_to_predict(run: Run) -> None:
    """Fit the predictor to the current log, save its weights and clear its other state."""
    run.predictor.learn(run.log)
    if is_learnt(run.cfg.predictor):
        state = as_tensors(run.predictor.state_dict())
        save_policy(run.folder / CHECKPOINTS, run.log.frames, state, PREDICTOR)
    run.predictor.forget()  # so that a resumed run predicts the same


def ask_otherwise(run: Run, horizon_steps: int) -> Reactions | None:
    """How the greedy policy reacts to opposite instructions; None if it cannot be asked, as of words.

    Each moment is from a different episode, on seeds never trained on.
    """
    if run.task.words is not None or not asks_policy(run.cfg.predictor) or not len(run.log.index):
        return None
    first = ASKING_SEED + ASKED_AT * (run.counts.tried + run.counts.skipped)
    typical_steps, seeds = int(np.median(run.log.index["steps"][-200:])), range(first, first + ASKED_AT)
    return ask_during_rollouts(
        run.evaluation_envs,
        run.agent.greedy,
        run.instructor,
        run.predictor,
        seeds=seeds,
        typical_steps=typical_steps,
        horizon_steps=horizon_steps,
    )


def asking_of(cfg: TrainConfig, task: Task) -> Asking | None:
    """What else the agent is told at the moments that it explains; nothing where nobody speaks."""
    if cfg.what_if_every_steps is None or not speaks(cfg.instructor):
        return None
    return Asking(values_of(task), max(1, cfg.what_if_every_steps // cfg.explain_every_steps), futures=1)


def skip(run: Run, error: Exception) -> dict[str, float]:
    """Keep the previous vocabulary after an error; returns columns of metrics.csv.

    Raises:
        GateError: if it is one, as nothing goes on without the environment.
    """
    if isinstance(error, GateError):
        raise error
    frames, reason = run.log.frames, str(error)
    if not isinstance(error, TooLittleDataError):
        path = run.folder / REFRESHES / f"failed_{frames:012d}.txt"
        write_atomically(path, lambda stream: stream.write("".join(format_exception(error)).encode()))
        reason = f"it failed ({type(error).__name__}: {' '.join(reason.split())[:200]}), the details are in {path}"
    run.counts.skipped += 1
    if run.vocabulary.mapping is None and speaks(run.cfg.instructor):
        reason += lead_on(run.cfg.mapping, run.counts.skipped)
    run.tell.skipped(frames, reason)
    return {"ibe/skipped": run.counts.skipped}


def judge_and_tell(
    run: Run, refresh: Refresh, rollout: RecordedRollout, said: Sequence[Explanation], explainer: ExplainerState
) -> dict[str, float]:
    """Score the explanations of an episode and notify the listeners; returns columns of metrics.csv."""
    with timeit("explain"):
        row = figures(refresh) | run.vocabulary.judge(refresh, rollout.episode, said, run.cfg.explain_every_steps)
        real = outcomes(rollout.episode, explainer.horizon_steps, explainer.mapping, explainer.words)
    event = Refreshed(
        frames=run.log.frames,
        number=run.counts.refreshes,
        refresh=refresh,
        rollout=rollout,
        said=said,
        real=real,
        explainer=explainer,
        came_true=row["ibe/came_true"],
    )
    run.tell.refreshed(event)
    return row | listening_row(said) | stability_row(said) | measured(run, event)


def listening_row(said: Sequence[Explanation]) -> dict[str, float]:
    """How much the agent listens, on the average of an episode; empty if it was not asked."""
    asked = [one.listens for one in said if one.listens is not None]
    return {"ibe/listens": float(np.mean(asked))} if asked else {}


def stability_row(said: Sequence[Explanation]) -> dict[str, float]:
    """How still what is said holds in an episode."""
    return {f"ibe/{name}": value for name, value in stability([one.phrase for one in said]).items()}


def measured(run: Run, event: Refreshed) -> dict[str, float]:
    """The columns of the user's own metrics; one that raises is named and dropped."""
    row: dict[str, float] = {}
    for metric in [*run.metrics]:
        try:
            found = metric(event)
            row |= {name: float(found[name]) for name in metric.columns}
        except Exception as error:  # user code may raise anything
            run.metrics.remove(metric)
            run.say(
                f"warning: the metric {type(metric).__name__} failed ({raised(error)}): it is not computed any more"
            )
    return row
