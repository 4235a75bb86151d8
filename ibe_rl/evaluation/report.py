"""The files of an evaluation: quality.json, observers.json, calibration.json, moments.csv."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.moments import Moments
from ibe_rl.evaluation.rows import Judged
from ibe_rl.evaluation.trained_run import TrainedRun, instructed_by
from ibe_rl.metrics.confidence import risk_coverage
from ibe_rl.storage.run_folder import EVALUATION, FIGURES, write_atomically
from ibe_rl.task import Task
from ibe_rl.types import CANNOT_TELL, Array, ConfigError

_BINS = 10
_CURVE_POINTS = 200


def make_folders(run: Path, names: Sequence[str] = (EVALUATION, FIGURES)) -> None:
    """Make the folders of a report in a run's, before any work is lost.

    Raises:
        ConfigError: if they are not writable.
    """
    for name in names:
        try:
            (run / name).mkdir(exist_ok=True)
            write_atomically(run / name / ".writable", lambda stream: stream.write(b""))
            (run / name / ".writable").unlink()
        except OSError as error:
            raise ConfigError(f"run={run}: allowed is a folder that can be written to ({error.strerror})") from None


def common_protocol(run: TrainedRun, cfg: ExplainConfig, moments: int) -> dict[str, Any]:
    """The protocol common to all reports; ``moments`` is the number of evaluated moments."""
    config = cfg.evaluate
    return {
        "run": run.folder.name,
        "mapping": run.config.mapping.kind,
        "policy_frame": run.policy_frame,
        "mapping_frame": run.mapping_frame,
        "horizon_steps": run.horizon_steps,
        "stride": config.stride_steps,
        "episodes": config.episodes,
        "calibration_episodes": config.calibration_episodes,
        "moments": moments,
        "futures": cfg.predictor.futures,
        "resamples": config.resamples,
        "seed": config.seed,
    } | ({} if (by := instructed_by(run)) is None else {"instructed_by": by})


def write_moments(path: Path, moments: Moments, judged: Judged, ours: str, task: Task) -> None:
    """Write a row per moment: its place, instruction, explanation, confidence, predicted and real change."""
    spoken, at = judged.spoken[ours], moments.at(judged.truth.horizon_steps)
    columns: dict[str, Array] = {"episode_seed": moments.seed, "step": moments.step}
    columns |= _numbered(task.state_names, "", moments.state)
    columns |= _instructions("m*", moments.instruction, task) | _instructions("m", spoken.said, task)
    said = np.where(spoken.known, spoken.phrase, CANNOT_TELL)
    columns |= {"phrase": said, "known": spoken.known.astype(int), "confidence": judged.probabilities[ours]}
    columns |= _numbered(
        task.state_names, "predicted_delta_", moments.predicted[np.arange(len(moments)), spoken.which, at]
    )
    columns |= _numbered(task.state_names, "realised_delta_", moments.realised[:, at])
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows([_short(value) for value in row] for row in zip(*columns.values(), strict=True))
    write_atomically(path, lambda stream: stream.write(text.getvalue().encode()))


def _numbered(names: Sequence[str], prefix: str, values: Array) -> dict[str, Array]:
    return {f"{prefix}{name}": column for name, column in zip(names, values.T, strict=True)}


def _instructions(name: str, values: Array, task: Task) -> dict[str, Array]:
    """One column; with several numbers one column for each, named after it."""
    return {name: values[:, 0]} if task.instruction_size == 1 else _numbered(task.expression_names, f"{name}_", values)


def _short(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, np.floating) else value


def reliability(probability: Array, true: Array, bins: int = _BINS) -> list[dict[str, Any]]:
    """The reliability diagram: accuracy by confidence, in the non-empty bins of equal width."""
    bin_of = np.minimum((probability * bins).astype(int), bins - 1)
    return [
        {
            "from": number / bins,
            "to": (number + 1) / bins,
            "moments": int(np.sum(bin_of == number)),
            "confidence": float(np.mean(probability[bin_of == number])),
            "came_true": float(np.mean(true[bin_of == number])),
        }
        for number in np.unique(bin_of).tolist()
    ]


def calibration_report(judged: Judged, ours: str, mapping_frame: int) -> dict[str, Any]:
    """The calibration of the confidence and its reliability, where the meaning of the words is known."""
    known = judged.spoken[ours].known
    probability, true = judged.probabilities[ours][known], judged.spoken[ours].voted_true[known]
    coverage, risk = risk_coverage(probability, true) if known.any() else (probability, probability)
    some = np.unique(np.linspace(0, max(0, len(coverage) - 1), _CURVE_POINTS).astype(int))[: len(coverage)]
    return {
        "explainer": ours,
        "mapping_frame": mapping_frame,
        "horizon_steps": judged.truth.horizon_steps,
        "calibration": judged.calibrations[ours].to_dict(),
        "reliability": reliability(probability, true),
        "risk_coverage": {"coverage": coverage[some].tolist(), "risk": risk[some].tolist()},
    }
