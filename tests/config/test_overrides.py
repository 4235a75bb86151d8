"""Values of a program as settings, and kinds that it chose without a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from ibe_rl.config.command_line import composed
from ibe_rl.config.limits import setting
from ibe_rl.config.overrides import as_overrides, chosen_kind, kind_name
from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe import IBEMapping
from ibe_rl.types import ConfigError


@dataclass
class CalmConfig(MappingConfig):
    calmness: float = setting(1.0, low=0.0, high=2.0)


class Calm(IBEMapping):
    settings = CalmConfig


CALM = f"{__name__}:Calm"


def test_values_are_written_as_on_the_command_line() -> None:
    values = {"collect": {"processes": 1, "overlap": True}, "stop_after_frames": None, "viewer": "off", "seed": 3}
    written = ["collect.processes=1", "collect.overlap=true", "stop_after_frames=null", "viewer='off'", "seed=3"]
    assert [*as_overrides(values)] == written
    odd = {"run_dir": Path("my runs/a=b, c's"), "agent": {"hidden": [8, 8], "learning_rate": 1e-4}}
    cfg = composed("train", [*as_overrides(odd | {"viewer": "off"})])
    assert (cfg.run_dir, cfg.agent.hidden, cfg.agent.learning_rate) == ("my runs/a=b, c's", [8, 8], 1e-4)
    with pytest.raises(ConfigError, match=r"agent.hidden=<object .*allowed are numbers, texts, lists"):
        [*as_overrides({"agent": {"hidden": object()}})]


@pytest.mark.parametrize(
    "choice",
    [{"kind": Calm, "calmness": 0.5}, {"kind": CALM, "calmness": 0.5}, CalmConfig(kind=CALM, calmness=0.5)],
    ids=["class", "name", "settings"],
)
def test_a_kind_is_chosen_without_a_file(choice: Any) -> None:
    assert chosen_kind("mapping", choice) == CalmConfig(kind=CALM, calmness=0.5)


def test_a_class_alone_has_its_defaults() -> None:
    assert chosen_kind("mapping", Calm) == CalmConfig(kind=CALM)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"kind": Calm, "calmness": 3}, "mapping.calmness=3.0: allowed is at least 0 and at most 2"),
        ({"kind": Calm, "calm": 1}, "mapping.calm=1: no such setting"),
        ({"kind": "nowhere:Calm"}, "mapping.kind=nowhere:Calm: allowed is module:Class"),
        ({"calmness": 1}, "mapping.kind=None: allowed is module:Class, or the class"),
    ],
)
def test_what_is_no_kind_is_refused(choice: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        chosen_kind("mapping", choice)


def test_a_class_that_nobody_else_could_import_is_refused() -> None:
    class Here(Calm):
        pass

    with pytest.raises(ConfigError, match=r"mapping.kind=.*<locals>.Here: allowed is a class at the top of a module"):
        kind_name("mapping", Here)
