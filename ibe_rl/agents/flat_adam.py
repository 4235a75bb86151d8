"""Adam on one tensor that holds all parameters."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor, nn


class FlatAdam(torch.optim.Adam):
    """Adam that works on all parameters at once, so that a step costs the same however many there are.

    The parameters become views of one tensor: whoever holds them sees each step. A copy of them is independent.

    Args:
        parameters: all of one type; their order is that of the gradients.
        learning_rate: until ``param_groups`` is given another.
        eps: see ``torch.optim.Adam``.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], learning_rate: float, eps: float = 1e-8):
        parameters = list(parameters)
        self.flat = nn.Parameter(_joined(parameters).detach())
        views = self.flat.detach().split([one.numel() for one in parameters])
        for one, view in zip(parameters, views, strict=True):
            one.data = view.view_as(one)
        super().__init__([self.flat], lr=learning_rate, eps=eps, fused=True)

    def descend(self, gradients: Iterable[Tensor], max_norm: float | None = None) -> None:
        """Take a step.

        Args:
            gradients: by each parameter.
            max_norm: they are scaled down to this norm together, as by ``torch.nn.utils.clip_grad_norm_``; None: not.
        """
        gradient = _joined(gradients)
        if max_norm is not None and (scale := max_norm / (float(gradient.norm()) + 1e-6)) < 1:
            gradient *= scale
        self.flat.grad = gradient
        self.step()

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """The inverse of ``state_dict``; also for the state of an Adam with one entry for each parameter."""
        each = [state_dict["state"][number] for number in sorted(state_dict["state"])]
        moments = {name: _joined(one[name] for one in each) for name in ("exp_avg", "exp_avg_sq") if each}
        group = state_dict["param_groups"][0] | {"params": [0]}
        state = {0: {"step": each[0]["step"], **moments}} if each else {}
        super().load_state_dict({"state": state, "param_groups": [group]})


def _joined(tensors: Iterable[Tensor]) -> Tensor:
    return torch.cat([one.flatten() for one in tensors])
