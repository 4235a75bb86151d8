"""Exploration noise that is held for several steps.

Each single action is as probable as with new noise at every step. But those of successive steps go together, so that
what takes many steps in a row is tried (Hollenstein et al. 2024, colored noise in PPO; Dabney et al. 2021, temporally
extended epsilon-greedy).
"""

from __future__ import annotations

import torch
from torch import Tensor


class HeldNoise:
    """Noise of each environment, held for a random time.

    With each batch all noise is new: a resumed run, which begins with a batch, then explores as an uninterrupted one.

    Args:
        mean_steps: for which noise is held; 1: never.
    """

    def __init__(self, mean_steps: float):
        self._mean_steps, self._held, self._batch = mean_steps, torch.zeros(0), -1

    def __call__(self, noise: Tensor, batch: int) -> Tensor:
        """New noise ``(N, M)`` in the ``batch`` of this number to the noise that counts."""
        if self._mean_steps <= 1:
            return noise
        if self._held.shape == noise.shape and self._batch == batch:
            new = torch.rand(len(noise), 1) * self._mean_steps < 1
            noise = torch.where(new, noise, self._held)
        self._held, self._batch = noise, batch
        return noise
