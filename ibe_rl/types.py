"""Types shared by all layers: episodes, moments, explanations, and protocols of the parts.

It imports only numpy. Shapes: ``T`` steps of an episode, ``S`` state dimensions, ``d`` numbers in an instruction, ``H``
steps of a prediction, ``P`` numbers in a percept (mostly the state), ``O = P + d + 1`` numbers in an observation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

Array = np.ndarray
Policy = Callable[[Array], Array]
"""Observations ``(N, O)`` float32 to actions ``(N,)``, without exploration."""
DOES_NOT_KNOW, CANNOT_TELL = "I do not know", "I cannot tell"
"""Said when the confidence is too low, and when the meaning of the word is unknown."""


class ConfigError(ValueError):
    """A setting that cannot work; the message names the key, the value and what is allowed."""


def observe(percept: Array, instruction: Array, given: Array) -> Array:
    """Join the parts of the policy's observation.

    Args:
        percept: ``(..., P)`` what the agent perceives of the environment, mostly its state.
        instruction: ``(..., d)``, 0 where none was given.
        given: ``(..., 1)``, 1 where one was given: silence differs from the instruction 0.

    Returns:
        ``(..., P + d + 1)`` float32.
    """
    return np.concatenate([percept, instruction, given], axis=-1).astype(np.float32)


def read_only(array: Array, shape: tuple[int | None, ...], name: str) -> Array:
    """Return a read-only view of ``array`` after checking its shape (None matches any length).

    Raises:
        ValueError: if the shape differs.
    """
    array = np.asarray(array)
    if array.ndim != len(shape) or not all(n in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    (view := array.view()).flags.writeable = False
    return view


@dataclass(frozen=True)
class Episode:
    """One whole episode: ``T`` actions between ``T + 1`` states.

    Attributes:
        states: ``(T + 1, S)`` in the environment's observation units, including the last one.
        actions: ``(T,)`` or ``(T, A)``.
        rewards: ``(T,)`` as the environment gave them.
        instructions: ``(T, d)`` the instruction the agent saw when it chose the action, 0 in silence.
        given: ``(T,)`` bool, False where the instructor said nothing.
        terminated: True if the environment ended it, False if it was truncated.
        success: True if the environment's own success rule held at the end.
        context: one of the task's ``contexts``.
        percepts: ``(T + 1, P)``; None where they are the states, or were not kept.
    """

    states: Array
    actions: Array
    rewards: Array
    instructions: Array
    given: Array
    terminated: bool
    success: bool
    context: str
    percepts: Array | None = None

    def __post_init__(self) -> None:
        steps, more = len(self.actions), (None,) * (np.ndim(self.actions) - 1)
        shapes = {"states": (steps + 1, None), "actions": (steps, *more), "rewards": (steps,)}
        shapes |= {"instructions": (steps, None), "given": (steps,), "percepts": (steps + 1, None)}
        for name, shape in shapes.items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, read_only(getattr(self, name), shape, f"Episode.{name}"))

    def __len__(self) -> int:
        return len(self.actions)

    def as_steps(self) -> dict[str, Array]:
        """Columns ``(1, T, ...)`` for the log, as of one environment."""
        last = np.arange(len(self)) == len(self) - 1
        columns = {
            "state": self.states[:-1],
            "action": self.actions,
            "reward": self.rewards,
            "instruction": self.instructions,
            "given": self.given,
            "next_state": self.states[1:],
            "done": last,
            "terminated": last & self.terminated,
            "success": last & self.success,
        }
        seen = {} if self.percepts is None else {"percept": self.percepts[:-1], "next_percept": self.percepts[1:]}
        return {name: column[None] for name, column in (columns | seen).items()}

    @property
    def total_reward(self) -> float:
        """Undiscounted sum of the rewards."""
        return float(np.sum(self.rewards, dtype=np.float64))


@dataclass(frozen=True)
class Moment:
    """A time step of an episode from which the future can be predicted.

    Attributes:
        state: ``(S,)``.
        instruction: ``(d,)``, 0 in silence.
        given: False where the instructor said nothing.
        snapshot: what the environment needs to continue from here, or None; opaque to all others.
        percept: ``(P,)``; None where it is the state.
        memory: what a policy with a memory remembers here, before it acts; None at the beginning, and for all others.
        twin: index in the roll-out of the moment that this one repeats, told something else, with the same chance.
    """

    state: Array
    instruction: Array
    given: bool
    snapshot: Any = None
    percept: Array | None = None
    memory: Any = None
    twin: int | None = None


def columns_of(moments: Sequence[Moment]) -> tuple[Array, Array, Array]:
    """Moments as states ``(N, S)``, instructions ``(N, d)`` and whether they were given ``(N, 1)``, float32."""
    states = np.array([moment.state for moment in moments], np.float32)
    given = np.array([[moment.given] for moment in moments], np.float32)
    return states, np.array([moment.instruction for moment in moments], np.float32), given


def percepts_of(moments: Sequence[Moment]) -> Array:
    """What the agent perceives at moments, ``(N, P)``."""
    perceived = [moment.percept for moment in moments if moment.percept is not None]
    return np.array(perceived) if perceived else columns_of(moments)[0]


@dataclass(frozen=True)
class Explanation:
    """The agent's explanation, at one moment, of its next ``horizon_steps`` steps.

    Attributes:
        expression: ``(d,)`` in [-1, 1], the instructor's scale (m_t in the paper).
        phrase: the expression in words.
        cluster: id of the cluster of the predicted change, stable across refreshes.
        delta_state: ``(S,)`` predicted change of the state.
        horizon_steps: in steps of the environment.
        confidence: the probability of a correct phrase once calibrated, before that ``agreement`` times ``purity``.
        path: ``(H + 1, S)`` predicted states, the current one first; repeats the last one after an end.
        futures: ``(F, S)`` predicted changes of all sampled futures, ``delta_state`` one of them.
        agreement: share of these with the same phrase and a path trusted to the horizon.
        purity: share of the cluster's windows with its most frequent instruction.
        known: False if the confidence is too low or the meaning of the word is unknown.
        meant: False if the meaning of the word is unknown.
        calibrated: whether ``confidence`` is a probability; if not, it is not shown.
        spans: explanations of the other spans from here, by rising horizon.
        trusted_steps: steps for which the predictor trusts ``path``; None for all.
        in_words: whether the expression is shares of words, in [0, 1], and no numbers.
        what_if: what it would do if it were told each of these values for ``horizon_steps``, by name; empty: not asked.
        listens: spread of these answers: 0, it does the same whatever it is told; 1, it obeys. None: not asked.
        later_futures: ``(L, S)`` as ``futures``, over windows that begin a few steps later.
        trusted_share: of the futures, to the horizon.
        of_the_moment: the phrase of this moment alone, where an earlier one still holds; None: it is ``phrase``.
        movement: ``(d,)`` the number beside the phrase, a mean over the futures; None: the expression.
    """

    expression: Array
    phrase: str
    cluster: int
    delta_state: Array
    horizon_steps: int
    confidence: float
    path: Array
    futures: Array
    agreement: float = 1.0
    purity: float = 1.0
    known: bool = True
    meant: bool = True
    calibrated: bool = True
    spans: tuple[Explanation, ...] = ()
    trusted_steps: int | None = None
    in_words: bool = False
    what_if: Mapping[str, Explanation] = field(default_factory=dict)
    listens: float | None = None
    later_futures: Array = field(default_factory=lambda: np.zeros((0, 0)))
    trusted_share: float = 1.0
    of_the_moment: str | None = None
    movement: Array | None = None

    @property
    def trusted(self) -> bool:
        """Whether the predictor trusts the path to the horizon."""
        return self.trusted_steps is None or self.trusted_steps >= self.horizon_steps

    @property
    def trusted_path(self) -> Array:
        """The path ``(H + 1, S)``, repeating the last trusted state from there on."""
        last = len(self.path) if self.trusted_steps is None else self.trusted_steps
        return self.path[np.minimum(np.arange(len(self.path)), last)]

    @property
    def said(self) -> str:
        """The phrase, or that the agent does not know or cannot tell."""
        return (self.phrase if self.known else DOES_NOT_KNOW) if self.meant else CANNOT_TELL

    @property
    def all_spans(self) -> list[Explanation]:
        """This one and those of the other spans, by rising horizon."""
        return sorted((*self.spans, self), key=lambda one: one.horizon_steps)

    def in_time(self, shortened: Callable[[str], str] = str) -> str:
        """The phrases of all spans by rising horizon, without repetition."""
        parts: list[tuple[int, str]] = []
        for steps, said in ((one.horizon_steps, shortened(one.said)) for one in self.all_spans):
            if not parts or parts[-1][1] != said:
                parts.append((steps, said))
        if len(parts) <= 2:
            return parts[0][1] if len(parts) == 1 else f"now {parts[0][1]}, later {parts[1][1]}"
        return ", ".join(f"within {steps} steps {said}" for steps, said in parts)


class Instructor(Protocol):
    """Gives instructions to ``N`` agents."""

    def reset(self, rows: Array) -> None:
        """Begin a new episode in the True rows of ``(N,)`` bool."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """Give agents their instructions, once per step.

        Args:
            states: ``(N, S)``.
            rows: ``(N,)`` bool, active agents; results of the others are ignored, and their time does not advance.

        Returns:
            instructions ``(N, d)`` float32, 0 where silent, and given ``(N, 1)`` float32, 0 or 1.
        """


class ExpressionMapping(Protocol):
    """f: change of the state to expression, learnt at one refresh."""

    @property
    def ids(self) -> Array:
        """Ids ``(k,)`` of the clusters, stable across refreshes."""

    def cluster(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to cluster indices ``(W,)``."""

    def express(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)`` in [-1, 1]."""

    def knows(self, delta: Array) -> Array:
        """Whether the meaning of the word is known, ``(W,)`` bool, for changes ``(W, S)``."""

    def confidence(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to confidences ``(W,)`` in [0, 1]."""


@dataclass(frozen=True)
class Prediction:
    """``N`` predicted futures.

    Attributes:
        paths: ``(N, H + 1, S)`` predicted states, the current one first; one that ends early repeats its last state.
        trusted_steps: ``(N,)`` steps, at most ``H``, for which the predictor trusts each path.
        uncertainty: ``(N,)`` expected error of the last states in spreads of changes: 0 is exact, 1 tells nothing.
    """

    paths: Array
    trusted_steps: Array
    uncertainty: Array

    def __post_init__(self) -> None:
        each = (len(self.paths),)
        for name, shape in (("paths", (None, None, None)), ("trusted_steps", each), ("uncertainty", each)):
            object.__setattr__(self, name, read_only(getattr(self, name), shape, f"Prediction.{name}"))

    @classmethod
    def exact(cls, paths: Array) -> Prediction:
        """The prediction of a predictor that is certain of its paths ``(N, H + 1, S)``."""
        return cls(paths, np.full(len(paths), paths.shape[1] - 1), np.zeros(len(paths), np.float32))


class Predictor(Protocol):
    """Predicts the rollouts of a policy from given moments."""

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """Follow the greedy policy for ``horizon_steps`` from each of ``N`` moments; returns as many futures."""
