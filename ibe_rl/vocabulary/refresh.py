"""The result of learning a vocabulary: the mapping, its training data and its changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.identity import ClusterTransition
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.ibe.word_meaning import moves_of
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.drift import VocabularyDrift
from ibe_rl.metrics.verdict import Verdict, verdicts_of
from ibe_rl.storage.run_folder import read_json, write_json
from ibe_rl.task import Task
from ibe_rl.vocabulary.persons import PersonsShare
from ibe_rl.vocabulary.settled_horizon import horizon_of
from ibe_rl.vocabulary.who_is_late import Delays, of_first
from ibe_rl.vocabulary.words import WordNotice

Spans = Mapping[int, ClusterMapping]
"""Vocabularies by horizon in steps."""


@dataclass(frozen=True)
class Change:
    """What a refresh changed.

    Attributes:
        last: the previous vocabulary.
        since_frame: training frames when it was learnt.
        transition: which of its clusters survived.
        drift: distance between both vocabularies on the probe.
        policy_drift: share of the probe's observations at which the policy's action changed.
        last_scores: ``vocabulary_scores`` of the previous vocabulary on the newest episodes.
        staleness: ``motion_auc`` of the new vocabulary minus that of the previous one, on the newest episodes.
    """

    last: ClusterMapping
    since_frame: int
    transition: ClusterTransition
    drift: VocabularyDrift
    policy_drift: float
    last_scores: Mapping[str, float]
    staleness: float


@dataclass(frozen=True)
class Refresh:
    """A vocabulary and its training data.

    Attributes:
        frame: training frames when it was learnt.
        mapping: the vocabulary.
        spans: the vocabularies of the other spans, by horizon in steps.
        top: windows of the best episodes, the training data.
        others: a sample of windows with an instruction from other episodes, for comparison only.
        episodes_logged: whole episodes in the log.
        episodes_counted: those that the best were chosen from.
        episodes_used: the best ones.
        episodes_by_context: of the best ones.
        windows_by_context: windows used, likewise.
        windows_by_instruction: windows used, by the instruction they began with.
        change: compared with the previous vocabulary; None if this is the first.
        scores: ``vocabulary_scores`` of this vocabulary on the newest episodes.
        taken: False if the previous vocabulary was good enough and stays.
        reactions: of the agent to opposite instructions, if it was asked.
        scores_of_numbers: ``number_scores`` of the current vocabulary on the newest episodes.
        horizon_found: True if this refresh found n in the log.
        persons: what of the training data a person said; None where nobody taught.
        word_notices: what the agent noticed about the instructor's words.
        delays: how late those who instruct are.
    """

    frame: int
    mapping: ClusterMapping
    spans: Spans
    top: Windows
    others: Windows
    episodes_logged: int
    episodes_counted: int
    episodes_used: int
    episodes_by_context: Mapping[str, int]
    windows_by_context: Mapping[str, int]
    windows_by_instruction: Mapping[str, int]
    change: Change | None = None
    scores: Mapping[str, float] = field(default_factory=dict)
    taken: bool = True
    reactions: Reactions | None = None
    scores_of_numbers: Sequence[Mapping[str, float]] = ()
    horizon_found: bool = False
    persons: PersonsShare | None = None
    word_notices: Sequence[WordNotice] = ()
    delays: Delays = field(default_factory=dict)

    @property
    def standing(self) -> ClusterMapping:
        """The vocabulary used from now on."""
        return self.mapping if self.taken or self.change is None else self.change.last

    def verdicts(self, task: Task) -> list[Verdict]:
        """For each number of the instruction, whether the current words predict the direction of motion."""
        return verdicts_of(self.scores_of_numbers, self.standing.meanings, task)


def save_refresh(
    folder: Path, refresh: Refresh, config: MappingConfig, task: Task, calibration: Calibration | None = None
) -> Path:
    """Write a refresh as JSON; returns the file."""
    mapping = refresh.mapping
    clusters = [
        {
            "id": int(mapping.ids[i]),
            "size": int(mapping.sizes[i]),
            "mean_instruction": mapping.mean_instructions[i].tolist(),
            "expression": mapping.expressions[i].tolist(),
            "phrase": phrase(mapping.expressions[i], task.phrases),
            "purity": float(mapping.purities[i]),
            "evidence": float(mapping.evidence[i]),
        }
        for i in range(len(mapping.sizes))
    ]
    path = folder / f"{refresh.frame:012d}.json"
    episodes = {"logged": refresh.episodes_logged, "counted": refresh.episodes_counted, "used": refresh.episodes_used}
    windows = {"used": len(refresh.top), "by_context": refresh.windows_by_context}
    write_json(
        path,
        {
            "frame": refresh.frame,
            "horizon_steps": horizon_of(config),
            "episodes": episodes | {"by_context": refresh.episodes_by_context},
            "windows": windows | {"by_instruction": refresh.windows_by_instruction},
            "clusters": clusters,
            "scores": _without_nan(refresh.scores),
            "scores_of_numbers": [*map(_without_nan, refresh.scores_of_numbers)],
            "change": None if refresh.change is None else _change(refresh.change),
            "state_names": list(task.state_names),
            "mapping": mapping.to_dict(),
            "calibration": None if calibration is None else calibration.to_dict(),
            "reactions": None if refresh.reactions is None else refresh.reactions.to_dict(),
            "spans": [{"horizon_steps": n, "mapping": each.to_dict()} for n, each in refresh.spans.items()],
            **_of_words(refresh, task),
            **_of_delays(refresh.delays),
        }
        | ({} if refresh.persons is None else {"person": asdict(refresh.persons)}),
    )
    return path


def _of_delays(delays: Delays) -> dict[str, Any]:
    """How late the person is, or whoever instructs; and everybody's delay."""
    first = of_first(delays)
    known = first if first and first.known else None
    return {
        "delay_steps": known and known.steps,
        "delay_interval_steps": known and [known.low, known.high],
        "delays": {who: asdict(delay) for who, delay in delays.items()},
    }


