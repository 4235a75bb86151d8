"""``task=predictors``: compare explanations made with learned predictors with those of the exact one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ibe_rl.config.hydra_setup import choices
from ibe_rl.config.settings import ExplainConfig, PredictorConfig
from ibe_rl.evaluation import figures, report, tables
from ibe_rl.evaluation.baselines import Learnt, StateRegressor, fit_state_regressors
from ibe_rl.evaluation.judging import judge, rows_of
from ibe_rl.evaluation.moments import Moments, Plan
from ibe_rl.evaluation.observers import add_errors, observe_all
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.rollouts import predict_futures, seeds_for, take_moments
from ibe_rl.evaluation.rows import Judged, difference, estimate_json
from ibe_rl.evaluation.run_predictor import PROCESSES, can_predict, predictor_of, with_processes
from ibe_rl.evaluation.runs import kept_policies, kept_refreshes
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.storage.checkpoint import BETWEEN, EVALUATED
from ibe_rl.storage.run_folder import EVALUATION, FIGURES, write_json
from ibe_rl.types import Policy
from ibe_rl.vocabulary.refresh import Saved

EXACT, AGAIN = "simulator", "simulator_again"
"""The exact predictor, and the same with another seed: the upper bound of agreement for the others."""
_OURS = "ibe:own"
PAIRED = ("motion_auc", "motion_auc_disobeyed", "motion_spearman", "came_true", "came_true_voted", "ece")
"""Metrics reported as a paired difference to the exact predictor."""


@dataclass(frozen=True)
class Age:
    """The agent at one refresh.

    Attributes:
        saved: the vocabulary learnt at this refresh.
        policy_frame: training frames of the saved policy nearest to it.
        policy: that policy.
        episodes: number to evaluate on.
        held_out: number of other episodes, to calibrate the confidence.
    """

    saved: Saved
    policy_frame: int
    policy: Policy
    episodes: int
    held_out: int


def judge_predictors(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Explain the same moments with every predictor, at each refresh, and evaluate the explanations.

    Raises:
        ConfigError: before any episode, if the run lacks a needed file.
    """
    seed, own = cfg.evaluate.seed, run.config.predictor
    kinds = choices("predictor") | {own.kind: own} | {cfg.predictor.kind: cfg.predictor}
    heard = Refits(run, seed).lessons(run.config.mapping).heard
    regressors = fit_state_regressors(heard, run.horizon_steps, run.task, seed)
    report.make_folders(run.folder)
    rows = [row for age in ages_of(run, cfg) for row in judge_age(run, age, kinds, regressors, cfg)]
    path = run.folder / EVALUATION / "predictors.json"
    write_json(path, {"protocol": report.common_protocol(run, cfg, rows[-1]["moments"]), "rows": rows})
    drawn = figures.save(figures.predictors(rows, run.horizon_steps), run.folder / FIGURES / "predictors.png")
    console = tables.console()
    newest = [row for row in rows if row["frame"] == rows[-1]["frame"]]
    console.print(tables.predictors_table(newest, f"{run.folder.name}, frame {newest[0]['frame']:,}"))
    console.print(tables.predictors_over_training(rows))
    console.print(f"numbers: {path}\nfigure: {drawn}", soft_wrap=True)


