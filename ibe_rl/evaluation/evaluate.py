"""``task=evaluate``: are the explanations true? Roll out, evaluate, write, print and draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ibe_rl.config.hydra_setup import choice
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig
from ibe_rl.evaluation import figures, report, tables
from ibe_rl.evaluation.advice import lines_of, verdict_of
from ibe_rl.evaluation.baselines import Learnt, StateRegressor
from ibe_rl.evaluation.changing import judge_ages
from ibe_rl.evaluation.controls import Flipped
from ibe_rl.evaluation.judging import confidence_of, judge, paired_of, rows_of
from ibe_rl.evaluation.moments import Moments, Plan, TakenMoment
from ibe_rl.evaluation.observers import add_errors, observe_all
from ibe_rl.evaluation.own_metrics import OwnMetrics
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.refit import SHUFFLED_CONTROL, Refits
from ibe_rl.evaluation.rollouts import Rollouts, horizons_of, seeds_for, take_moments
from ibe_rl.evaluation.rows import Judged, OwnScores
from ibe_rl.evaluation.run_predictor import processes_for, shared_predictor
from ibe_rl.evaluation.runs import kept_policies, kept_refreshes
from ibe_rl.evaluation.step_by_step import judge_spoken
from ibe_rl.evaluation.trained_run import SPOKEN_CALIBRATION, TrainedRun
from ibe_rl.evaluation.what_if import WhatIf, judge_what_if
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.storage.run_folder import CALIBRATION, EVALUATION, FIGURES, write_json
from ibe_rl.types import ExpressionMapping, Policy

SHOWN = ("baseline:paper", "baseline:present_velocity", "baseline:state_regressor", "baseline:predicted_change")
"""Explainers shown with the evaluated one in tables and figures over the horizons."""

EXPLAINERS, ENSEMBLES = 11, 3
"""Evaluated at each horizon in addition to the refits: the length of the progress bar."""


def evaluate(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Evaluate the explanations of a run; ``docs/QUALITY.md`` defines the metrics.

    Raises:
        ConfigError: before any episode, if the run lacks a needed file or a metric cannot be made.
    """
    horizons = horizons_of(cfg.evaluate, run)
    refits, ours = Refits(run, cfg.evaluate.seed), f"ibe:{run.config.mapping.kind}"
    own_metrics = OwnMetrics.of({**run.config.metrics, **cfg.metrics})
    report.make_folders(run.folder)
    learnt = learn_all(refits, horizons, cfg.evaluate, ours, processes_for(cfg.predictor.processes, run.policy))
    with shared_predictor(run, cfg) as predictor:
        rollouts = Rollouts(run, cfg, predictor)
        moments, held_out = rollouts.judged_and_held_out(horizons)
        ages = changing_policy(rollouts) if cfg.evaluate.changing_episodes else []
        aloud, of_spoken = judge_spoken(run, cfg, predictor, *step_by_step_seeds(cfg))
    spoken = {name: learnt[run.horizon_steps].vocabularies[name] for name in (ours, "baseline:paper")}
    what_if = told_otherwise_in_copies(run, cfg, spoken) if cfg.what_if else WhatIf()
    judged = judge_all(learnt, moments.judged(), held_out, run, cfg, own_metrics.score)
    own = run.horizon_steps
    observers, rows = add_observers(judged, learnt, moments, held_out, run, cfg, ours)
    what_if.add_to(rows, own)
    quality = {
        "verdict": verdict_of(rows, ours, run),
        "protocol": evaluation_protocol(run, cfg, horizons, learnt, moments),
        "rows": rows,
        "paired": [each for one in judged.values() for each in paired_of(one, ours)],
        "confidence": confidence_of(judged[own], ours),
        "changing_policy": ages,
        "what_if": what_if.report,
        "spoken": aloud,
    }
    calibration = report.calibration_report(judged[own], ours, run.mapping_frame) | what_if.calibration_json
    calibration |= {SPOKEN_CALIBRATION: of_spoken.to_dict()} if of_spoken else {}
    folder = run.folder / EVALUATION
    write_json(folder / "quality.json", quality)
    write_json(folder / "observers.json", observers)
    write_json(folder / CALIBRATION, calibration)
    report.write_moments(folder / "moments.csv", moments.judged(), judged[own], ours, run.task)
    beside = [name for name in SHOWN if name in judged[own].samples]  # not every task supports all
    print_results(quality, observers, own, (ours, *beside))
    print_what_if(what_if)
    drawn = figures.draw_all(run.folder / FIGURES, quality, calibration, ours, beside)
    print_files(folder, drawn)


