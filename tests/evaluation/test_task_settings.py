"""Settings of explain.py that a task would not read are refused."""

import pytest

from ibe_rl.config.settings import ExplainConfig, ViewerConfig
from ibe_rl.evaluation.task_settings import refuse_unread
from ibe_rl.types import ConfigError


@pytest.mark.parametrize(("name", "value"), [("clip", "x.gif"), ("output", "x.rrd"), ("context", "left")])
def test_what_is_of_an_explained_episode(name: str, value: str) -> None:
    given = {name: value, "viewer": ViewerConfig(mode="file")}
    refuse_unread(ExplainConfig(**given))
    refuse_unread(ExplainConfig(task="evaluate"))
    with pytest.raises(ConfigError, match=rf"^{name}={value} with task=evaluate: allowed with it is task=episode"):
        refuse_unread(ExplainConfig(task="evaluate", **given))
    with pytest.raises(ConfigError, match=rf"^{name}={value} with sweep=runs: allowed with it is task=episode"):
        refuse_unread(ExplainConfig(sweep_dir="runs", **given))


@pytest.mark.parametrize(("name", "field", "value"), [("with", "with_run", "runs/x"), ("with_frame", "with_frame", 9)])
def test_what_is_of_a_summary(name: str, field: str, value: str | int) -> None:
    refuse_unread(ExplainConfig(task="summary", viewer=ViewerConfig(mode="file"), **{field: value}))
    with pytest.raises(ConfigError, match=rf"^{name}={value} with task=episode: allowed with it is task=summary"):
        refuse_unread(ExplainConfig(viewer=ViewerConfig(mode="file"), **{field: value}))


def test_a_recording_needs_a_viewer_that_records() -> None:
    refuse_unread(ExplainConfig(output="x.rrd", viewer=ViewerConfig(mode="live")))
    with pytest.raises(ConfigError, match=r"^output=x\.rrd with viewer=off: allowed with it is viewer=file or"):
        refuse_unread(ExplainConfig(output="x.rrd", viewer=ViewerConfig(mode="off")))
