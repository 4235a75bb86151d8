"""The cheapest predictor: a regression from the state to its change over a few spans, without steps between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from ibe_rl.config.limits import KEPT, setting
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.ibe.delta import delta_states
from ibe_rl.predict.experience import held_out, newest_episodes
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, ConfigError, Episode, Moment, Policy, Prediction, columns_of, observe

MAX_WINDOWS = 40_000


@dataclass
class RegressionConfig(PredictorConfig):
    """A regression from the state to its change, without the policy: a minimal baseline."""

    kind: str = setting("regression", kept=True)
    future_instruction: str = setting("hold", choices=("hold",), learnt=False)  # there are no steps between
    futures: int = setting(1, low=1, high=100, learnt=False)  # all are identical
    spans_steps: list[int] = field(
        default_factory=list, metadata=KEPT
    )  # empty: the explained horizons and twice the longest
    degree: int = setting(2, low=1, high=3, kept=True)  # of the polynomial features
    newest_frames: int = setting(400_000, low=1)  # about this many frames of the log


class Regression:
    """Predicts the average change from similar states in the log; the policy is not called.

    Between learnt spans it interpolates linearly, beyond the longest one it is constant.

    Args:
        config: see ``RegressionConfig``.
        seed: of the sample of windows.
        spans_steps: the spans to learn, called by ``learn``.
    """

    kind, settings, learns, asks_policy = "regression", RegressionConfig, True, False

    def __init__(self, config: RegressionConfig, seed: int, spans_steps: Callable[[], Sequence[int]]):
        self._config, self._seed, self._spans_steps = config, seed, spans_steps
        self._spans = np.zeros(0, int)
        self._features = PolynomialFeatures(config.degree, include_bias=False)
        self._weights: Array | None = None
        self._bias = self._error = np.zeros(0)

    @classmethod
    def make(
        cls, config: RegressionConfig, *, seed: int, horizons_steps: Callable[[], Sequence[int]], **_: Any
    ) -> Self:
        """See ``ibe_rl.predict.KeptPredictor``."""
        return cls(config, seed, lambda: config.spans_steps or [*horizons_steps(), 2 * max(horizons_steps())])

    @staticmethod
    def check(config: RegressionConfig, env: Any) -> None:  # noqa: ARG004 - as of the other kinds
        """Refuse spans below one step.

        Raises:
            ConfigError: naming the key, the value and what is allowed.
        """
        if min([1, *config.spans_steps]) < 1:
            raise ConfigError(f"predictor.spans_steps={list(config.spans_steps)}: allowed is at least 1 for each")

    def learn(self, log: TrajectoryLog, until_frame: int | None = None) -> None:
        """Fit again on the newest episodes of the log; see ``Ensemble.learn``.

        Raises:
            ValueError: if there is no such episode.
        """
        self._spans = np.unique(self._spans_steps())
        learnt, judged = held_out(newest_episodes(log, self._config.newest_frames, until_frame))
        seen, change = self._windows(learnt)
        model = make_pipeline(self._features, StandardScaler(), Ridge()).fit(seen, change)
        self._weights, self._bias = _folded(model)
        seen, change = self._windows(judged)
        left = self._change(seen) - change.reshape(len(seen), len(self._spans), -1)
        self._error = _relative_rmse(left, change.reshape(left.shape))

    def _windows(self, episodes: Sequence[Episode]) -> tuple[Array, Array]:
        """Observations ``(W, O)`` and changes over all spans ``(W, C S)``; windows are cut at the episode's end."""
        seen = [observe(each.states[:-1], each.instructions, each.given[:, None]) for each in episodes]
        spans = [[delta_states(each.states, int(n), "clamp") for n in self._spans] for each in episodes]
        changes = np.concatenate([np.concatenate(columns, axis=1) for columns in spans])
        rows = np.random.default_rng(self._seed).permutation(len(changes))[:MAX_WINDOWS]
        return np.concatenate(seen)[rows], changes[rows]

    def _change(self, seen: Array) -> Array:
        """Observations ``(N, O)`` to changes ``(N, C, S)``."""
        assert self._weights is not None
        columns = self._features.fit(seen[:1]).transform(seen)  # fit only counts the columns
        return np.asarray(columns @ self._weights + self._bias).reshape(len(seen), len(self._spans), -1)

    def rollout(self, moments: Sequence[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        """See ``ibe_rl.types.Predictor``; the policy is not called.

        Raises:
            ValueError: before the first ``learn``.
        """
        if self._weights is None:
            raise ValueError("the regression has not been trained yet")
        states, instruction, given = columns_of(moments)
        change = self._change(observe(states, instruction, given)).astype(np.float32)
        known = np.concatenate([np.zeros_like(change[:, :1]), change], axis=1)
        paths = states[:, None] + _interpolated(known, np.array([0, *self._spans]), horizon_steps)
        trusted = np.full(len(moments), min(horizon_steps, int(self._spans[-1])))
        error = np.interp(horizon_steps, self._spans, self._error)
        return Prediction(paths, trusted, np.full(len(moments), error, np.float32))

    def forget(self) -> None:
        """Nothing to forget."""

    def state_dict(self) -> dict[str, Any]:
        """What it has learnt, as arrays; empty before that."""
        if self._weights is None:
            return {}
        return {"spans": self._spans, "weights": self._weights, "bias": self._bias, "error": self._error}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``, for a regression made with the same settings.

        Raises:
            ValueError: if the settings differ.
            KeyError: if an entry is missing.
        """
        if not state:
            return
        arrays = {name: np.array(state[name]) for name in ("spans", "weights", "bias", "error")}
        spans = np.unique(self._spans_steps())
        if not np.array_equal(arrays["spans"], spans):
            raise ValueError(f"it looks {arrays['spans'].tolist()} steps ahead, expected {spans.tolist()}")
        if arrays["weights"].ndim != 2 or arrays["weights"].shape[1:] != arrays["bias"].shape:
            raise ValueError(f"its weights have the shape {arrays['weights'].shape}")
        self._spans = spans
        self._weights, self._bias, self._error = arrays["weights"], arrays["bias"], arrays["error"]

    def close(self) -> None:
        """Nothing to close."""


def _folded(model: Pipeline) -> tuple[Array, Array]:
    """Combine scaling and regression into one matrix and bias, which need no pickle."""
    scaler, ridge = model[1], model[2]
    weights = ridge.coef_.T / scaler.scale_[:, None]
    return weights, ridge.intercept_ - scaler.mean_ @ weights


def _relative_rmse(left: Array, change: Array) -> Array:
    """Errors and changes ``(W, C, S)`` to the RMSE ``(C,)`` in standard deviations of the changes."""
    spread = change.std(axis=0)
    shares = np.sqrt(np.mean(left**2, axis=0)) / np.where(spread > 0, spread, 1)
    return np.asarray(
        [
            np.sqrt(np.mean(row[varies] ** 2)) if varies.any() else 0.0
            for row, varies in zip(shares, spread > 0, strict=True)
        ]
    )


def _interpolated(known: Array, at: Array, horizon_steps: int) -> Array:
    """Interpolate values ``(N, C, S)`` at steps ``at`` ``(C,)`` to all steps ``(N, H + 1, S)``."""
    steps = np.minimum(np.arange(horizon_steps + 1), at[-1])
    right = np.searchsorted(at, steps).clip(1)
    share = ((steps - at[right - 1]) / (at[right] - at[right - 1])).astype(np.float32)[:, None]
    return np.asarray(known[:, right - 1] * (1 - share) + known[:, right] * share)
