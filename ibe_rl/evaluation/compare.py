"""``task=compare``: would another mapping, learnt from the same log, explain better?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ibe_rl.config.hydra_setup import choice, choice_names
from ibe_rl.config.settings import ExplainConfig, MappingConfig
from ibe_rl.evaluation import report, tables
from ibe_rl.evaluation.baselines import Learnt, fit_state_regressors
from ibe_rl.evaluation.judging import judge, paired_of, rows_of
from ibe_rl.evaluation.observers import add_errors, observe_all
from ibe_rl.evaluation.own_metrics import OwnMetrics
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.rollouts import Rollouts
from ibe_rl.evaluation.rows import Judged
from ibe_rl.evaluation.run_predictor import processes_for, shared_predictor
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.storage.run_folder import EVALUATION, write_json
from ibe_rl.types import ConfigError, ExpressionMapping

AS_REFRESHED = "ibe:as_refreshed"
"""The run's own last vocabulary, which builds on earlier ones; the others are learnt from scratch."""


def compare(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Learn every mapping from the log of a run and evaluate all on the same moments, at the run's own horizon.

    Raises:
        ConfigError: before any episode, if the run lacks a needed file, a mapping is unknown or a metric
            cannot be made.
    """
    configs = {name: choice("mapping", name) for name in asked_for(cfg.compare.mappings, choice_names("mapping"))}
    refits, own, config = Refits(run, cfg.evaluate.seed), run.horizon_steps, cfg.evaluate
    own_metrics = OwnMetrics.of({**run.config.metrics, **cfg.metrics})
    report.make_folders(run.folder)
    learnt = learn_mappings(run, refits, configs, cfg)
    with shared_predictor(run, cfg) as predictor:
        both, held_out = Rollouts(run, cfg, predictor).judged_and_held_out((own,))
    moments = both.judged()
    weights = episode_weights(moments.episode, config.resamples, config.seed)
    judged = judge(learnt, moments, held_out, own, run.task, weights, config.seed, own=own_metrics.score)
    rows = rows_of(judged)
    true_change = held_out.real_change(own, run.task.explained)
    vocabularies = {name: [mapping] for name, mapping in learnt.vocabularies.items()}
    samples, observers = observe_all(both, true_change, own, run.task, vocabularies, config.resamples, config.seed)
    add_errors(rows, samples, own)
    about = report.common_protocol(run, cfg, len(moments))
    path = run.folder / EVALUATION / "compare.json"
    write_json(path, {"protocol": about, "rows": rows, "paired": all_pairs(judged), "observers": observers})
    tables.print_rows(rows, f"{run.folder.name}: mappings learnt from its log, the next {own} steps")
    tables.print_observers(observers)
    tables.console().print(f"numbers: {path}", soft_wrap=True)


def asked_for(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """The names of the mappings to compare, always with the paper's.

    Raises:
        ConfigError: for an unknown name.
    """
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ConfigError(f"compare.mappings={list(names)}: allowed are {', '.join(sorted(known))}")
    return sorted({*(names or known), "paper"})


def learn_mappings(run: TrainedRun, refits: Refits, configs: dict[str, MappingConfig], cfg: ExplainConfig) -> Learnt:
    """Learn all mappings from scratch; the paper's is the baseline."""
    own = run.horizon_steps
    vocabularies: dict[str, ExpressionMapping] = {AS_REFRESHED: run.mapping}
    processes = processes_for(cfg.predictor.processes, run.policy)
    fitted = refits.each("fit", [(config, own) for config in configs.values()], processes)
    for name, mapping in zip(configs, fitted, strict=True):
        vocabularies[f"{'baseline' if name == 'paper' else 'ibe'}:{name}"] = mapping
    heard = refits.lessons(run.config.mapping).heard
    return Learnt(vocabularies, {}, fit_state_regressors(heard, own, run.task, cfg.evaluate.seed))


def all_pairs(judged: Judged) -> list[dict[str, Any]]:
    """Paired differences of each mapping to the cheap baselines and the paper's."""
    return [each for name in judged.mappings if name.startswith("ibe:") for each in paired_of(judged, name)]
