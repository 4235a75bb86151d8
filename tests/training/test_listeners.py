"""Listeners hear the same events; one that fails is named and dropped, unless the training cannot go on without it."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from view_data import TASK, filmed, refreshed

from ibe_rl.apps.loggers.csv import Csv
from ibe_rl.apps.loggers.mlflow import Mlflow
from ibe_rl.apps.loggers.run_logger import RunLogger
from ibe_rl.apps.loggers.tensorboard import Tensorboard
from ibe_rl.apps.loggers.wandb import Wandb
from ibe_rl.apps.teach.classroom import Classroom
from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.training.listeners import Checkpoints, Listeners, LiveView, Standardised, Table
from ibe_rl.training.progress import TrainingProgress
from ibe_rl.training.success_note import SuccessNote
from ibe_rl.view.run_recorder import RunRecorder
from ibe_rl.vocabulary.listener import Listener, Refreshed

ROW = {"frames": 10, "train/return_mean": 1.0, "train/success_rate": 0.5}
EVENTS = [name for name, member in vars(Listener).items() if inspect.isfunction(member) and name != "news"]
OURS = [Checkpoints, Classroom, Listeners, LiveView, RunRecorder, Standardised, SuccessNote, Table, TrainingProgress]
LOGGERS = [RunLogger, Csv, Mlflow, Tensorboard, Wandb]


def event() -> Refreshed:
    rollout, said, real = filmed()
    refresh = refreshed()
    return Refreshed(
        10, 1, refresh, rollout, said, real, ExplainerState(refresh.mapping, 20, TASK.phrases), came_true=1.0
    )


def tell_all(listener: Listener) -> None:
    """All events, in the order in which a training tells them."""
    listener.begin(SimpleNamespace(log=SimpleNamespace(frames=5)))
    listener.batch(10, ROW)
    listener.refreshed(event())
    listener.skipped(20, "too little")
    listener.evaluated(20, 0.5, 1.0)
    listener.end({"frames": 20})
    listener.close()


class Heard(Listener):
    """Writes down what it hears; raises where it is asked to."""

    def __init__(self, heard: list[str], name: str = "", fails_at: str = "", essential: bool = False):
        self._heard, self._name, self._fails_at, self.essential = heard, name, fails_at, essential

    def _hear(self, event: str) -> None:
        self._heard.append(self._name + event)
        if event == self._fails_at:
            raise ValueError(f"a bug\nin {event}")

    def begin(self, run: Any) -> None:
        self._hear("begin")

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        self._hear("batch")

    def refreshed(self, event: Refreshed) -> None:
        self._hear("refreshed")

    def skipped(self, frames: int, reason: str) -> None:
        self._hear("skipped")

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        self._hear("evaluated")

    def end(self, summary: Mapping[str, Any]) -> None:
        self._hear("end")

    def close(self) -> None:
        self._hear("close")

    def news(self) -> Iterable[str]:
        return [f"news of {self._heard[-1]}"]


def known(kind: type) -> set[type]:
    return {kind} | {one for each in kind.__subclasses__() for one in known(each)}


def test_these_are_all_listeners_of_the_package() -> None:
    ours = {one for one in known(Listener) if one.__module__.startswith("ibe_rl.")}
    assert ours == {Listener, *OURS, *LOGGERS}


@pytest.mark.parametrize("kind", [*OURS, *LOGGERS])
def test_each_takes_the_events_of_the_protocol(kind: type[Listener]) -> None:
    for name in EVENTS:
        expected = [*inspect.signature(getattr(Listener, name)).parameters]
        assert [*inspect.signature(getattr(kind, name)).parameters] == expected
    assert isinstance(kind.essential, bool)
    assert kind.timer in ("stream", "checkpoint")


def test_a_listener_that_overrides_nothing_takes_them_all() -> None:
    tell_all(Listener())
    assert [*Listener().news()] == []


def test_all_hear_the_same_in_their_order_and_their_news_are_said() -> None:
    heard: list[str] = []
    lines: list[str] = []
    tell_all(Listeners([Heard(heard, "a "), Heard(heard, "b ")], lines.append))
    assert heard == [f"{name} {event}" for event in EVENTS for name in "ab"]
    assert lines == [f"news of {one}" for one in heard]


@pytest.mark.parametrize("at", EVENTS)
def test_one_that_fails_is_named_and_dropped(at: str) -> None:
    heard: list[str] = []
    lines: list[str] = []
    tell_all(Listeners([Heard(heard, "a ", fails_at=at), Heard(heard, "b ")], lines.append))
    assert [one for one in heard if one.startswith("b")] == [f"b {event}" for event in EVENTS]
    assert [one for one in heard if one.startswith("a")][-1] == f"a {at}"
    frames = {"begin": 5, "batch": 10, "refreshed": 10}.get(at, 20)
    [line] = [line for line in lines if line.startswith("warning")]
    assert line == (
        f"warning: {frames} frames: the listener Heard failed (ValueError: a bug in {at}): it gets no more "
        "events, training goes on"
    )


def test_one_that_the_training_needs_ends_it() -> None:
    listeners = Listeners([Heard([], fails_at="batch", essential=True)], print)
    listeners.begin(SimpleNamespace(log=SimpleNamespace(frames=0)))
    with pytest.raises(ValueError, match="a bug"):
        listeners.batch(1, ROW)
    assert Table.essential
    assert Checkpoints.essential


def test_the_live_view_says_what_becomes_of_it() -> None:
    news = ["the server has ended"]
    view = LiveView(lambda: [news.pop()] if news else [])
    assert [*view.news()] == ["the server has ended"]
    assert [*view.news()] == []


def test_the_recording_hears_it_all(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "a", replace(TASK), "run", max_mb=50)
    tell_all(recorder)
    assert [*recorder.news()] == []
    assert (tmp_path / "a").stat().st_size > 10_000


def test_what_is_standardised_is_said_once():
    agent = SimpleNamespace(standardised=[])
    listener = Standardised()
    assert [*listener.news()] == []  # a run that ends before it begins asks too
    listener.begin(SimpleNamespace(agent=agent))
    assert listener.news() == []
    agent.standardised = ["observations"]
    assert listener.news() == ["note: the agent standardises observations (agent.standardise_observations)"]
    agent.standardised = ["observations", "rewards"]
    assert listener.news() == ["note: the agent standardises rewards (agent.standardise_rewards)"]
    assert listener.news() == []
    listener.begin(SimpleNamespace(agent=agent))  # taken up
    assert listener.news() == []
    listener.begin(SimpleNamespace(agent=SimpleNamespace()))  # an agent of one's own need not say it
    assert listener.news() == []
