"""Vectorised rollouts through learned members; each future follows one member."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ibe_rl.predict.members import Layers, Scale, in_state_units, run
from ibe_rl.types import Array

CHECK_EVERY_STEPS = 10
"""Interval at which all members are compared."""
Act = Callable[[int, Array], Array]
"""Step and states ``(R, S)`` to action columns ``(R, A)``."""
Begin = Callable[[Array], Act]
"""Indices ``(R,)`` of the futures rolled out next to their ``Act``."""


@dataclass(frozen=True)
class Rolled:
    """``N`` futures.

    Attributes:
        paths: ``(N, H + 1, S)`` predicted states; one that ends early repeats its last state.
        apart: ``(N, C, G)`` disagreement in the ``G`` graded dimensions after each ``CHECK_EVERY_STEPS`` steps: the
            members' standard deviations over one step, summed as if their errors were fully correlated.
    """

    paths: Array
    apart: Array

    def at(self, rows: Array) -> Rolled:
        """The futures of these rows."""
        return Rolled(self.paths[rows], self.apart[rows])


def checks(horizon_steps: int) -> int:
    """``C``, the number of comparisons in a rollout."""
    return -(-horizon_steps // CHECK_EVERY_STEPS)


@torch.inference_mode()
def roll(layers: Layers, scale: Scale, states: Array, begin: Begin, horizon_steps: int, at_once: int) -> Rolled:
    """Roll futures out.

    Args:
        layers: of the members; future ``i`` follows member ``i`` modulo their number.
        scale: of the states.
        states: ``(N, S)`` start states.
        begin: how they act.
        horizon_steps: ``H``.
        at_once: futures that are rolled out together, as many as fit the processor's cache.
    """
    members, count, size = len(layers[0][0]), len(states), states.shape[1]
    padded = -(-count // members) * members
    paths = torch.empty(horizon_steps + 1, padded, size)
    apart = torch.empty(checks(horizon_steps), padded, int(scale.graded.sum()))
    paths[0] = torch.from_numpy(states[np.minimum(np.arange(padded), count - 1)])
    block = max(1, at_once // members) * members
    following = _Block(in_state_units(layers, scale), scale)
    for cut in range(0, padded, block):
        rows = slice(cut, min(cut + block, padded))
        by_member = np.arange(rows.start, rows.stop).reshape(-1, members).T.ravel()
        following.roll(paths[:, rows], apart[:, rows], begin(np.minimum(by_member, count - 1)))
    return Rolled(paths[:, :count].numpy().swapaxes(0, 1), apart[:, :count].numpy().swapaxes(0, 1))


class _Block:
    """A block of futures, with the rows of each member contiguous for the matrix products."""

    def __init__(self, layers: Layers, scale: Scale):
        self._layers, self._members, self._size = layers, len(layers[0][0]), len(scale.mean)
        self._binary = torch.from_numpy(np.flatnonzero(scale.binary))
        graded = torch.from_numpy(np.flatnonzero(scale.graded))
        self._compared = [*layers[:-1], (layers[-1][0][..., graded], layers[-1][1][..., graded])]

    def roll(self, paths: Tensor, apart: Tensor, act: Act) -> None:
        """Fill ``paths`` ``(H + 1, R, S)`` from its first states, and ``apart`` ``(C, R, G)``."""
        inputs = self._inputs(paths[0])
        states = inputs[..., : self._size]
        running = torch.ones(*states.shape[:2], 1, dtype=torch.bool)
        gap = torch.zeros(*states.shape[:2], apart.shape[-1])
        for step in range(len(paths) - 1):
            columns = act(step, states.reshape(-1, self._size).numpy())
            inputs[..., self._size :] = torch.from_numpy(columns).view(*states.shape[:2], -1)
            if step % CHECK_EVERY_STEPS == 0:
                gap += running * self._disagreement(inputs)
                self._put(gap, apart[step // CHECK_EVERY_STEPS])
            outputs = run(self._layers, inputs)
            after = self._after(states, outputs)
            states.copy_(after if bool(running.all()) else torch.where(running, after, states))
            running &= outputs[..., -1:] < 0
            self._put(states, paths[step + 1])

    def _inputs(self, start: Tensor) -> Tensor:
        columns = self._layers[0][0].shape[1]
        inputs = torch.zeros(self._members, len(start) // self._members, columns)
        inputs[..., : self._size] = start.view(-1, self._members, self._size).transpose(0, 1)
        return inputs

    def _after(self, states: Tensor, outputs: Tensor) -> Tensor:
        after = states + outputs[..., : self._size]  # 0 for constant dimensions
        if len(self._binary):
            after[..., self._binary] = (outputs[..., self._binary] > 0).float()
        return after

    def _disagreement(self, inputs: Tensor) -> Tensor:
        """Disagreement of all members over the next steps ``(M, n, G)``."""
        rows = inputs.reshape(1, -1, inputs.shape[-1]).expand(self._members, -1, -1)
        predicted = run(self._compared, rows)
        squares = (predicted - predicted.mean(dim=0)).square_().mean(dim=0)  # many times faster than Tensor.std
        return CHECK_EVERY_STEPS * squares.sqrt_().view(*inputs.shape[:2], -1)

    def _put(self, values: Tensor, rows: Tensor) -> None:
        """Copy ``(M, n, K)`` to ``(M n, K)`` in the order of the futures."""
        rows.view(-1, self._members, values.shape[-1]).copy_(values.transpose(0, 1))
