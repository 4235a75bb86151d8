"""Settings from a file of their own are checked as those of a run are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from ibe_rl.config.limits import setting
from ibe_rl.config.yaml_file import settings_from
from ibe_rl.types import ConfigError


@dataclass
class Inner:
    times: int = setting(2, low=1, high=9)


@dataclass
class Outer:
    name: str = "a"
    inner: Inner = field(default_factory=Inner)
    names: list[str] = field(default_factory=lambda: ["x"])


def test_what_is_given_counts_and_the_rest_is_default() -> None:
    assert settings_from({"inner": {"times": 3}}, Outer) == Outer(inner=Inner(3))
    assert settings_from({}, Outer) == Outer()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "allowed are settings, KEY: VALUE in each line"),
        ({"nam": 1}, "nam=1: no such setting; allowed are name, inner, names; did you mean name?"),
        ({3: 1}, "3=1: no such setting"),
        ({"inner": {"time": 3}}, "inner.time=3: no such setting; allowed are times"),
        ({"inner": {"times": "often"}}, "inner.times: .*often"),
        ({"inner": {"times": 10}}, "inner.times=10: allowed is at least 1 and at most 9"),
        ({"inner": 3}, "inner=3: allowed are settings, KEY: VALUE"),
        ({"inner": None}, "inner=None: allowed are settings, KEY: VALUE"),
        ({"names": 3}, "names: "),
    ],
)
def test_what_is_wrong_is_named(values: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^{message}"):
        settings_from(values, Outer)
