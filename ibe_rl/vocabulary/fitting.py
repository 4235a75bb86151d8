"""Learns a vocabulary from episodes: the meaning of the words, then clusters and their names."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from inspect import signature
from typing import Any

import numpy as np

from ibe_rl.config.kinds import implementation
from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.estimator import IBEMapping
from ibe_rl.ibe.interpret import interpret
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Interpretation, Reactions, UnknownMeaningWarning
from ibe_rl.ibe.settings import check_settings
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode
from ibe_rl.vocabulary.fitting_words import fit_worded
from ibe_rl.vocabulary.refresh import Refresh, Spans
from ibe_rl.vocabulary.settled_horizon import horizon_of
from ibe_rl.vocabulary.training_episodes import (
    TrainingEpisodes,
    best_windows,
    instructed_states,
    instructed_windows,
    read_training_episodes,
)
from ibe_rl.vocabulary.who_is_late import Delays


def fit_mapping(
    best: Sequence[Episode],
    heard: Sequence[Episode],
    config: MappingConfig,
    task: Task,
    seed: int,
    last: ClusterMapping | None = None,
    horizon_steps: int | None = None,
    interpretation: Interpretation | None = None,
) -> ClusterMapping:
    """Learn a vocabulary from episodes.

    Args:
        best: their windows are clustered and named.
        heard: good and bad episodes with their instructions.
        config: see ``MappingConfig``.
        task: the environment's own names.
        seed: of the clustering.
        last: the previous vocabulary, the starting point unless ``memory`` is None.
        horizon_steps: n; None uses the config's.
        interpretation: the meaning of the words; None takes it from the movements of the best episodes.

    Raises:
        TooLittleDataError: if there are too few episodes or windows.
    """
    windows = best_windows(best, config, horizon_steps or horizon_of(config))
    return fit_windows(windows, heard, config, task, seed, last, interpretation)


def fit_windows(
    windows: Windows,
    heard: Sequence[Episode],
    config: MappingConfig,
    task: Task,
    seed: int,
    last: ClusterMapping | None = None,
    interpretation: Interpretation | None = None,
) -> ClusterMapping:
    """Learn a vocabulary from windows; otherwise as ``fit_mapping``."""
    states, instructions = instructed_states(heard, seed)
    if task.words is not None:
        return fit_worded(windows, states, instructions, config, task, _estimator(config, task, seed, None), seed)
    estimator = _estimator(config, task, seed, last)
    with warnings.catch_warnings():  # the mapping records it, and explainers report it
        warnings.simplefilter("ignore", UnknownMeaningWarning)
        mapping = estimator.fit(windows.delta, windows.instruction, states, instructions, interpretation).mapping_
    if not isinstance(mapping, ClusterMapping):
        raise TypeError(f"mapping={config.kind}: its mapping_ is a {type(mapping).__name__}, not a ClusterMapping")
    return mapping


def interpret_lessons(
    heard: Sequence[Episode],
    config: MappingConfig,
    task: Task,
    seed: int,
    horizon_steps: int,
    reactions: Reactions | None = None,
) -> Interpretation | None:
    """Infer the meaning of the words; None with ``meaning=assumed``.

    Args:
        heard: good and bad episodes.
        config: see ``MappingConfig``.
        task: the environment's own names.
        seed: of samples and resampling.
        horizon_steps: n.
        reactions: of the agent to opposite instructions.
    """
    if config.meaning == "assumed" or task.words is not None:
        return None
    return interpret(
        heard,
        horizon_steps,
        top_fraction=config.top_fraction,
        reactions=reactions,
        dimensions=_dimensions(config, task),
        seed=seed,
    )


def _estimator(config: MappingConfig, task: Task, seed: int, last: ClusterMapping | None) -> Any:
    """The estimator of the mapping's kind; its constructor gets the settings that it names.

    A kind of mapping is a class with the ``fit`` of ``IBEMapping``, which sets ``mapping_`` to a ``ClusterMapping``.
    Its class attribute ``settings`` is a dataclass derived from ``MappingConfig``. ``n_clusters``, ``dimensions``
    (indices, None for all), ``last``, ``memory`` and ``random_state`` mean the same as in ``IBEMapping``.
    """
    estimator = implementation("mapping", config.kind)
    memory = getattr(config, "memory", 0.0)
    given = vars(config) | {
        "n_clusters": clusters_of(config, task),
        "dimensions": _dimensions(config, task),
        "last": None if memory is None else last,
        "memory": memory or 0.0,
        "random_state": seed,
    }
    return estimator(**{name: given[name] for name in signature(estimator).parameters if name in given})


def _dimensions(config: MappingConfig, task: Task) -> list[int] | None:
    return [task.state_names.index(name) for name in config.dimensions] or None


def clusters_of(config: MappingConfig, task: Task) -> int:
    """Clusters of a vocabulary: ``n_clusters`` for each number of an instruction; of words, explained dimension."""
    return config.n_clusters * len(task.explained)


def fewer_clusters(mapping: ClusterMapping, config: MappingConfig, task: Task) -> list[str]:
    """A note if one of our mappings has found fewer distinct changes of the state than clusters were asked for."""
    asked, found = clusters_of(config, task), len(mapping.ids)
    if task.words is not None or found >= asked or not issubclass(implementation("mapping", config.kind), IBEMapping):
        return []
    each = "" if task.instruction_size == 1 else f" for each of {task.instruction_size} numbers"
    return [
        f"the vocabulary has {found} clusters, not {asked} (mapping.n_clusters={config.n_clusters}{each}): the best "
        "episodes have no more distinct changes of the state"
    ]


def check_mapping(config: MappingConfig, task: Task) -> None:
    """Refuse a mapping that cannot work in this environment.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    _check_steps(config, task.max_episode_steps)
    unknown = [name for name in config.dimensions if name not in task.state_names]
    if unknown:
        allowed = ", ".join(task.state_names)
        raise ConfigError(f"mapping.dimensions={list(config.dimensions)}: allowed are {allowed}")
    memory = getattr(config, "memory", None)  # if it is set, each refresh starts from the previous one
    if config.failed_ends == "drop" and not task.judges_success:
        raise ConfigError("mapping.failed_ends=drop: allowed is keep where the environment does not report success")
    _refuse_untaken(config)
    try:
        estimator = _estimator(config, task, 0, None)
        if isinstance(estimator, IBEMapping):
            for name, value in (
                ("memory", 0.0),
                ("last", memory is not None or None),
            ):  # a subclass need not take these
                setattr(estimator, name, value)
            check_settings(estimator)
    except ValueError as error:
        reason = str(error).replace("last: allowed is None", f"memory={memory}: allowed is null")
        raise ConfigError(f"mapping.{reason}") from None
    except TypeError as error:
        raise ConfigError(f"mapping.kind={config.kind}: it cannot be made of its settings ({error})") from None


