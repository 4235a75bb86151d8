"""Whether the agent's networks are equivariant: decided from environment and instructor, or refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from ibe_rl.config.command_line import composed
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.task import NUMBERS, Part
from ibe_rl.task.mirror import Mirror
from ibe_rl.training import mirroring
from ibe_rl.training.mirroring import with_mirror
from ibe_rl.types import ConfigError


def decided(*settings: str) -> bool | None:
    cfg = composed("train", ["viewer=off", *settings])
    env = make_env(cfg.env)
    return with_mirror(cfg, task_of(env), env.action_space).agent.mirror


@pytest.mark.parametrize(
    ("settings", "used"),
    [
        ([], True),
        (["agent=dqn"], True),
        (["agent.mirror=false"], False),
        (["env=lander_continuous"], True),
        (["env=cart_pole"], True),
        (["env=pendulum"], False),  # declares none
        (["env=lander_words"], False),
        (["env.kwargs.enable_wind=true"], False),
        (["instructor=flawed"], True),
        (["instructor=human"], False),  # what a person means by +1 is for the agent to find out
        (["agent.hidden=[63]"], False),
        (["agent.ignores=[goal_x]"], True),
        (["agent.ignores=[left_leg]"], False),
        (["agent.ignores=[left_leg,right_leg]"], True),
    ],
)
def test_it_is_used_where_it_holds(settings: list[str], used: bool) -> None:
    assert decided(*settings) is used


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        (["env=pendulum"], "Pendulum-v1 declares no mirror image"),
        (["instructor=human"], "instructor=human: what somebody's own instructions mean"),
        (["agent.hidden=[64,63]"], r"agent.hidden=\[64, 63\]: half of the units are mirror images, and 63 is odd"),
        (["agent.ignores=[right_leg]"], r"agent.ignores=\['right_leg'\]: in the mirror image left_leg and right_leg"),
    ],
)
def test_asked_for_where_it_cannot_be_it_is_refused(settings: list[str], reason: str) -> None:
    with pytest.raises(ConfigError, match=rf"^agent.mirror=true: {reason}.*; allowed is agent.mirror=false$"):
        decided("agent.mirror=true", *settings)


@pytest.mark.parametrize(
    ("mirror", "actions", "fits"),
    [
        (Mirror((), actions=(1, 0)), gymnasium.spaces.Discrete(2), True),
        (Mirror((), actions=(1, 0)), gymnasium.spaces.Discrete(3), False),
        (Mirror((), actions=(1, 0)), gymnasium.spaces.MultiBinary(2), False),
        (Mirror((), action_signs=(1.0, -1.0)), gymnasium.spaces.Box(np.array([0, -2]), np.array([1, 2])), True),
        (Mirror((), action_signs=(-1.0, 1.0)), gymnasium.spaces.Box(np.array([0, -2]), np.array([1, 2])), False),
    ],
)
def test_the_mirror_image_of_actions_fits_them(mirror: Mirror, actions: gymnasium.Space, fits: bool) -> None:
    cfg = composed("train", ["viewer=off", "env=cart_pole"])
    task = replace(task_of(make_env(cfg.env)), mirror=mirror)
    assert with_mirror(cfg, task, actions).agent.mirror is fits


def test_what_is_perceived_in_place_of_the_state_has_no_declared_mirror_image() -> None:
    cfg = composed("train", ["viewer=off", "agent.mirror=true"])
    env = make_env(cfg.env)
    task = replace(task_of(env), parts=(Part("", NUMBERS, (9,)),))
    with pytest.raises(ConfigError, match=r"^agent.mirror=true: it is declared of the state, and the agent perceives"):
        with_mirror(cfg, task, env.action_space)


def test_an_agent_of_ones_own_may_not_know_mirror_images(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mirroring, "takes", lambda _, argument: argument != "mirror")
    assert decided() is False
    with pytest.raises(ConfigError, match=r"^agent.mirror=true: the constructor of agent=ppo takes no mirror"):
        decided("agent.mirror=true")
