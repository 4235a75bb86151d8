"""Simulated people reach a study by its messages or by its page in a browser, on every kind of screen."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest
from own_study import stimulus, write_study

from ibe_rl.apps.study import by_page, visits
from ibe_rl.apps.study.analysis import sittings
from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.by_messages import ByMessages
from ibe_rl.apps.study.by_page import ByPage, find_chromium
from ibe_rl.apps.study.data import tables_of
from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.pilot import pilot
from ibe_rl.apps.study.simulated import Participant
from ibe_rl.apps.study.visits import Visit, go_through
from ibe_rl.types import ConfigError

TASKS = ["landing", "next_words"]
A_PIXEL = 0.006
"""In widths of the picture, on a screen of 360 pixels; one key moves by 0.01."""


class Scripted:
    """A way to a server that says what a test wants."""

    def __init__(self, *shown: dict[str, Any], of: str = "nobody"):
        self._shown, self.token = list(shown), of

    async def begin(self) -> dict[str, Any]:
        return self._shown[0]

    async def reload(self) -> dict[str, Any]:
        return self._shown[-1]

    async def give(self, *_: Any) -> tuple[Any, dict[str, Any]]:
        return None, {"refused": "another page is to be answered"}


def walked(folder: Path, way: Scripted, pilot_of: Answers | None = None) -> Visit:
    visit = Visit(Participant(), np.random.default_rng(0))
    answers = pilot_of or Answers(folder / FILE)
    asyncio.run(go_through(visit, way, open_study(folder), answers))
    return visit


def test_a_server_of_another_study_is_refused(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    with pytest.raises(ConfigError, match="the server serves another one; allowed is a server of this study"):
        walked(folder, Scripted({"page": "consent", "attempt": 1}))


def test_a_refused_answer_and_a_wrong_page_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(visits, "RELOAD_PROBABILITY", 1.0)
    folder = write_study(tmp_path / "study")
    answers = Answers(folder / FILE)
    person = answers.begin(("ibe",), open_study(folder).protocol, pilot=True)
    pages = [{"page": "consent", "attempt": 1}, {"page": "instructions", "attempt": 1}]
    visit = walked(folder, Scripted(*pages, of=person.token), answers)
    assert (visit.ended, visit.wrong_pages, visit.confirmed) == ("refused", 1, [])
    answers.close()


def test_a_server_that_lets_nobody_in_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    async def begin() -> None:
        async with aiohttp.ClientSession() as session:
            way = ByMessages(session, "http://there", {})

            async def refuse(*_: Any) -> dict[str, str]:
                return {"refused": "full"}

            monkeypatch.setattr(way, "_ask", refuse)
            await way.begin()

    with pytest.raises(ConfigError, match=r"address=http://there: lets nobody in \(full\)"):
        asyncio.run(begin())


def test_without_playwright_the_way_to_get_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(by_page, "find_spec", lambda _: None)
    with pytest.raises(ConfigError, match=r"needs the package playwright; pip install 'ibe_rl\[study-pilot\]', or thr"):
        pilot(write_study(tmp_path / "study"), people=1)


def test_a_browser_is_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "chromium"
    own.touch()
    own.chmod(0o755)
    assert find_chromium(str(own), "") == str(own)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_chromium("", "") == str(own)
    monkeypatch.setenv("PATH", os.devnull)
    assert find_chromium("", str(own)) == str(own)
    with pytest.raises(
        ConfigError, match=r"chromium=: none of chromium, .* is on the path; allowed is .* install chrom"
    ):
        find_chromium("", str(tmp_path / "none"))
    with pytest.raises(ConfigError, match="chromium=nothing: no program is there; allowed is"):
        find_chromium("nothing", str(own))


def test_an_episode_without_end_is_given_up() -> None:
    class Tab:
        """A page on which nothing ever comes."""

        clock = property(lambda self: self)

        def locator(self, _: str) -> Tab:
            return self

        async def run_for(self, _: int) -> None: ...

        async def count(self) -> int:
            return 0

    way: Any = ByPage(Tab(), "", {})  # type: ignore[arg-type]
    with pytest.raises(RuntimeError, match="an episode played longer than 200 s"):
        asyncio.run(way._run_until("#next"))


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_three_people_use_the_page_by_pointer_touch_and_keys(tmp_path: Path, task: str) -> None:
    """Each answers all pages; what they chose is what the analysis reads, to the pixel or the key."""
    trials = {"practice": 1, "each_arm": 2, "attention_checks": 1, "task": task, "feedback": "always"}
    folder = write_study(tmp_path / "study", trials=trials)
    found = pilot(folder, 3, 3, drop_out=0.0, lapse=0.0, noise=0.0, reliance=(1.0, 1.0), say=lambda _: None)
    assert [visit.ended for visit in found.visits] == ["finished"] * 3
    assert (found.lost, found.changed, found.confirmation_s) == (0, 0, [])
    study = open_study(folder)
    table = tables_of(study, sittings(study)[0]).trials
    assert len(table) == 9
    for episode, arm, given in zip(table.episode, table.arm, table.answer, strict=True):
        told = stimulus(episode, task)["observers"][arm]
        assert given == (pytest.approx(told["at"], abs=A_PIXEL) if task == "landing" else told["choice"])
    for visit in found.visits:
        took = [answer.took_ms / 1000 for answer in visit.confirmed]
        assert np.median(took) == pytest.approx(visit.person.pace_s, rel=0.5)
        assert all(answer.hidden_ms == 0 for answer in visit.confirmed)
