"""Tells hydra the schemas of ``ibe_rl.config.settings``."""

from __future__ import annotations

from hydra.core.config_store import ConfigStore

from ibe_rl.config.settings import (
    DQNConfig,
    EnsembleConfig,
    EnvConfig,
    ExplainConfig,
    FlawedConfig,
    HumanConfig,
    InstructorConfig,
    MappingConfig,
    PPOConfig,
    PredictorConfig,
    RecordedConfig,
    RegressionConfig,
    TrainConfig,
    ViewerConfig,
)


def register() -> None:
    """Tell hydra the schemas; the files in configs/ refer to them by these names."""
    store = ConfigStore.instance()
    store.store(name="train_schema", node=TrainConfig)
    store.store(name="explain_schema", node=ExplainConfig)
    groups: dict[str, type] = {
        "env/schema": EnvConfig,
        "agent/ppo_schema": PPOConfig,
        "agent/dqn_schema": DQNConfig,
        "instructor/schema": InstructorConfig,
        "instructor/flawed_schema": FlawedConfig,
        "instructor/recorded_schema": RecordedConfig,
        "instructor/human_schema": HumanConfig,
        "mapping/schema": MappingConfig,
        "predictor/schema": PredictorConfig,
        "predictor/ensemble_schema": EnsembleConfig,
        "predictor/regression_schema": RegressionConfig,
        "viewer/schema": ViewerConfig,
    }
    for path, node in groups.items():
        group, name = path.split("/")
        store.store(group=group, name=name, node=node)