def _of_words(refresh: Refresh, task: Task) -> dict[str, Any]:
    """What a refresh with words holds beside."""
    if task.words is None:
        return {}
    return {"words": task.words.to_dicts(), "word_notices": [one.to_dict() for one in refresh.word_notices]}


def _change(change: Change) -> dict[str, Any]:
    return {
        "since_frame": change.since_frame,
        "transition": change.transition.to_dict(),
        "vocabulary_drift": asdict(change.drift),
        "policy_drift": change.policy_drift,
        "scores_before": _without_nan(change.last_scores),
        **_without_nan({"staleness": change.staleness}),
    }


def _without_nan(values: Mapping[str, float]) -> dict[str, float | None]:
    """Replace NaN, which JSON lacks, by null."""
    return {name: None if math.isnan(value) else value for name, value in values.items()}


@dataclass(frozen=True)
class Saved:
    """A refresh read from disk.

    Attributes:
        mapping: the vocabulary.
        horizon_steps: n that it was learnt with.
        frame: training frames when it was learnt.
        spans: the vocabularies of the other spans, by horizon in steps.
        calibration: of the confidence, from earlier recorded episodes; None at the first refresh.
        reactions: of the agent to opposite instructions; None if it was not asked.
        scores_of_numbers: ``number_scores``; empty if the vocabulary was not scored.
    """

    mapping: ClusterMapping
    horizon_steps: int
    frame: int
    spans: Spans
    calibration: Calibration | None
    reactions: Reactions | None = None
    scores_of_numbers: Sequence[Mapping[str, float]] = ()


def load_refresh(path: Path) -> Saved:
    """Read a saved refresh.

    Raises:
        ValueError: if the file is damaged.
    """
    try:
        saved: dict[str, Any] = read_json(path)
        spans = {int(each["horizon_steps"]): ClusterMapping.from_dict(each["mapping"]) for each in saved["spans"]}
        mapping = ClusterMapping.from_dict(saved["mapping"])
        calibration = None if saved["calibration"] is None else Calibration.from_dict(saved["calibration"])
        asked = saved.get("reactions")  # missing in files of earlier versions
        reactions = None if asked is None else Reactions.from_dict(asked)
        frame, scores = int(saved["frame"]), _scores_of(saved, mapping)
        return Saved(mapping, int(saved["horizon_steps"]), frame, spans, calibration, reactions, scores)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"{path} is not a readable refresh: {error}") from None


def _scores_of(saved: dict[str, Any], mapping: ClusterMapping) -> list[dict[str, float]]:
    """The scores of each number; empty if their count differs, as in files of earlier versions."""
    each = saved.get("scores_of_numbers", [])
    if len(each) != mapping.expressions.shape[1] and moves_of(mapping.meanings) is None:
        return []
    scores = [{str(name): math.nan if value is None else float(value) for name, value in one.items()} for one in each]
    if any(abs(value) > 1 for one in scores for value in one.values()):
        raise ValueError(f"scores_of_numbers={scores}: allowed are -1 to 1")
    return scores
