"""Settings that cannot work together are refused before anything is made."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ibe_rl.config.command_line import composed
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.training.check import check_run
from ibe_rl.types import ConfigError


@pytest.mark.parametrize(
    ("settings", "episode_steps", "refusal"),
    [
        (["log.capacity_frames=10000"], 10_000, "an episode has up to 10,000 steps; allowed is at least 10001"),
        (
            ["log.capacity_frames=10000", "collect.steps_per_batch=512"],
            1_000,
            "a batch has 65,536 frames; allowed is at least 65536",
        ),
        (["log.capacity_frames=10000"], 9_999, None),
    ],
)
def test_a_log_holds_the_longest_episode_and_a_batch(
    settings: list[str], episode_steps: int, refusal: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    cfg = composed("train", ["viewer=off", *settings])
    env = make_env(cfg.env)
    monkeypatch.setattr(env, "task", replace(task_of(env), max_episode_steps=episode_steps))
    if refusal is None:
        check_run(cfg, env)
        return
    with pytest.raises(ConfigError, match=f"log.capacity_frames=10000: {refusal}"):
        check_run(cfg, env)
