"""PPO's written-out loss is TorchRL's."""

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss

from ibe_rl.agent.networks import make_network
from ibe_rl.agent.ppo import Steps, clipped_losses


def test_losses_and_gradients_are_torchrls():
    torch.manual_seed(1)
    count, clip = 200, 0.2
    actor, critic = make_network(4, [8], 3, nn.ReLU, 1.0), make_network(4, [8], 1, nn.ReLU, 1.0)
    names = ("observation", "action", "log_prob", "advantage", "value_target")
    seen, action = torch.randn(count, 4), torch.randint(3, (count,))
    noted = actor(seen).log_softmax(-1).gather(-1, action[:, None]).squeeze(-1).detach() + 0.3 * torch.randn(count)
    steps = Steps(seen, action, noted, 2 * torch.randn(count) + 1, torch.randn(count))
    ours = clipped_losses(actor(seen).log_softmax(-1), critic(seen).squeeze(-1), steps, clip)

    logits = TensorDictModule(actor, in_keys=["observation"], out_keys=["logits"])
    draw = {"distribution_class": torch.distributions.Categorical, "return_log_prob": True}
    theirs = ClipPPOLoss(
        ProbabilisticActor(logits, in_keys=["logits"], **draw),
        ValueOperator(critic, in_keys=["observation"]),
        clip_epsilon=clip,
        normalize_advantage=True,
        entropy_coeff=1.0,
        critic_coeff=1.0,
        loss_critic_type="l2",
    )
    data = TensorDict(dict(zip(names, steps, strict=True)), [count])
    data["action_log_prob"] = data.pop("log_prob")
    for column in ("advantage", "value_target"):
        data[column] = data[column][:, None]
    expected = theirs(data)
    values = [expected["loss_objective"], expected["loss_critic"], expected["entropy"]]
    for one, other in zip(ours, values, strict=True):
        torch.testing.assert_close(one, other)
    own = [*actor.parameters(), *critic.parameters()]
    weighted = ours[0] + ours[1] - ours[2]
    gradients = torch.autograd.grad(weighted, own)
    sum(expected[name] for name in ("loss_objective", "loss_critic", "loss_entropy")).backward()
    for gradient, parameter in zip(gradients, theirs.parameters(), strict=True):
        torch.testing.assert_close(gradient, parameter.grad)
