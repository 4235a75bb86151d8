"""What all tests share."""

import gc
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

STARTERS = ("pages", "processes", "viewers")
"""Modules of tests/ that start scripts, browsers and viewers."""

os.environ["RERUN_STRICT"] = "1"  # wrong calls of rerun raise instead of being logged
# a script that a test starts runs this code, whatever else is installed
os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent.parent), os.environ.get("PYTHONPATH", "")])

for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
    # nohup hands SIGHUP on as ignored, a shell SIGINT to what it starts with &, and so would we; handlers are not
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else lambda *_: None)

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as slow what can start a script, a browser or a viewer, and let slow files begin first."""
    for item in items:
        if any(map(starts_programs, functions_of(item))):
            item.add_marker(pytest.mark.slow)
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish() -> None:
    """Let garbage be sought only in what tests make: each refresh of a vocabulary asks for it, half a second a time."""
    gc.collect()
    gc.freeze()


def functions_of(item: Any) -> list[Callable[..., Any]]:
    """The function of a test and those of its fixtures."""
    fixtures = [each.func for defined in item._fixtureinfo.name2fixturedefs.values() for each in defined]
    return [item.function, *fixtures]


def starts_programs(function: Callable[..., Any]) -> bool:
    """Whether its module has something from one that starts programs."""
    found = getattr(function, "__globals__", {}).values()
    return any(getattr(one, "__module__", None) in STARTERS for one in found if callable(one))