def ages_of(run: TrainedRun, cfg: ExplainConfig) -> list[Age]:
    """The agent at each saved refresh, oldest first; only the newest if ``evaluate.changing_episodes`` is 0."""
    config, kept = cfg.evaluate, kept_policies(run, EVALUATED, BETWEEN)
    refreshes = [saved for saved in kept_refreshes(run).values() if saved.horizon_steps == run.horizon_steps]
    usable = [saved for saved in refreshes if saved.frame <= run.mapping_frame]
    ages = []
    for saved in usable:
        frame = min(kept, key=lambda at: abs(at - saved.frame))
        ages.append(Age(saved, frame, kept[frame], config.changing_episodes, max(2, config.changing_episodes // 2)))
    newest = Age(usable[-1], run.policy_frame, run.policy, config.episodes, config.calibration_episodes)
    return [*(ages[:-1] if config.changing_episodes else []), newest]


def judge_age(
    run: TrainedRun,
    age: Age,
    kinds: dict[str, PredictorConfig],
    regressors: Sequence[StateRegressor],
    cfg: ExplainConfig,
) -> list[dict[str, Any]]:
    """A row for each predictor that is available at this refresh, the exact one first."""
    config, n, rows = cfg.evaluate, run.horizon_steps, []
    exact: Judged | None = None
    for name, moments, held_out in predicted_by_each(run, age, kinds, cfg):
        here = moments.judged()
        weights = episode_weights(here.episode, config.resamples, config.seed)
        learnt = Learnt({_OURS: age.saved.mapping}, {}, regressors)
        judged = judge(learnt, here, held_out.judged(), n, run.task, weights, config.seed)
        exact = exact or judged
        row = next(row for row in rows_of(judged) if row["explainer"] == _OURS)
        change = held_out.real_change(n, run.task.explained)
        vocabularies = {_OURS: [age.saved.mapping]}
        samples, _ = observe_all(moments, change, n, run.task, vocabularies, config.resamples, config.seed)
        add_errors([row], samples, n)
        about = {"frame": age.saved.frame, "policy_frame": age.policy_frame, "predictor": name, "moments": len(here)}
        rows.append(about | beside_exact(judged, exact, here, weights) | {k: row[k] for k in row if k != "explainer"})
    return rows


def beside_exact(judged: Judged, exact: Judged, moments: Moments, weights: Any) -> dict[str, Any]:
    """Agreement with the phrases of the exact predictor, over all moments and where the predictor trusts itself."""
    same = judged.spoken[_OURS].phrase == exact.spoken[_OURS].phrase
    trusted = moments.trusted[:, :, -1].all(axis=1)
    hits = {"equal": same, "trusted": trusted}
    shares: dict[str, Any] = {name: estimate_json(weighted_mean(values, weights)) for name, values in hits.items()}
    parts = {"equal_trusted": trusted, "equal_not_trusted": ~trusted}
    shares |= {
        name: estimate_json(weighted_mean(same[rows], weights[:, rows])) if rows.any() else None
        for name, rows in parts.items()
    }
    ours, theirs = judged.samples[_OURS], exact.samples[_OURS]
    return shares | {f"{metric}_minus_exact": difference(ours, theirs, metric) for metric in PAIRED}


def predicted_by_each(
    run: TrainedRun, age: Age, kinds: dict[str, PredictorConfig], cfg: ExplainConfig
) -> Iterator[tuple[str, Moments, Moments]]:
    """The same moments, evaluated and held out, with the futures of each predictor; the exact one first, twice."""
    config = cfg.evaluate
    plan = Plan(config.stride_steps, 1, (run.horizon_steps,), run.horizon_steps)
    judged = take_moments(run, age.policy, seeds_for("judged", config.seed, age.episodes), plan)
    unobserved = replace(plan, observer_steps=None)
    held_out = take_moments(run, age.policy, seeds_for("held_out", config.seed, age.held_out), unobserved)
    for name in [EXACT, AGAIN, *(kind for kind in kinds if kind != EXACT)]:
        settings = with_processes(kinds[EXACT if name == AGAIN else name], PROCESSES)
        seed, title = config.seed + (name == AGAIN), f"{name} at frame {age.saved.frame:,}"
        if not can_predict(run, settings, age.saved.frame):
            continue
        with predictor_of(run, settings, seed, until_frame=age.saved.frame) as predictor:
            ahead = replace(plan, futures=settings.futures)
            first = predict_futures(judged, age.policy, predictor, ahead, title)
            second = predict_futures(held_out, age.policy, predictor, ahead, title)
        yield name, first, second
