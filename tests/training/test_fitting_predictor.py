"""Where an engine cannot be copied exactly, a learned predictor takes over, unless one was named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import awkward
import pytest
from processes import SMALL

from ibe_rl.config.command_line import composed
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.errors import CopyError
from ibe_rl.envs.giving import given_env
from ibe_rl.envs.make import make_env
from ibe_rl.storage.run_folder import CONFIG
from ibe_rl.training import fitting_predictor
from ibe_rl.training.build import build
from ibe_rl.training.fitting_predictor import with_learned_predictor
from ibe_rl.types import ConfigError


def settings(game: type[Any], *settings: str) -> TrainConfig:
    short = ["mapping.horizon_steps=3", "mapping.spans_steps=[]"]
    cfg: TrainConfig = composed("train", [*SMALL, *short, "viewer=off", *settings])
    cfg.env = given_env(game, awkward.lift_task())
    return cfg


FOUND = CopyError("Lift-v0", "its height is off by 1")


def taken_over(cfg: TrainConfig) -> tuple[TrainConfig, list[str]]:
    return with_learned_predictor(cfg, make_env(cfg.env), FOUND)


def test_a_learned_predictor_takes_over_with_what_was_set() -> None:
    cfg = settings(awkward.Forgetful, "predictor.futures=2")
    found, [note] = taken_over(cfg)
    assert (found.predictor.kind, found.predictor.futures) == ("ensemble", 2)
    assert cfg.predictor.kind == "simulator"
    assert note.startswith("Lift-v0: its height is off by 1; so predictor=ensemble takes over")


def test_what_was_named_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting_predictor, "given_settings", lambda: ["seed=1", "predictor=simulator"])
    with pytest.raises(CopyError, match="its height is off by 1"):
        taken_over(settings(awkward.Forgetful))


def test_the_next_one_takes_over_where_the_first_cannot_work(monkeypatch: pytest.MonkeyPatch) -> None:
    cfg, refused = settings(awkward.Forgetful), ["ensemble"]

    def check(config: Any, *_: Any) -> None:
        if config.kind in refused:
            raise ConfigError("not here")

    monkeypatch.setattr(fitting_predictor, "check_predictor", check)
    assert taken_over(cfg)[0].predictor.kind == "regression"
    refused.append("regression")
    with pytest.raises(CopyError, match=r"predictor=simulator with env\.id=.*allowed is predictor=ensemble or"):
        taken_over(cfg)


def test_an_engine_that_can_be_copied_is_simulated(tmp_path: Path) -> None:
    with build(settings(awkward.Stopped, f"run_dir={tmp_path / 'run'}")) as run:
        assert run.cfg.predictor.kind == "simulator"
        assert not [note for note in run.notes if "takes over" in note]


def test_the_run_says_so_and_keeps_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cfg = settings(awkward.Forgetful, f"run_dir={tmp_path / 'run'}")
    with build(cfg) as run:
        assert run.cfg.predictor.kind == "ensemble"
        assert "takes over" in run.notes[0]
    assert "note: " in capsys.readouterr().out
    assert load_config(tmp_path / "run" / CONFIG, TrainConfig, cfg.env).predictor.kind == "ensemble"