def _refuse_untaken(config: MappingConfig) -> None:
    """Refuse a class that does not take what its settings have: setting it would do nothing."""
    shared, taken = MappingConfig.__dataclass_fields__, signature(implementation("mapping", config.kind)).parameters
    if untaken := [name for name in vars(config) if name not in shared and name not in taken]:
        raise ConfigError(
            f"mapping.kind={config.kind}: its constructor takes no {', '.join(untaken)}; allowed is a class whose "
            "settings have only what it takes, beside those of MappingConfig"
        )


def _check_steps(config: MappingConfig, longest: int) -> None:
    set_steps = [] if config.horizon_steps is None else [config.horizon_steps]
    most = longest if set_steps else max([longest, *config.spans_steps])  # where n is found, long spans are dropped
    for name, value, steps in (
        ("horizon_steps", config.horizon_steps, set_steps),
        ("spans_steps", config.spans_steps, config.spans_steps),
    ):
        if not all(1 <= n <= most for n in steps):
            raise ConfigError(
                f"mapping.{name}={value}: allowed is at least 1 and at most {longest}, the length of the longest "
                "episode"
            )


def learn_vocabulary(
    log: TrajectoryLog,
    config: MappingConfig,
    task: Task,
    seed: int,
    last: Spans | None = None,
    reactions: Reactions | None = None,
    delays: Delays | None = None,
) -> Refresh:
    """Learn the vocabulary from the best episodes of the log, and one for each other span.

    Args:
        log: with whole episodes.
        config: see ``MappingConfig``; its horizon is set or ``settled``.
        task: the environment's own names.
        seed: of the clustering.
        last: the previous vocabularies by horizon, the starting points unless ``memory`` is None.
        reactions: of the agent to opposite instructions; None if it was not asked.
        delays: of those who instruct; None: as the log tells.

    Raises:
        TooLittleDataError: if there are too few episodes or windows.
    """
    lessons, last, steps = read_training_episodes(log, config, seed, delays), last or {}, horizon_of(config)
    top = best_windows(lessons.best, config, steps)
    meant = interpret_lessons(lessons.heard, config, task, seed, steps, reactions)
    mapping = fit_windows(top, lessons.heard, config, task, seed, last.get(steps), meant)
    others = instructed_windows(lessons.others, config, steps)
    contexts = np.array([episode.context for episode in lessons.best])
    return Refresh(
        frame=log.frames,
        mapping=mapping,
        spans=_learn_spans(lessons, config, task, seed, last, meant),
        top=top,
        others=top[:0] if others is None else others,
        episodes_logged=lessons.logged,
        episodes_counted=lessons.counted,
        episodes_used=len(lessons.best),
        episodes_by_context=_count(contexts, task.contexts),
        windows_by_context=_count(contexts[top.episode], task.contexts),
        windows_by_instruction=_count_instructions(top.instruction, task),
        reactions=reactions,
        persons=lessons.persons,
        delays=lessons.delays,
    )


def _learn_spans(
    lessons: TrainingEpisodes, config: MappingConfig, task: Task, seed: int, last: Spans, meant: Interpretation | None
) -> dict[int, ClusterMapping]:
    """A vocabulary for each other span; spans longer than all episodes are skipped."""
    found = {}
    for n in sorted({*config.spans_steps} - {config.horizon_steps}):
        with suppress(TooLittleDataError):
            found[n] = fit_mapping(lessons.best, lessons.heard, config, task, seed, last.get(n), n, meant)
    return found


def _count(names: Array, all_names: Sequence[str]) -> dict[str, int]:
    return {name: int(np.sum(names == name)) for name in all_names}


def _count_instructions(instructions: Array, task: Task) -> dict[str, int]:
    """Windows by instruction value or word; with several numbers, each is counted under its own name."""
    if task.words is not None:
        counted = np.sum(instructions > 0, axis=0).tolist()
        return dict(zip(task.words.names, counted, strict=False))
    values = [f"{value:+g}" if value else "0" for value in task.instruction_values]
    columns = instructions.T
    names = values if len(columns) == 1 else [f"{name} {value}" for name in task.number_names for value in values]
    counts = [int(np.sum(np.isclose(column, value))) for column in columns for value in task.instruction_values]
    return dict(zip(names, counts, strict=True))
