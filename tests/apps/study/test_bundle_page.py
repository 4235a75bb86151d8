"""A bundle in a real browser: from a plain host of files, to the endpoint that docs/STUDY.md shows."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from browsers import browsing
from own_study import write_study
from playwright.sync_api import Browser, Route
from processes import ROOT
from served import wait_until
from visitors import Toucher

from ibe_rl.apps.study.analysis import analyse
from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.bundle import make_bundle
from ibe_rl.apps.study.collecting import collect_answers
from ibe_rl.runtime.ports import free_port

pytestmark = pytest.mark.slow
[ENDPOINT] = re.findall(r"```python\n(.*?)```", (ROOT / "docs/STUDY.md").read_text(), re.DOTALL)
PHONE = {"viewport": {"width": 360, "height": 740}, "has_touch": True, "is_mobile": True, "reduced_motion": "reduce"}
CODES = {"finished": "F1", "screened_out": "S1", "no_consent": "N1"}


class QuietFiles(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@contextmanager
def hosted(folder: Path) -> Iterator[str]:
    """A plain host of files; its address."""
    host = ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietFiles, directory=str(folder)))
    thread = Thread(target=host.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{host.server_port}"
    finally:
        host.shutdown()
        thread.join()
        host.server_close()


class Endpoint:
    """The endpoint of the documentation in a process of its own, which can be killed."""

    def __init__(self, folder: Path, pages: str):
        self.port = free_port(0, 0)
        self.folder = folder
        self.code = ENDPOINT.replace("8473", str(self.port)).replace("https://www.example.org", pages)
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", self.code], cwd=self.folder, stdout=subprocess.DEVNULL, env={**os.environ}
        )
        end = time.monotonic() + 60
        while socket.socket().connect_ex(("127.0.0.1", self.port)):
            assert time.monotonic() < end
            assert self.process.poll() is None
            time.sleep(0.02)

    def kill(self) -> None:
        assert self.process is not None
        self.process.kill()
        self.process.wait()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/answers"

    @property
    def file(self) -> Path:
        return self.folder / "answers.jsonl"

    def messages(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.file.read_text().split("\n") if line]


class Guest(Toucher):
    """Comes by a link to a bundle."""

    def __init__(self, browser: Browser, link: str, host: str, endpoint: Endpoint):
        self.open(browser, f"{host}/{link}", (host, endpoint.address), **PHONE)

    def has_ended(self, how: str) -> None:
        wait_until(self.page, f"document.body.dataset.ended === {how!r}")


class Bundled:
    """A bundle on a host, with its endpoint."""

    def __init__(self, folder: Path, host: str, people: int):
        self.folder, self.host = folder, host
        self.endpoint = Endpoint(folder.parent, host)
        out = folder.parent / "out"
        make_bundle(folder, str(out), self.endpoint.address, people=people)
        (out / "public").rename(folder.parent / "public/study")
        self.links = (out / "links.txt").read_text().split()
        self.endpoint.start()


@contextmanager
def bundled(folder: Path, people: int) -> Iterator[Bundled]:
    (folder.parent / "public").mkdir()
    with hosted(folder.parent / "public") as host:
        there = Bundled(folder, f"{host}", people)
        try:
            yield there
        finally:
            there.endpoint.kill()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browsing() as found:
        yield found


def test_a_bundle_loses_nothing_and_takes_nothing_twice(
    browser: Browser, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trials = {"practice": 1, "each_arm": 2, "attention_checks": 1}
    folder = write_study(tmp_path / "study", trials=trials, recruiter="prolific", completion_codes=CODES)
    with bundled(folder, people=2) as there:
        guest = Guest(browser, f"study/{there.links[0]}", there.host, there.endpoint)
        seen = go_through(guest, there.endpoint)
        assert guest.page.inner_text("#completion-code") == "F1"
        guest.page.reload()
        guest.has_ended("finished")
        assert guest.page.locator("#go-back").count() == 1
        assert guest.wrong == []
        sent = there.endpoint.messages()
        repeats = [name for name, times in Counter(one["id"] for one in sent).items() if times > 1]
        assert len(repeats) == 1  # its reply was lost
        first = "answers: 13 taken, 1 repeated, 0 answered before, 0 of people who withdrew"
        assert collect_answers(folder, there.endpoint.file).startswith(first)
    answers = Answers(folder / FILE)
    [person] = answers.people()
    kept = answers.answers_of(person)
    answers.close()
    assert person.ended == "finished"
    assert {f"{one.page} {one.attempt}" for one in kept} == {*seen}
    assert len(seen) == 13
    said = {one["answer"]["page"]: one["answer"]["value"] for one in sent if one["answer"]["attempt"] == 1}
    assert {one.page: one.value for one in kept if one.attempt == 1} == said
    assert [value["at"] for page, value in said.items() if "trial" in page] == [pytest.approx(0.25, abs=0.01)] * 3
    analyse(folder)
    assert "1 people began" in capsys.readouterr().out


def go_through(guest: Guest, endpoint: Endpoint) -> list[str]:
    """Answer all pages: with a reload, a lost reply, no connection, and a dead endpoint with a reload."""
    shown, seen = guest.after(""), []
    while shown:
        seen.append(shown)
        if shown == "demographics 1":
            guest.page.reload()
            assert guest.after("") == shown
            guest.page.route(endpoint.address, lose_the_reply, times=1)
        offline, dead = shown == "comprehension 1", shown.startswith("trial/") and shown.endswith("/1 1")
        dead = dead and "practice" not in shown
        guest.page.context.set_offline(offline)
        if dead:
            endpoint.kill()
        guest.answer(shown)
        if offline or dead:
            wait_until(guest.page, "!document.getElementById('waiting').hidden")
            assert guest.shown == shown  # not before it is confirmed
            guest.page.context.set_offline(False)
        if dead:
            guest.page.reload()
            wait_until(guest.page, "!document.getElementById('waiting').hidden")
            assert guest.shown == ""
            endpoint.start()
            shown = ""
        if "practice" in shown:
            guest.phase("feedback")
            guest.page.tap("#next")
        shown = guest.after(shown)
    return seen


def lose_the_reply(route: Route) -> None:
    """The endpoint gets the message; the page does not learn that."""
    route.fetch()
    route.abort()


def test_leaving_a_bundle(browser: Browser, tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study", trials={"practice": 0, "each_arm": 1, "attention_checks": 0})
    with bundled(folder, people=2) as there:
        nobody = Guest(browser, "study/page.html?p=nobody", there.host, there.endpoint)
        nobody.has_ended("unknown")
        refuser, leaver = (Guest(browser, f"study/{link}", there.host, there.endpoint) for link in there.links)
        assert refuser.after("") == "consent 1"
        refuser.page.tap("#disagree")
        refuser.has_ended("no_consent")
        assert leaver.after("") == "consent 1"
        leaver.page.tap("#agree")
        leaver.after("consent 1")
        there.endpoint.kill()
        leaver.page.tap("#next")
        wait_until(leaver.page, "!document.getElementById('waiting').hidden")
        leaver.page.locator("#withdraw").press("Enter")
        leaver.page.tap("#withdraw-yes")
        there.endpoint.start()
        leaver.has_ended("withdrawn")
        leaver.page.reload()
        leaver.has_ended("withdrawn")
        assert refuser.wrong + leaver.wrong == []
        said = collect_answers(folder, there.endpoint.file)
        assert "1 taken" in said
        assert "people who withdrew: 1\nlines refused: 0" in said
    answers = Answers(folder / FILE)
    assert [one.ended for one in answers.people()] == ["no_consent", "withdrawn"]
    answers.close()
