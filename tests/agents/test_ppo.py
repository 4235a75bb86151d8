"""PPO's written-out loss and gradients are TorchRL's, and its steps those of autograd and Adam on each parameter."""

from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss

from ibe_rl.agents.actions import Actions, Categorical, Gaussian
from ibe_rl.agents.backward import differentiated
from ibe_rl.agents.equivariant import MirroredSpaces
from ibe_rl.agents.networks import make_network
from ibe_rl.agents.ppo import PPO, PPOConfig, PPOSteps, clipped_derivatives, clipped_losses
from ibe_rl.task import NUMBERS, Part
from ibe_rl.task.mirror import SignedPermutation

COUNT, CLIP = 200, 0.2
SIDES = SignedPermutation((0, 1, 3, 2), (-1, 1, 1, 1))
SPACES: dict[str, Any] = {
    "a few actions": gymnasium.spaces.Discrete(3, start=4),
    "several choices": gymnasium.spaces.MultiDiscrete([3, 2]),
    "continuous": gymnasium.spaces.Box(-1, 1, (2,), np.float32),
}
IMAGES = {"a few actions": (0, 2, 1), "several choices": (0, 2, 1, 3, 4), "continuous": (1, 0)}


def mirrored(outputs: tuple[int, ...]) -> MirroredSpaces:
    return MirroredSpaces(SIDES, SignedPermutation(outputs, (1.0,) * len(outputs)))


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
    ("actions", "policy", "image"),
    [(Categorical(3), choosing, (0, 2, 1)), (Gaussian(-torch.ones(2), torch.ones(2), 0.6), throttling, (1, 0))],
    ids=["a few actions", "continuous"],
)
@pytest.mark.parametrize("mirror", [False, True], ids=["plain", "mirrored"])
def test_losses_and_gradients_are_torchrls(actions: Actions, policy: Any, image: tuple[int, ...], mirror: bool):
    torch.manual_seed(1)
    spaces = mirrored(image) if mirror else None
    actor = actions.finish(make_network(4, [8], actions.outputs, nn.ReLU, 1.0, mirror=spaces))
    critic = make_network(4, [8], 1, nn.ReLU, 1.0, mirror=spaces and spaces.of_value())
    seen = torch.randn(COUNT, 4)
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
    gradients = written_out(actor, critic, actions, steps)
    sum(expected[name] for name in ("loss_objective", "loss_critic", "loss_entropy")).backward()
    matched = [parameter.grad for parameter in theirs.parameters()]
    assert len(matched) == len(gradients)
    for gradient, other in zip(gradients, matched, strict=True):
        torch.testing.assert_close(gradient, other)


def written_out(actor: nn.Module, critic: nn.Module, actions: Actions, steps: PPOSteps) -> list[Tensor]:
    """Of the sum of both losses less the entropy."""
    (outputs, actor_backward), (values, critic_backward) = (differentiated(one)(steps[0]) for one in (actor, critic))
    log_prob, _ = actions.evaluate_actions(outputs, steps.drawn)
    by_log_prob, by_value = clipped_derivatives(log_prob, values.squeeze(-1), steps, CLIP)
    by_outputs = actions.gradient(outputs, steps.drawn, by_log_prob, -1 / COUNT)
    return actor_backward(by_outputs) + critic_backward(by_value[:, None])


def plain_step(actor: nn.Module, critic: nn.Module, agent: PPO, steps: PPOSteps, optimizer: torch.optim.Adam) -> None:
    """As PPO's steps once were: by autograd, with Adam on each parameter."""
    config = agent._config
    log_prob, entropies = agent._actions.evaluate_actions(actor(steps.observation), steps.drawn)
    losses = clipped_losses(log_prob, entropies, critic(steps.observation).squeeze(-1), steps, config.clip)
    optimizer.zero_grad()
    (losses[0] + config.value_weight * losses[1] - 0.1 * losses[2]).backward()
    nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], config.max_grad_norm)
    optimizer.step()


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("mirror", [False, True], ids=["plain", "mirrored"])
@pytest.mark.parametrize("scale", [1.0, 1000.0], ids=["as they are", "standardised"])
def test_steps_are_those_of_autograd_and_adam_on_each_parameter(space: str, mirror: bool, scale: float):
    torch.manual_seed(3)
    config = PPOConfig(hidden=[8, 6], max_grad_norm=0.3, value_weight=0.7)
    spaces = mirrored(IMAGES[space]) if mirror else None
    agent = PPO(config, 4, SPACES[space], 1_000, ignored=[1], parts=[Part("", NUMBERS, (4,))], mirror=spaces)
    seen = scale * torch.randn(COUNT, 4)
    agent._standardiser.learn(seen)
    actor, critic = deepcopy(agent._actor), deepcopy(agent._critic)
    learnt = [*actor.parameters(), *critic.parameters()]
    first, optimizer = deepcopy(learnt), torch.optim.Adam(learnt, lr=config.learning_rate, eps=1e-5)
    with torch.no_grad():
        drawn = agent._actions.draw(actor(seen))
    for _ in range(5):
        noted = drawn["action_log_prob"] + 0.3 * torch.randn(COUNT)
        steps = PPOSteps(seen, drawn[agent._actions.learnt_from], noted, torch.randn(COUNT), torch.randn(COUNT))
        plain_step(actor, critic, agent, steps, optimizer)
        agent._step(steps, 0.1)
    assert agent.standardised == (["observations"] if scale > 1 else [])
    found = [*agent._actor.parameters(), *agent._critic.parameters()]
    torch.testing.assert_close(found, learnt, rtol=1e-5, atol=1e-6)
    assert all((one - before).abs().max() > 1e-4 for one, before in zip(found, first, strict=True) if one.numel() > 1)
