"""A study under load: does a killed server lose answers, and how long do many people wait for a confirmation?

python -m benchmarks.study_load STUDY                 60 people, 20 at a time, 10 kills; then 200 people at a time
python -m benchmarks.study_load STUDY --people 20     fewer of both

The study is copied first, so no simulated person gets into its answers.
"""

from __future__ import annotations

import argparse
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from ibe_rl.apps.study.answers import FILE
from ibe_rl.apps.study.folder import PROTOCOL, open_study
from ibe_rl.apps.study.pilot import THROUGH_PROTOCOL, Piloted, pilot, slowest_ms
from ibe_rl.apps.study.schedule import pages_of
from ibe_rl.runtime.ports import HOST, free_port, is_served

SERVE = "import sys; from pathlib import Path; from ibe_rl.apps.study.serving import serve; "
SERVE += "serve(Path(sys.argv[1]), port=int(sys.argv[2]), admin_port=int(sys.argv[3]))"
START_S, POLL_S = 60.0, 0.02
PEOPLE, AT_ONCE, KILLS, CROWD, GOAL_MS = 60, 20, 10, 200, 200
STAYING = 0.7
"""Share of all answers that come although people leave, at least; the kills are spread over these."""
ANSWER_EACH_S = 1.0
PACE_S = 12.0
console = Console(highlight=False)


@dataclass
class Killable:
    """A server of a study in a process of its own.

    Args:
        folder: of the study.
    """

    folder: Path
    port: int = field(default_factory=lambda: free_port(8471))
    kills: int = 0

    def __post_init__(self) -> None:
        self._admin_port = free_port(8472, other=self.port)
        self.start()

    @property
    def address(self) -> str:
        """Where people take part."""
        return f"http://{HOST}:{self.port}"

    def start(self) -> None:
        """Start the process and wait until it listens."""
        command = [sys.executable, "-c", SERVE, str(self.folder), str(self.port), str(self._admin_port)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)  # noqa: S603 - ours
        end = time.monotonic() + START_S
        while not is_served(self.port):
            if self._process.poll() is not None or time.monotonic() > end:
                self._process.kill()
                assert self._process.stderr is not None
                raise RuntimeError(f"the server did not start: {self._process.stderr.read().decode()[-2000:]}")
            time.sleep(POLL_S)

    def kill(self) -> None:
        """SIGKILL, as a power cut would end it."""
        self._process.kill()
        self._process.communicate()
        self.kills += 1


@contextmanager
def killable(folder: Path) -> Iterator[Killable]:
    """A server until the context is left."""
    server = Killable(folder)
    try:
        yield server
    finally:
        server.kill()


def through_kills(folder: Path, people: int, at_once: int, kills: int, seed: int = 0) -> tuple[Piloted, int]:
    """Let people take part while the server is killed and started again, evenly over their answers.

    Returns:
        What became of them, and how often the server was killed meanwhile.
    """
    with killable(folder) as server:
        done = threading.Event()
        killer = threading.Thread(target=_kill_often, args=(server, folder, kills, people, done))
        killer.start()
        try:
            found = pilot(
                folder, people, at_once, THROUGH_PROTOCOL, seed, server.address, times_faster=100.0, say=lambda _: None
            )
        finally:
            done.set()
            killer.join()
        return found, server.kills


def _kill_often(server: Killable, folder: Path, kills: int, people: int, done: threading.Event) -> None:
    study = open_study(folder)
    pages = len(pages_of(study.settings, study.orders[0], len(study.stimuli), number=1))
    each = max(1, int(STAYING * people * pages) // (kills + 1))
    with closing(sqlite3.connect(folder / FILE)) as store:
        while server.kills < kills and not done.wait(POLL_S):
            [count] = store.execute("SELECT count(*) FROM answers").fetchone()
            if count >= each * (server.kills + 1):
                server.kill()
                server.start()


def under_load(folder: Path, people: int, answer_each_s: float, seed: int = 0) -> Piloted:
    """Let people take part at the same time.

    Args:
        folder: of the study.
        people: all at once.
        answer_each_s: median pause of a person between answers; 0 for none.
        seed: of who they are.
    """
    faster = PACE_S / answer_each_s if answer_each_s else float("inf")
    with killable(folder) as server:
        return pilot(
            folder, people, people, THROUGH_PROTOCOL, seed, server.address, drop_out=0.0, pace_s=PACE_S,
            times_faster=faster, say=lambda _: None,
        )  # fmt: skip


def main(arguments: list[str] | None = None) -> None:
    """Print what was lost, and how long the slowest confirmations took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path, help="folder of a study")
    parser.add_argument("--people", type=int, default=PEOPLE, help="of the part with kills")
    parser.add_argument("--kills", type=int, default=KILLS)
    parser.add_argument("--crowd", type=int, default=CROWD, help="people at a time of the part without")
    asked = parser.parse_args(arguments)
    with _copy(asked.study) as folder:
        found, kills = through_kills(folder, asked.people, AT_ONCE, asked.kills)
        confirmed = sum(len(visit.confirmed) for visit in found.visits)
        console.print(
            f"{asked.people} people, {AT_ONCE} at a time, server killed {kills} times: {confirmed} answers confirmed, "
            f"{found.lost} lost, {found.changed} changed or doubled"
        )
    for answer_each_s in (ANSWER_EACH_S, 0.0):
        with _copy(asked.study) as folder:
            found = under_load(folder, asked.crowd, answer_each_s)
        pause = f"an answer each {answer_each_s:g} s" if answer_each_s else "without pauses"
        a_second = len(found.confirmation_s) / found.took_s
        console.print(
            f"{asked.crowd} people at a time, {pause}: {a_second:.0f} answers/s, the slowest 1 % confirmed after "
            f"{slowest_ms(found.confirmation_s):.0f} ms or more (goal {GOAL_MS} ms), {found.lost} lost"
        )


@contextmanager
def _copy(study: Path) -> Iterator[Path]:
    """The study without its answers."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "study"
        shutil.copytree(study, folder, ignore=shutil.ignore_patterns(f"{FILE}*", PROTOCOL))
        yield folder


if __name__ == "__main__":
    main()
