"""Whole studies in a real browser, by keyboard and by touch, with reloads, kills and lost connections."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from browsers import browsing
from own_study import write_study
from playwright.sync_api import Browser
from served import Served, served, wait_until
from visitors import Toucher, Visitor

pytestmark = pytest.mark.slow
SHORT = {"practice": 1, "each_arm": 1, "attention_checks": 1}
FOCUSED = "document.activeElement.matches({!r})"
MOST_TABS = 40


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browsing() as found:
        yield found


class Typist(Visitor):
    """Uses the keyboard alone."""

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def tab_to(self, selector: str) -> None:
        for _ in range(MOST_TABS):
            if self.page.evaluate(FOCUSED.format(selector)):
                return
            self.press("Tab")
        raise AssertionError(f"Tab does not reach {selector}")

    def confirm(self, selector: str = "#next") -> None:
        self.tab_to(selector)
        self.press("Enter")

    def answer(self, shown: str) -> None:
        """Answer a page."""
        kind = shown.partition("/")[0].partition(" ")[0]
        if kind == "trial":
            return self.predict()
        if kind == "demographics":
            self.tab_to("input[type=text]")
            self.page.keyboard.type("40")
        if kind == "comment":
            self.tab_to("#comment")
            self.page.keyboard.type("it was fine")
        if kind in ("comprehension", "attention", "scale"):
            for number in range(self.page.locator(".question").count()):
                self.tab_to(f"input[name=question-{number}]")
                self.press("ArrowDown")  # the second option
        return self.confirm("#agree" if kind == "consent" else "#next")

    def predict(self) -> None:
        self.phase("ready")
        self.confirm("#play")
        self.phase("asked")
        self.tab_to("#place")
        self.press("PageUp", "ArrowRight", "ArrowRight", "ArrowLeft")
        self.tab_to("#confidence")
        self.press("ArrowRight", "ArrowRight")
        self.confirm()


def test_by_keyboard_with_a_reload_and_a_server_that_is_killed(browser: Browser, tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study", trials=SHORT, completion_codes={"finished": "C0DE"})
    with served(folder) as server:
        typist = Typist(browser, server, "k1")
        typist.confirm("#begin")
        seen = type_through(typist, server)
        assert typist.page.inner_text("#completion-code") == "C0DE"
        assert typist.page.evaluate("document.getElementById('waiting').hidden")
        kept = server.kept()[1]
        assert [f"{one.page} {one.attempt}" for one in kept] == seen
        assert len(seen) == 10
        values = {one.page.partition("/")[0]: one.value for one in kept}
        assert values["trial"] == {"at": pytest.approx(0.61), "confidence": 52}
        assert values["demographics"] == {"choices": ["40", None]}
        assert values["scale"] == {"choices": [1, 1]}
        assert values["comment"] == {"text": "it was fine"}
        assert typist.wrong == []


def type_through(typist: Typist, server: Served) -> list[str]:
    """Answer all pages; practice is reloaded, and the server is killed during the trial."""
    shown, seen = typist.after(""), []
    while shown:
        seen.append(shown)
        practice = shown.startswith("trial/practice")
        killed = shown.startswith("trial") and not practice
        if practice:
            reload_and_come_back(typist, shown)
        if killed:
            server.end(signal.SIGKILL)
        typist.answer(shown)
        if killed:
            wait_until(typist.page, "!document.getElementById('waiting').hidden")
            server.start()
        if practice:
            typist.phase("feedback")
            typist.page.reload()
            typist.phase("feedback")
            assert typist.shown == shown
            typist.confirm()
        shown = typist.after(shown)
    return seen


def reload_and_come_back(visitor: Visitor, shown: str) -> None:
    """Reload before and after the question; the same page is there again."""
    visitor.page.reload()
    assert visitor.after("") == shown
    visitor.phase("ready")
    visitor.page.click("#play")
    visitor.phase("asked")
    visitor.page.reload()
    assert visitor.after("") == shown


@pytest.mark.parametrize("task", ["landing", "next_words", "what_if", "which_agent"])
def test_by_touch_on_a_small_screen_with_a_lost_connection(browser: Browser, tmp_path: Path, task: str) -> None:
    trials = {**SHORT, "practice": 0, "task": task, "transfer": 1, "feedback": "always"}
    folder = write_study(tmp_path / "study", episodes=4, trials=trials, design="mixed")
    phone = {"viewport": {"width": 360, "height": 740}, "has_touch": True, "is_mobile": True}
    with served(folder) as server:
        toucher = Toucher(browser, server, "k1", **phone, reduced_motion="reduce")
        toucher.page.tap("#begin")
        shown, seen = toucher.after(""), []
        while shown:
            seen.append(shown)
            lost = shown.startswith("trial/transfer")
            toucher.page.context.set_offline(lost)
            toucher.answer(shown)
            if lost:
                wait_until(toucher.page, "!document.getElementById('waiting').hidden")
                toucher.page.context.set_offline(False)
            if shown.startswith("trial"):
                toucher.phase("feedback")
                toucher.page.tap("#next")
            shown = toucher.after(shown)
        kept = server.kept()[1]
        assert [f"{one.page} {one.attempt}" for one in kept] == seen
        assert [name for name in seen if name.startswith(("instructions", "comprehension"))] == [
            *("instructions 1", "comprehension 1", "instructions 2", "comprehension 2")
        ]
        said = [one.value for one in kept if one.page.startswith("trial")]
        assert len(said) == 3
        expected = {"at": pytest.approx(0.25, abs=0.01)} if task == "landing" else {"choice": 1}
        assert said == [{**expected, "confidence": pytest.approx(50, abs=1)}] * 3
        assert toucher.wrong == []


def test_leaving(browser: Browser, tmp_path: Path) -> None:
    """Who does not agree is out; who withdraws is deleted; nobody is left out by accident."""
    with served(write_study(tmp_path / "study", trials=SHORT)) as server:
        refuser = Visitor(browser, server, "k1")
        refuser.page.click("#begin")
        shown = refuser.after("")
        refuser.page.click("#disagree")
        refuser.after(shown)
        assert refuser.page.inner_text("h1") == "ended no consent"
        leaver = Visitor(browser, server, "k2")
        leaver.page.click("#begin")
        shown = leaver.after("")
        leaver.page.click("#withdraw")
        leaver.page.click("#withdraw-no")
        leaver.page.click("#agree")
        shown = leaver.after(shown)
        leaver.page.click("#next")  # demographics may be left out
        shown = leaver.after(shown)
        leaver.page.click("#next")
        shown = leaver.after(shown)
        leaver.page.click("#next")  # comprehension may not
        wait_until(leaver.page, "document.getElementById('missing').textContent === 'choose'")
        assert [len(given) for given in server.kept().values()] == [1, 3]
        leaver.page.click("#withdraw")
        leaver.page.click("#withdraw-yes")
        leaver.after(shown)
        assert leaver.page.inner_text("h1") == "ended withdrawn"
        assert [len(given) for given in server.kept().values()] == [1, 0]
        leaver.page.reload()
        wait_until(leaver.page, "document.body.dataset.ended === 'unknown'")
        assert leaver.wrong + refuser.wrong == []


def test_the_admin_page_stops_and_resumes_recruiting(browser: Browser, tmp_path: Path) -> None:
    with served(write_study(tmp_path / "study")) as server:
        admin = browser.new_page()
        admin.goto(f"http://127.0.0.1:{server.admin_port}/")
        wait_until(admin, "document.getElementById('switch').textContent === 'Stop recruiting'")
        admin.click("#switch")
        wait_until(admin, "document.getElementById('recruiting').textContent.startsWith('Stopped')")
        visitor = Visitor(browser, server, "k1")
        visitor.page.click("#begin")
        wait_until(visitor.page, "document.getElementById('missing').textContent === 'refused full'")
        admin.click("#switch")
        wait_until(admin, "document.getElementById('recruiting').textContent.startsWith('Recruiting')")
        visitor.page.click("#begin")
        assert visitor.after("") == "consent 1"
        wait_until(admin, "document.getElementById('people').textContent.includes('begun: 1')")
