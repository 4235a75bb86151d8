"""How soon does a key count, and how smooth is the page, beside a trainer of 64 games? Keep the machine quiet.

python -m benchmarks.lesson --browser /usr/bin/chromium        three minutes; needs playwright, of the extra `dev`
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.plan import ROOT

console = Console(highlight=False)
KEYS = ("ArrowLeft", "ArrowDown", "ArrowRight")
COUNTED = "[lesson.received, lesson.drawn, performance.now()]"
STEP_MS = 20.0
"""A step of the watched game at real time."""


def main() -> None:
    """Train, teach for a while, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lesson", description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=180.0, help="long enough for two refreshes at real time")
    parser.add_argument("--browser", default="/usr/bin/chromium")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, training(Path(folder) / "run") as address:
        report(*lesson(address, asked.browser, asked.seconds))


@contextmanager
def training(folder: Path) -> Iterator[str]:
    """The default run, taught by a person; gives the address of the page."""
    command = [sys.executable, "-u", "train.py", "instructor=human", f"run_dir={folder}"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own
    assert process.stdout is not None
    try:
        for line in process.stdout:
            if found := re.search(r"teach it here: (http://\S+)", line):
                yield found[1]
                break
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


def lesson(address: str, browser: str, seconds: float) -> tuple[list[float], list[tuple[float, float]]]:
    """Press keys at random moments.

    Returns:
        From each change of a key to the arrival of the first state that was told, in ms; and the pictures that
        arrived and that were drawn in each second.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        page = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"]).new_page()
        open_page(page, address)
        page.evaluate("lesson.waits.length = 0")
        rates = list(press(page, seconds))
        return page.evaluate("lesson.waits"), rates


def open_page(page: Any, address: str) -> None:
    """Wait for the page, and for the game to have begun."""
    for _ in range(200):
        try:
            page.goto(address)
            break
        except Exception:  # the process that serves it is still starting
            time.sleep(0.1)
    while not page.evaluate("lesson.drawn > 50"):
        time.sleep(0.1)


def press(page: Any, seconds: float) -> Iterator[tuple[float, float]]:
    """Hold keys for a quarter of a second each; gives the pictures that arrived and were drawn in each second."""
    chance = np.random.default_rng(0)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        before = page.evaluate(COUNTED)
        for _ in range(2):
            key = str(chance.choice(KEYS))
            page.keyboard.down(key)
            time.sleep(0.25 + chance.uniform(0, 0.02))
            page.keyboard.up(key)
            time.sleep(0.25 + chance.uniform(0, 0.02))
        after = page.evaluate(COUNTED)
        span = (after[2] - before[2]) / 1000
        yield (after[0] - before[0]) / span, (after[1] - before[1]) / span


def report(waits: list[float], rates: list[tuple[float, float]]) -> None:
    """Print medians and tails."""
    arrived, drawn = np.array(rates).T
    low, median, high = np.percentile(waits, [5, 50, 95])
    console.print(
        f"a key counts after {median:.1f} ms (5 to 95 %: {low:.1f} to {high:.1f}; {len(waits)} changes; "
        f"goal: {STEP_MS + 20:.0f}), on the way to the page and back included"
    )
    console.print(
        f"pictures a second: {np.median(arrived):.1f} arrive, {np.median(drawn):.1f} are drawn (median of seconds; "
        f"worst {arrived.min():.1f} and {drawn.min():.1f}; {np.mean(drawn >= 49):.0%} of seconds have 49 or more drawn)"
    )


if __name__ == "__main__":
    main()
