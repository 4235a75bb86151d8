"""PPO's written-out loss is TorchRL's, for both kinds of actions."""

from typing import Any

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss

from ibe_rl.agents.actions import Actions, Categorical, Gaussian
from ibe_rl.agents.networks import make_network
from ibe_rl.agents.ppo import PPOSteps, clipped_losses

COUNT, CLIP = 200, 0.2


def choosing(network: nn.Module) -> ProbabilisticActor:
    """TorchRL's own policy with a few actions."""
    logits = TensorDictModule(network, in_keys=["observation"], out_keys=["logits"])
    draw: dict[str, Any] = {"distribution_class": torch.distributions.Categorical, "return_log_prob": True}
    return ProbabilisticActor(logits, in_keys=["logits"], **draw)


class Independent(torch.distributions.Independent):
    """Normal distributions of several numbers that are one action."""

    def __init__(self, loc: Tensor, scale: Tensor):
        super().__init__(torch.distributions.Normal(loc, scale), 1)


def throttling(network: nn.Module) -> ProbabilisticActor:
    """TorchRL's own policy with continuous actions."""
    both = nn.Sequential(network, NormalParamExtractor(scale_mapping="exp"))
    names = ["loc", "scale"]
    module = TensorDictModule(both, in_keys=["observation"], out_keys=names)
    return ProbabilisticActor(module, in_keys=names, distribution_class=Independent, return_log_prob=True)


@pytest.mark.parametrize(
    ("actions", "policy"),
    [(Categorical(3), choosing), (Gaussian(-torch.ones(2), torch.ones(2), 0.6), throttling)],
    ids=["a few actions", "continuous"],
)
def test_losses_and_gradients_are_torchrls(actions: Actions, policy: Any):
    torch.manual_seed(1)
    actor = actions.finish(make_network(4, [8], actions.outputs, nn.ReLU, 1.0))
    critic, seen = make_network(4, [8], 1, nn.ReLU, 1.0), torch.randn(COUNT, 4)
    names = ("observation", "action", "log_prob", "advantage", "value_target")
    with torch.no_grad():
        drawn = actions.draw(actor(seen))
    noted = drawn["action_log_prob"] + 0.3 * torch.randn(COUNT)
    steps = PPOSteps(seen, drawn[actions.learnt_from], noted, 2 * torch.randn(COUNT) + 1, torch.randn(COUNT))
    ours = clipped_losses(*actions.evaluate_actions(actor(seen), steps.drawn), critic(seen).squeeze(-1), steps, CLIP)

    theirs = ClipPPOLoss(
        policy(actor),
        ValueOperator(critic, in_keys=["observation"]),
        clip_epsilon=CLIP,
        normalize_advantage=True,
        entropy_coeff=1.0,
        critic_coeff=1.0,
        loss_critic_type="l2",
    )
    data = TensorDict(dict(zip(names, steps, strict=True)), [COUNT])
    data["action_log_prob"] = data.pop("log_prob")
    for column in ("advantage", "value_target"):
        data[column] = data[column][:, None]
    expected = theirs(data)
    values = [expected["loss_objective"], expected["loss_critic"], expected["entropy"]]
    for one, other in zip(ours, values, strict=True):
        torch.testing.assert_close(one, other)
    own = [*actor.named_parameters(), *critic.named_parameters()]
    weighted = ours[0] + ours[1] - ours[2]
    gradients = torch.autograd.grad(weighted, [parameter for _, parameter in own])
    sum(expected[name] for name in ("loss_objective", "loss_critic", "loss_entropy")).backward()
    matched = [parameter.grad for parameter in theirs.parameters()]
    assert len(matched) == len(gradients)
    for gradient, other in zip(gradients, matched, strict=True):
        torch.testing.assert_close(gradient, other)
