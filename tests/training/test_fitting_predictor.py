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
from ibe_rl.training.fitting_predictor import with_fitting_predictor
from ibe_rl.types import ConfigError


def settings(game: type[Any], *settings: str) -> TrainConfig:
    short = ["mapping.horizon_steps=3", "mapping.spans_steps=[]"]
    cfg: TrainConfig = composed("train", [*SMALL, *short, "viewer=off", *settings])
    cfg.env = given_env(game, awkward.lift_task())
    return cfg


def test_an_engine_that_can_be_copied_is_simulated() -> None:
    cfg = settings(awkward.Stopped)
    assert with_fitting_predictor(cfg, make_env(cfg.env)) == (cfg, [])


def test_a_learned_predictor_takes_over_with_what_was_set() -> None:
    cfg = settings(awkward.Forgetful, "predictor.futures=2")
    found, [note] = with_fitting_predictor(cfg, make_env(cfg.env))
    assert (found.predictor.kind, found.predictor.futures) == ("ensemble", 2)
    assert cfg.predictor.kind == "simulator"
    assert "its height is off by" in note
    assert "predictor=ensemble takes over" in note


def test_what_was_named_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    cfg = settings(awkward.Forgetful)
    monkeypatch.setattr(fitting_predictor, "given_settings", lambda: ["seed=1", "predictor=simulator"])
    assert with_fitting_predictor(cfg, make_env(cfg.env)) == (cfg, [])
    learned = settings(awkward.Forgetful, "predictor=regression")
    assert with_fitting_predictor(learned, make_env(cfg.env)) == (learned, [])


def test_the_next_one_takes_over_where_the_first_cannot_work(monkeypatch: pytest.MonkeyPatch) -> None:
    cfg, refused = settings(awkward.Forgetful), ["ensemble"]

    def check(config: Any, *_: Any) -> None:
        if config.kind in refused:
            raise ConfigError("not here")

    monkeypatch.setattr(fitting_predictor, "check_predictor", check)
    assert with_fitting_predictor(cfg, make_env(cfg.env))[0].predictor.kind == "regression"
    refused.append("regression")
    with pytest.raises(CopyError, match=r"predictor=simulator with env\.id=.*allowed is predictor=ensemble or"):
        with_fitting_predictor(cfg, make_env(cfg.env))


def test_the_run_says_so_and_keeps_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cfg = settings(awkward.Forgetful, f"run_dir={tmp_path / 'run'}")
    with build(cfg) as run:
        assert run.cfg.predictor.kind == "ensemble"
        assert "takes over" in run.notes[0]
    assert "note: " in capsys.readouterr().out
    assert load_config(tmp_path / "run" / CONFIG, TrainConfig, cfg.env).predictor.kind == "ensemble"
