"""The way of a transition from the engine to rerun is the one that train.py's docstring shows, and no longer."""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Callable, Iterator
from functools import cache
from types import FrameType
from typing import Any

import pytest
from processes import SMALL, call

import train
from tests.rooms import PACKAGE, ROOT

WAY = dict(re.findall(r"^    (\w+/\w+\.py) +(\w+)  ", train.__doc__ or "", re.MULTILINE))
"""File to function, as train.py says."""
VALUES = ("types.py", "task", "metrics", "config", "runtime")
"""Rooms that others ask for a value, and that hand nothing on."""
ASIDE = ("vocabulary/reactions.py",)
"""What plays episodes of its own, to find out what the words mean."""


class Tracer:
    """Follows the calls between files of the package.

    Attributes:
        calls: pairs of files, the caller in another room than the called one.
        returned: files and functions, in the order in which they first returned, without what happens aside.
    """

    def __init__(self) -> None:
        self.calls: set[tuple[str, str]] = set()
        self.returned: dict[tuple[str, str], None] = {}

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        if event not in ("call", "return") or (here := ours(frame.f_code.co_filename)) is None:
            return
        if event == "call":
            caller = next(self.callers(frame), here)
            if room(caller) != room(here):
                self.calls.add((caller, here))
        elif (returned := (here, frame.f_code.co_name)) not in self.returned and not self.aside(here, frame):
            self.returned[returned] = None

    def aside(self, here: str, frame: FrameType) -> bool:
        return not {here, *self.callers(frame)}.isdisjoint(ASIDE)

    @staticmethod
    def callers(frame: FrameType) -> Iterator[str]:
        above = frame.f_back
        while above is not None:
            if file := ours(above.f_code.co_filename):
                yield file
            above = above.f_back


@cache
def ours(path: str) -> str | None:
    """A file, below the package or train.py; None for others."""
    if path == str(ROOT / "train.py"):
        return "train.py"
    return path.removeprefix(f"{PACKAGE}/") if path.startswith(f"{PACKAGE}/") else None


def room(file: str) -> str:
    """The loop itself, train.py and what it calls in training/, counts as one room."""
    first = file.partition("/")[0]
    return "training" if first == "train.py" else first


@pytest.fixture(scope="module")
def traced(tmp_path_factory: pytest.TempPathFactory) -> Tracer:
    tracer, real = Tracer(), train.train
    folder = tmp_path_factory.mktemp("spine") / "run"
    settings = ["total_frames=2048", "refresh_every_frames=2048", "mapping.meaning=assumed", "viewer=file"]

    def traced_train(run: Any) -> Any:
        return following(tracer, lambda: real(run))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "train", traced_train)
        call("train", *SMALL, *settings, f"run_dir={folder}")
    return tracer


def following(tracer: Tracer, do: Callable[[], Any]) -> Any:
    threading.setprofile(tracer)
    sys.setprofile(tracer)
    try:
        return do()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def test_the_way_is_short() -> None:
    assert 10 <= len(WAY) <= 12
    assert all((PACKAGE / file).is_file() for file in WAY)


def test_a_transition_goes_this_way_and_in_this_order(traced: Tracer) -> None:
    returned = [(file, name) for file, name in traced.returned if WAY.get(file) == name]
    assert returned == list(WAY.items())


def test_it_passes_no_other_room(traced: Tracer) -> None:
    rooms = {room(file) for file in WAY} | {"training", *VALUES}
    assert {called for _, called in traced.calls if room(called) not in rooms} == set()


def test_the_loop_calls_no_other_file(traced: Tracer) -> None:
    called = {used for user, used in traced.calls if user == "train.py"}
    assert called - set(WAY) <= {"collect/schedule.py"}  # which says what is due


def test_the_script_is_read_in_one_sitting() -> None:
    lines = (ROOT / "train.py").read_text().splitlines()
    assert len(lines) <= 130
    assert sum(line.startswith("from ibe_rl") for line in lines) <= 12
    assert len((ROOT / "explain.py").read_text().splitlines()) <= 100
