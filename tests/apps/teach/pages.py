"""A run of train.py that a person teaches, and a browser to do it with."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copies import Script
from playwright.sync_api import Browser, Error, Page
from processes import start
from view_data import eventually, free_ports

SMALL = (
    *("instructor=human", "viewer=off", "agent.hidden=[8]", "log.capacity_frames=20000", "eval_episodes=2"),
    "agent.noise_steps=1",
    *("collect.envs_per_process=1", "collect.steps_per_batch=128", "eval_every_frames=10000000"),
)


@dataclass
class Taught:
    """A training under way, and where its page is."""

    process: Script
    folder: Path
    address: str

    def stop(self) -> str:
        """Ask it to stop in order; returns what it printed."""
        self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=240)[0]


@contextmanager
def taught(folder: Path, *overrides: str) -> Iterator[Taught]:
    """Train until the context is left."""
    port = f"instructor.port={free_ports().web}"  # other tests run beside this one
    process = start("train.py", *SMALL, port, f"run_dir={folder}", *overrides)
    try:
        said = ""
        while not (found := re.search(r"teach it here: (http://\S+)", said)):
            line = process.stdout.readline()
            assert line, said
            said += line
        yield Taught(process, folder, found[1])
    finally:
        process.kill()
        process.wait()


def opened(browser: Browser, address: str, **settings: Any) -> Page:
    """The page of the lesson, connected and with a picture."""
    page = browser.new_page(viewport={"width": 1366, "height": 768}, **settings)
    page.set_default_timeout(60_000)
    assert eventually(lambda: reached(page, address))  # the process that serves it may still be starting
    until(page, "lesson.connected && lesson.drawn > 2")
    return page


def reached(page: Page, address: str) -> bool:
    try:
        page.goto(address)
    except Error:
        return False
    return True


def until(page: Page, condition: str, seconds: float = 120.0) -> None:
    """Wait until something is true in the page."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):  # playwright's own waiting needs what the page forbids
        assert time.monotonic() < end, f"not in {seconds} s: {condition}"
        time.sleep(0.02)
