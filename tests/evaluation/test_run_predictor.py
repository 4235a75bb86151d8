"""Which predictor a finished run is explained with."""

from types import SimpleNamespace
from typing import Any

import pytest

from ibe_rl.config import command_line
from ibe_rl.config.settings import ExplainConfig, PredictorConfig
from ibe_rl.evaluation.run_predictor import as_trained
from ibe_rl.predict.ensemble import EnsembleConfig
from ibe_rl.predict.regression import RegressionConfig
from ibe_rl.types import ConfigError

BY_RULE = PredictorConfig(future_instruction="rule", futures=1)
ASKED = PredictorConfig(futures=7)


def explained(own: PredictorConfig, *named: str) -> PredictorConfig:
    run: Any = SimpleNamespace(config=SimpleNamespace(predictor=own))
    return as_trained(ExplainConfig(predictor=ASKED), run, named).predictor


def test_rollouts_are_instructed_as_in_the_training_unless_that_is_named():
    assert explained(PredictorConfig()) == ASKED
    by_rule = PredictorConfig(future_instruction="rule", futures=7)
    assert explained(BY_RULE) == explained(BY_RULE, "predictor", "predictor.futures") == by_rule
    assert explained(BY_RULE, "predictor", "predictor.future_instruction") == ASKED


def test_a_learnt_predictor_is_the_runs_own_unless_one_is_named():
    own = EnsembleConfig(updates=5)
    assert explained(own) == own
    assert explained(own, "predictor") == ASKED


def test_one_setting_changes_the_runs_own_learnt_predictor():
    own = EnsembleConfig(updates=5)
    assert explained(own, "predictor.futures", "run") == EnsembleConfig(updates=5, futures=7)


def test_a_setting_that_the_runs_own_predictor_does_not_allow_is_refused_by_name():
    run: Any = SimpleNamespace(config=SimpleNamespace(predictor=RegressionConfig()))
    asked = ExplainConfig(predictor=PredictorConfig(future_instruction="rule"))
    with pytest.raises(ConfigError, match=r"predictor\.future_instruction=rule: allowed is one of hold"):
        as_trained(asked, run, ["predictor.future_instruction"])


def test_what_is_named_and_what_it_is_part_of(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(command_line, "given_settings", lambda: ["run=runs/one", "predictor.futures=3"])
    assert command_line.given_keys() == {"run", "predictor.futures"}
    assert command_line.named_settings() == {"run", "predictor", "predictor.futures"}