def step_by_step_seeds(cfg: ExplainConfig) -> tuple[range, range]:
    """Of the first judged and held-out episodes, which are also explained at every step."""
    config, most = cfg.evaluate, cfg.evaluate.spoken_episodes
    return (
        seeds_for("judged", config.seed, min(most, config.episodes)),
        seeds_for("held_out", config.seed, min(most, config.calibration_episodes)),
    )


def learn_all(
    refits: Refits, horizons: tuple[int, ...], config: EvaluateConfig, ours: str, processes: int
) -> dict[int, Learnt]:
    """Learn all that each horizon needs from the log. This comes first, since the log may be too small."""
    asked = [(horizon, ours, choice("mapping", "paper"), config) for horizon in horizons]
    return dict(zip(horizons, refits.each("learn_at", asked, processes), strict=True))


def judge_all(
    learnt: dict[int, Learnt],
    moments: Moments,
    held_out: Moments,
    run: TrainedRun,
    cfg: ExplainConfig,
    own: OwnScores,
) -> dict[int, Judged]:
    """Evaluate all explainers at all horizons, on the same resamples of the episodes."""
    config = cfg.evaluate
    weights = episode_weights(moments.episode, config.resamples, config.seed)
    with progress_bar("explainers", len(learnt) * (EXPLAINERS + ENSEMBLES * config.shuffles)) as step:
        return {
            horizon: judge(one, moments, held_out, horizon, run.task, weights, config.seed, step, own)
            for horizon, one in learnt.items()
        }


