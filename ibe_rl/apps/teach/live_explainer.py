"""Live explanations, with the current policy and vocabulary."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import torch

from ibe_rl.agents import GreedyPolicy
from ibe_rl.explain.explainer import explain
from ibe_rl.explain.phrasing import Asking, ExplainerState
from ibe_rl.explain.steady import SteadySpeaker
from ibe_rl.explain.what_if import values_of, whatever
from ibe_rl.ibe.mapping import movements_said
from ibe_rl.task import Task
from ibe_rl.types import Array, Explanation, Moment, Predictor

Weights = Mapping[str, Array]
ASKED_EVERY = 3
"""At every third explanation it is also asked what it would do if it were told something else."""


def weights_of(policy: GreedyPolicy) -> Weights:
    """A copy of the weights as plain arrays, which further training does not change."""
    return {name: tensor.numpy().copy() for name, tensor in policy.state_dict().items()}


class LiveExplainer:
    """Explains moments with the newest policy and vocabulary; silent before the first vocabulary.

    Args:
        policy: loads the weights that arrive.
        predictor: with environments of its own.
        task: its words are those that the person has now, and it is asked what it would do if told each value; None:
            as the vocabulary comes.
        every_s: least interval of explanations: one takes some 30 ms of the core that also steps the environment.
        clock: returns seconds.
    """

    def __init__(
        self,
        policy: GreedyPolicy,
        predictor: Predictor,
        task: Task | None = None,
        every_s: float = 0.25,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._policy, self._predictor, self._every_s, self._clock = policy, predictor, every_s, clock
        self._task, self._said = task, 0
        self._lock = threading.Lock()
        self._weights: Weights | None = None
        self._explainer: ExplainerState | None = None
        self._aloud: tuple[int, ExplainerState, SteadySpeaker] | None = None
        self._spoke_at = -every_s
        self._thread, self._speaking = ThreadPoolExecutor(1, "speaker"), Future[None]()
        self._speaking.set_result(None)

    def learn(self, weights: Weights) -> None:
        """Load weights of the policy; any thread may call this."""
        with self._lock:
            self._weights = weights

    def speak_with(self, explainer: ExplainerState) -> None:
        """Switch to a vocabulary; any thread may call this."""
        with self._lock:
            self._explainer = explainer

    @property
    def explainer(self) -> ExplainerState | None:
        """The vocabulary that it speaks with."""
        return self._explainer

    def due(self) -> bool:
        """Whether the last explanation is done and the next one due."""
        if self._explainer is None or not self._speaking.done():
            return False
        self._speaking.result()  # raises what went wrong
        return self._clock() - self._spoke_at >= self._every_s

    def ask(self, moment: Moment, hear: Callable[[Explanation], None], episode: int = 0, step: int = 0) -> None:
        """Explain a moment, when due, in a thread of its own, so that the environment is not held up.

        Args:
            moment: to explain.
            hear: called with the explanation, in that thread.
            episode: of the moment.
            step: of the moment.
        """
        self._speaking = self._thread.submit(lambda: hear(self.say(moment, episode, step)))

    def wait(self) -> None:
        """Return when the pending explanation is done."""
        self._speaking.result()

    def say(self, moment: Moment, episode: int = 0, step: int = 0) -> Explanation:
        """Explain a moment of an episode; only once there is a vocabulary."""
        with self._lock:
            weights, self._weights, explainer = self._weights, None, self._explainer
        assert explainer is not None
        if weights is not None:
            self._policy.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
        if self._task is not None:
            asks = self._said % ASKED_EVERY == 0
            what_if = Asking(values_of(self._task), futures=1) if asks else None
            explainer = replace(explainer, words=self._task.phrases, what_if=what_if)
        [said] = explain([moment], self._policy, self._predictor, explainer)
        said = self._speaker(episode, explainer).say(said, step)
        self._said += 1
        self._spoke_at = self._clock()
        return said

    def _speaker(self, episode: int, explainer: ExplainerState) -> SteadySpeaker:
        """The one of this episode and vocabulary."""
        known = self._aloud
        if known is None or known[0] != episode or known[1].mapping is not explainer.mapping:
            known = self._aloud = episode, explainer, SteadySpeaker(explainer)
        return known[2]


def explanation_fields(said: Explanation, task: Task) -> dict[str, Any]:
    """An explanation as a page displays it, with paths ``(H + 1, 2)`` in scene units where the scene has places.

    Without a number where the meaning of the word is unknown, without a confidence that is not calibrated.
    """
    words = task.words
    [numbers] = movements_said([said]).tolist()
    shares = [] if words is None or not said.meant else zip(words.names, numbers, strict=False)
    return {
        "expression": numbers[0] if said.meant and words is None else None,
        "shares": [[word, round(share, 3)] for word, share in shares],
        "said": said.said,
        "in_time": said.in_time(),
        "known": said.known,
        "meant": said.meant,
        "confidence": said.confidence if said.meant and said.calibrated else None,
        "horizon_steps": said.horizon_steps,
        "path": _path(said, task),
    }


def _path(said: Explanation, task: Task) -> list[list[float]] | None:
    return None if task.scene_path is None else task.scene_path(said.path).round(2).tolist()


def what_if_fields(said: Explanation, drawn: Callable[[Array], Array] | None) -> dict[str, Any]:
    """What the agent would do if it were told something else, as a page displays it.

    Args:
        said: the explanation.
        drawn: states ``(H + 1, S)`` to points ``(H + 1, 2)`` in scene units; None without a scene.

    Returns:
        ``what_if``: for each value that could be said what is ``told``, what is ``said`` to it, and the ``path`` (or
        None); empty if it was not asked. ``listens``: in [0, 1], or None. ``whatever``: what it does whatever it is
        told, or None.
    """
    answers = [
        {
            "told": name,
            "expression": float(movements_said([one])[0, 0]) if one.meant else None,
            "said": one.said,
            "path": None if drawn is None else drawn(one.path).round(2).tolist(),
        }
        for name, one in said.what_if.items()
    ]
    listens = None if said.listens is None or math.isnan(said.listens) else round(said.listens, 3)
    return {"what_if": answers, "listens": listens, "whatever": whatever(said)}
