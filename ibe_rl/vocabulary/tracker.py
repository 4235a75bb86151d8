"""Tracks the vocabulary of a run over its refreshes and measures what each changed."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.config.settings import MappingConfig, TrainConfig
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, Asking, ExplainerState, confidence_features
from ibe_rl.explain.steady import said_in
from ibe_rl.ibe.delay import Delay
from ibe_rl.ibe.delta import Windows, cut_windows
from ibe_rl.ibe.identity import keep_identity
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.instructors.taught import taught_rows
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.drift import policy_drift, vocabulary_drift
from ibe_rl.metrics.quality import mean_scores, number_scores, phrase_accuracy, phrase_hits
from ibe_rl.metrics.verdict import wrong_signs
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode, Explanation, Policy
from ibe_rl.vocabulary.fitting import check_mapping, fewer_clusters, learn_vocabulary
from ibe_rl.vocabulary.lateness import delays_of
from ibe_rl.vocabulary.probe import Probe, draw_probe
from ibe_rl.vocabulary.refresh import Change, Refresh, Spans, save_refresh
from ibe_rl.vocabulary.settled_horizon import horizon_of
from ibe_rl.vocabulary.training_episodes import find_steps, settled
from ibe_rl.vocabulary.who_is_late import Delays
from ibe_rl.vocabulary.word_notices import notices_of

JUDGED_EPISODES = 200
"""The newest episodes, which the confidence is calibrated on."""
OTHER_HORIZON = 1.5
"""Factor by which a horizon found in the log must differ from the previous one to replace it."""
SCORED_EPISODES, SCORED_EVERY_STEPS = 200, 4
HEARD_AGAIN = 2
"""Factor by which episodes must grow until delays are searched again, without a person: a search takes a second."""


class VocabularyTracker:
    """Relearns the vocabulary, keeps the identity of its clusters and measures drift.

    Args:
        config: of the mapping; ``settle`` finds the horizon if it sets none.
        task: the environment's own names.
        seed: of the clustering and of the probe.
        when_stale: least gain in ``motion_auc`` on the newest episodes for a new vocabulary to be taken; None takes
            all.

    Attributes:
        mapping: the current vocabulary; None before the first refresh.
        spans: the vocabularies of the other spans, by horizon in steps.
        probe: drawn from the episodes of the first refresh.
        calibration: confidence to the probability of a correct phrase, from the newest ``JUDGED_EPISODES``.
        delays: how late those who instruct are.
        notes: what the last refresh found: mismatches with what is declared, fewer clusters than asked for.
    """

    def __init__(self, config: MappingConfig, task: Task, seed: int, when_stale: float | None = None):
        self._config, self._task, self._seed, self._when_stale = config, task, seed, when_stale
        self._asked_for = config
        self.mapping: ClusterMapping | None = None
        self.spans: Spans = {}
        self.probe: Probe | None = None
        self._learnt_at = self._next_id = 0
        self._actions: Array | None = None
        self.calibration: Calibration | None = None
        self.notes: list[str] = []
        self.delays: Delays = {}
        self._heard_until = -1  # episodes that had ended when the delays were found
        self._judged: deque[tuple[Array, Array]] = deque(maxlen=JUDGED_EPISODES)

    def settle(self, log: TrajectoryLog) -> int:
        """The explained horizon in steps, set or found in the log.

        It is searched at each refresh, since early episodes are short, and replaced if it differs by more than
        ``OTHER_HORIZON``. A new horizon resets the tracker: vocabularies of different horizons cannot be compared.

        Raises:
            TooLittleDataError: if no episode has ended in time.
        """
        self._hear(log)
        found = find_steps(log, self._asked_for, self._task, self._seed, self.delays)
        before = self._config.horizon_steps
        if before is None or not before / OTHER_HORIZON <= found <= before * OTHER_HORIZON:
            self._config = settled(self._asked_for, found)
            self.mapping = self.probe = self._actions = self.calibration = None
            self.spans, self._judged = {}, deque(maxlen=JUDGED_EPISODES)
        return horizon_of(self._config)

    def _hear(self, log: TrajectoryLog) -> None:
        """Find how late everybody is: with a person at each refresh, else whenever the episodes have doubled."""
        ended, of_person = log.episodes_ended, len(taught_rows(log)) > 0
        if ended >= (self._heard_until + 1 if of_person or not self.delays else HEARD_AGAIN * self._heard_until):
            self.delays, self._heard_until = delays_of(log, self._config, self.delays), ended

    def refresh(self, log: TrajectoryLog, policy: Policy, reactions: Reactions | None = None) -> Refresh:
        """Relearn the vocabulary from the current log and compare it with the previous one.

        Args:
            log: with whole episodes.
            policy: the current greedy policy.
            reactions: of the policy to opposite instructions; None if it was not asked.

        Raises:
            TooLittleDataError: as ``learn_vocabulary``; the previous vocabulary stays.
        """
        self._hear(log)
        if self._config.horizon_steps is None:
            self.settle(log)
        found = self._asked_for.horizon_steps is None and self.mapping is None
        last = {} if self.mapping is None else {horizon_of(self._config): self.mapping, **self.spans}
        learnt = learn_vocabulary(log, self._config, self._task, self._seed, last, reactions, self.delays)
        noticed = notices_of(learnt.mapping, learnt.top.delta, self.mapping, self._task.words)
        learnt = replace(learnt, horizon_found=found, word_notices=noticed)
        newest = self._newest(log)
        if self.probe is None:
            self.probe = draw_probe(log, self._config, self._seed)
        actions = policy(self.probe.observations)
        if self.mapping is not None:
            learnt = self._compared(self.mapping, learnt, self.probe, newest, actions)
        else:
            each = number_scores(learnt.mapping, newest, self._task)
            if self._next_id:  # the horizon has changed; ids are never reused
                learnt = replace(learnt, mapping=replace(learnt.mapping, ids=learnt.mapping.ids + self._next_id))
            learnt = replace(learnt, scores=mean_scores(each), scores_of_numbers=each)
        if learnt.taken:
            self.mapping, self.spans = learnt.mapping, learnt.spans
            self._learnt_at, self._actions = learnt.frame, actions
            self._next_id = max(self._next_id, int(learnt.mapping.ids.max()) + 1)
        self.notes = [
            *wrong_signs(learnt.verdicts(self._task), learnt.standing.meanings, self._task),
            *fewer_clusters(learnt.standing, self._config, self._task),
        ]
        return learnt

    @contextmanager
    def all_or_nothing(self) -> Iterator[None]:
        """Restore the previous vocabulary if the body raises."""
        before = dict(vars(self))
        try:
            yield
        except Exception:
            vars(self).update(before)
            raise

    def save(self, folder: Path, refresh: Refresh) -> None:
        """Save a taken refresh as JSON, and with the first one the probe."""
        if refresh.change is None and self.probe is not None:
            self.probe.save(folder / "probe.npz")
        if refresh.taken:
            save_refresh(folder, refresh, self._config, self._task, self.calibration)

    def state_dict(self) -> dict[str, Any]:
        """All that the next refresh depends on, as arrays and plain values."""
        arrays = {"actions": self._actions}
        if self.probe is not None:
            arrays |= {"delta": self.probe.delta, "observations": self.probe.observations}
        return {
            "mapping": None if self.mapping is None else self.mapping.to_dict(),
            "horizon_steps": self._config.horizon_steps,
            "spans": {steps: each.to_dict() for steps, each in self.spans.items()},
            "calibration": None if self.calibration is None else self.calibration.to_dict(),
            "learnt_at": self._learnt_at,
            "next_id": self._next_id,
            "judged": [list(one) for one in self._judged],
            "notes": list(self.notes),
            "delays": {who: asdict(delay) for who, delay in self.delays.items()},
            "heard_until": self._heard_until,
            **arrays,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""
        self.delays = {who: Delay(**values) for who, values in state.get("delays", {}).items()}
        self._heard_until = int(state.get("heard_until", -1))
        if state["mapping"] is None:
            return
        self.mapping = ClusterMapping.from_dict(state["mapping"])
        self._config = settled(self._config, int(state["horizon_steps"]))
        self.spans = {steps: ClusterMapping.from_dict(each) for steps, each in state["spans"].items()}
        self.calibration = None if state["calibration"] is None else Calibration.from_dict(state["calibration"])
        self._learnt_at, self._next_id = state["learnt_at"], state["next_id"]
        self.notes = [str(line) for line in state.get("notes", ())]
        self._judged.extend((features, true) for features, true in state["judged"])
        self.probe = Probe(state["delta"], state["observations"])
        self._actions = state["actions"]

    @property
    def horizon_steps(self) -> int | None:
        """n; None until it has been found."""
        return self._config.horizon_steps

    @property
    def horizons_steps(self) -> list[int]:
        """All horizons explained, n first; empty until n has been found."""
        return [] if self.horizon_steps is None else [self.horizon_steps, *self._config.spans_steps]

    def mapping_of(self, horizon_steps: int) -> ClusterMapping | None:
        """The current vocabulary of a span; None before the first refresh."""
        return self.mapping if horizon_steps == self._config.horizon_steps else self.spans.get(horizon_steps)

    def explainer_state(
        self, futures: int = 1, min_confidence: float = 0.0, what_if: Asking | None = None
    ) -> ExplainerState:
        """The current state of the explainer, after the first refresh."""
        assert self.mapping is not None
        steps, words, known = horizon_of(self._config), self._task.phrases, self.calibration
        return ExplainerState(self.mapping, steps, words, self.spans, futures, known, min_confidence, what_if)

    def judge(
        self, refresh: Refresh, episode: Episode, said: Sequence[Explanation], every_steps: int
    ) -> dict[str, float]:
        """Compare an episode's explanations with its outcomes, and recalibrate the confidence.

        Args:
            refresh: the newest one.
            episode: ``T`` steps.
            said: ``T`` explanations in the current vocabulary.
            every_steps: steps between new explanations.

        Returns:
            Columns of metrics.csv: phrase accuracy where the meaning is known (nan if nowhere), the share of unknown
            explanations, and the phrase accuracy of the previous vocabulary.
        """
        new = said[::every_steps]
        true = phrase_hits(episode, said, refresh.standing, self._task.phrases)[::every_steps]
        self._learn_confidence(new, true)
        row = {"ibe/came_true": phrase_accuracy(true), "ibe/unknown": float(np.mean([not one.known for one in new]))}
        if refresh.change is not None:
            before = ExplainerState(refresh.change.last, said[0].horizon_steps, self._task.phrases)
            stale = said_in(before, said, every_steps)
            true = phrase_hits(episode, stale, before.mapping, self._task.phrases)
            row["ibe/came_true_stale"] = phrase_accuracy(true[::every_steps])
        return row

    def _learn_confidence(self, new: Sequence[Explanation], true: Array) -> None:
        """Recalibrate on explanations with a known meaning; ``true`` is from ``phrase_hits``."""
        meant = ~np.isnan(true)
        if meant.any():
            self._judged.append((confidence_features(new)[meant], true[meant] == 1))
            features, outcomes = (np.concatenate(column) for column in zip(*self._judged, strict=True))
            self.calibration = Calibration.fit(features, outcomes, CONFIDENCE_FEATURES)

    def _compared(
        self, last: ClusterMapping, learnt: Refresh, probe: Probe, newest: Windows, actions: Array
    ) -> Refresh:
        mapping, transition = keep_identity(
            last, learnt.mapping, probe.delta, self._next_id, self._config.survival_overlap, self._config.hold_within
        )
        each_before, each_after = (number_scores(each, newest, self._task) for each in (last, mapping))
        before, after = mean_scores(each_before), mean_scores(each_after)
        staleness = after["motion_auc"] - before["motion_auc"]
        assert self._actions is not None
        change = Change(
            last=last,
            since_frame=self._learnt_at,
            transition=transition,
            drift=vocabulary_drift(last, mapping, probe.delta, self._task.phrases),
            policy_drift=policy_drift(self._actions, actions),
            last_scores=before,
            staleness=staleness,
        )
        taken = self._when_stale is None or not staleness <= self._when_stale  # also if staleness is NaN
        each = each_after if taken else each_before
        return replace(learnt, mapping=mapping, change=change, scores=after, taken=taken, scores_of_numbers=each)

    def _newest(self, log: TrajectoryLog) -> Windows:
        """Every few windows with an instruction of the newest episodes, which all metrics use."""
        count = len(log.index)
        episodes = log.read(range(max(0, count - SCORED_EPISODES), count))
        windows = cut_windows(episodes, horizon_of(self._config), "clamp")
        return windows[np.asarray(windows.given) & (windows.step % SCORED_EVERY_STEPS == 0)]


def check_refreshing(config: TrainConfig, task: Task) -> None:
    """Refuse refresh settings that cannot work or would be ignored.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check_mapping(config.mapping, task)
    if config.refresh_when_stale is not None and config.refresh_every_frames is None:
        raise ConfigError(
            f"refresh_when_stale={config.refresh_when_stale:g}: allowed is null with refresh_every_frames=null, "
            "which never refreshes"
        )