def add_observers(
    judged: dict[int, Judged],
    learnt: dict[int, Learnt],
    moments: Moments,
    held_out: Moments,
    run: TrainedRun,
    cfg: ExplainConfig,
    ours: str,
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The observer's report, and all rows, with the observer's errors added at the run's own horizon."""
    own = run.horizon_steps
    here = learnt[own]
    vocabularies: dict[str, Sequence[ExpressionMapping]] = {
        ours: [here.vocabularies[ours]],
        "baseline:paper": [here.vocabularies["baseline:paper"]],
        "baseline:flipped": [Flipped(here.vocabularies[ours])],
    }
    graded = here.vocabularies[ours]
    if isinstance(graded, ClusterMapping) and graded.membership == "graded":
        vocabularies["words_alone"] = [replace(graded, membership="hard")]
    vocabularies |= {SHUFFLED_CONTROL: here.ensembles[SHUFFLED_CONTROL]} if SHUFFLED_CONTROL in here.ensembles else {}
    true_change = held_out.real_change(own, run.task.explained)
    config = cfg.evaluate
    samples, scored = observe_all(moments, true_change, own, run.task, vocabularies, config.resamples, config.seed)
    rows = [row for one in judged.values() for row in rows_of(one)]
    add_errors(rows, samples, own)
    return scored, rows


def changing_policy(rollouts: Rollouts) -> list[dict[str, Any]]:
    """Evaluate each saved policy with each vocabulary learnt by then."""
    run = rollouts.run
    refreshes = {frame: one for frame, one in kept_refreshes(run).items() if one.horizon_steps == run.horizon_steps}
    return _judge_all_ages(rollouts, kept_policies(run), {frame: one.mapping for frame, one in refreshes.items()})


def evaluation_protocol(
    run: TrainedRun, cfg: ExplainConfig, horizons: tuple[int, ...], learnt: dict[int, Learnt], moments: Moments
) -> dict[str, Any]:
    """The protocol of the evaluation, as stored in quality.json."""
    config = cfg.evaluate
    counts = {"judged": config.episodes, "held_out": config.calibration_episodes}
    counts["changing"] = config.changing_episodes
    seeds = {name: seeds_for(name, config.seed, count) for name, count in counts.items() if count}
    refreshed = (*run.spans, run.horizon_steps)
    return report.common_protocol(run, cfg, len(moments.judged())) | {
        "changing_episodes": config.changing_episodes,
        "seeds": {name: [each[0], each[-1]] for name, each in seeds.items()},
        "horizons_steps": list(horizons),
        "vocabulary": {str(n): "refresh" if n in refreshed else "relearnt from the log" for n in horizons},
        "observed_episodes": int(moments.observed.sum()),
        "future_instruction": cfg.predictor.future_instruction,
        "band": _of_numbers(run.task.explained_band),
        "refits": config.shuffles,
        "state_regressor": {str(n): _of_numbers([*map(_about, one.regressors)]) for n, one in learnt.items()},
    }


def _of_numbers(values: Sequence[Any]) -> Any:
    """One value for each number of an instruction; unwrapped if there is only one."""
    return values[0] if len(values) == 1 else list(values)


def _about(regressor: StateRegressor) -> dict[str, Any]:
    return {"kind": regressor.kind, "r2": regressor.r2}


def print_results(quality: dict[str, Any], observers: dict[str, Any], own: int, shown: Sequence[str]) -> None:
    """Print the verdict and the tables; ``shown`` are the explainers of the table over horizons."""
    about, rows, console = quality["protocol"], quality["rows"], tables.console()
    for line in lines_of(quality["verdict"]["text"], quality["verdict"]["advice"]):
        console.print(line, markup=False, soft_wrap=True)
    if "instructed_by" in about:
        console.print(f"The instructions (m*) are {about['instructed_by']}, not the rule's.", soft_wrap=True)
    console.print()
    title = (
        f"{about['run']}: {about['episodes']} unseen episodes, {about['moments']:,} moments, the next {own} steps "
        "(with 95 % intervals)"
    )
    tables.print_rows([row for row in rows if row["horizon_steps"] == own], title)
    if not any(row["explainer"].startswith(SHUFFLED_CONTROL) for row in rows):
        console.print(
            f"note: the control of shuffled instructions is missing: none of evaluate.shuffles={about['refits']} gave "
            "a vocabulary",
            soft_wrap=True,
        )
    console.print(tables.paired_table(quality["paired"], own))
    console.print(tables.horizons_table(rows, shown))
    tables.print_observers(observers)
    if quality["changing_policy"]:
        console.print(tables.changing_table(quality["changing_policy"]))
    if quality["spoken"]:
        console.print(tables.spoken_table(quality["spoken"]))


def told_otherwise_in_copies(
    run: TrainedRun, cfg: ExplainConfig, vocabularies: Mapping[str, ExpressionMapping]
) -> WhatIf:
    """Whether what it says it would do if it were told something else comes true, in several vocabularies.

    Its predictor is its own, so that its numbers depend on nothing that was rolled out before.
    """
    plan, processes = Plan(cfg.evaluate.what_if_stride_steps, 1, (run.horizon_steps,)), cfg.predictor.processes

    def take(purpose: str, episodes: int) -> Sequence[TakenMoment]:
        return take_moments(run, run.policy, seeds_for(purpose, cfg.evaluate.seed, episodes), plan)

    with shared_predictor(run, cfg) as predictor:
        return judge_what_if(run, cfg, predictor, vocabularies, take, processes_for(processes, run.policy))


def print_what_if(what_if: WhatIf) -> None:
    """Print what it did when it was told something else, or why that is not known."""
    if what_if.report:
        tables.console().print(tables.what_if_table(what_if.report))
    elif what_if.note:
        tables.console().print(f"note: {what_if.note}", soft_wrap=True)


def print_files(folder: Path, drawn: list[Path]) -> None:
    """Print the paths of the files."""
    console = tables.console()
    console.print(f"numbers: {folder}/quality.json, observers.json, calibration.json, moments.csv", soft_wrap=True)
    console.print(f"figures: {drawn[0].parent}/{', '.join(path.name for path in drawn)}", soft_wrap=True)


def _judge_all_ages(
    rollouts: Rollouts, policies: Mapping[int, Policy], vocabularies: Mapping[int, ExpressionMapping]
) -> list[dict[str, Any]]:
    """Evaluate each saved policy with the vocabularies of its own stage and all earlier ones.

    Args:
        rollouts: of the run.
        policies: training frames to the policy saved then, oldest first.
        vocabularies: training frames to the vocabulary learnt then.
    """
    run, config, rows = rollouts.run, rollouts.cfg.evaluate, []
    plan = Plan(config.stride_steps, 1, (run.horizon_steps,))
    for frame, policy in policies.items():
        if not any(learnt <= frame for learnt in vocabularies):
            continue
        title = f"futures of the policy of frame {frame:,}"
        moments = rollouts.gather("changing", config.changing_episodes, plan, title, policy).judged()
        rows += judge_ages(frame, vocabularies, moments, run.horizon_steps, run.task, config.resamples, config.seed)
    return rows
