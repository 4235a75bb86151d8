"""People in front of the pages of a study in a real browser."""

from __future__ import annotations

from typing import Any

from playwright.sync_api import Browser, Page
from served import Served, wait_until


class Visitor:
    """A page of the study in the browser, and what went wrong there."""

    def __init__(self, browser: Browser, server: Served, code: str, **settings: Any):
        self.open(browser, f"{server.address}/?code={code}", (server.address,), **settings)
        wait_until(self.page, "document.getElementById('begin') !== null")

    def open(self, browser: Browser, address: str, allowed: tuple[str, ...], **settings: Any) -> None:
        """Open an address in a window of its own; anything that is asked of others than these is wrong."""
        self.page: Page = browser.new_page(**settings)
        self.page.set_default_timeout(60_000)
        self.wrong: list[str] = []
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda sent: self.wrong.extend([sent.url] * (not sent.url.startswith(allowed))))
        self.page.goto(address)

    @property
    def shown(self) -> str:
        """The page that is shown, with the attempt at it; empty at the end."""
        data = self.page.evaluate("({...document.body.dataset})")
        return f"{data['page']} {data['attempt']}" if "page" in data else ""

    def phase(self, name: str) -> None:
        wait_until(self.page, f"document.body.dataset.phase === {name!r}")

    def after(self, shown: str) -> str:
        """Wait for the page after this one."""
        now = "(document.body.dataset.page || '') + ' ' + (document.body.dataset.attempt || '')"
        wait_until(self.page, f"{now} !== {shown or ' '!r} && !document.getElementById('main').inert")
        assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth")  # nothing to scroll sideways
        return self.shown


class Toucher(Visitor):
    """Uses a finger on a small screen."""

    def answer(self, shown: str) -> None:
        """Answer a page; the first try at comprehension is wrong."""
        kind = shown.partition("/")[0].partition(" ")[0]
        if kind == "trial":
            self.phase("ready")
            self.page.tap("#play")
            self.phase("asked")
            if self.page.locator("#place").count():
                box = self.page.locator("#place").bounding_box()
                assert box is not None
                self.page.tap("#place", position={"x": box["width"] / 4, "y": box["height"] / 2})
            self.page.tap("#confidence")
        option = 0 if shown == "comprehension 1" else 1
        for question in self.page.locator(".question:has(.option)").all():
            question.locator(".option").nth(option).tap()
        self.page.tap("#agree" if kind == "consent" else "#next")
