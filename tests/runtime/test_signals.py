"""The first signal asks, the second ends, and what was there before comes back."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from ibe_rl.runtime import signals
from ibe_rl.runtime.signals import StopRequest, interrupts_stay_here

ALL = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture(autouse=True)
def unchanged() -> Iterator[None]:
    before = [signal.getsignal(number) for number in ALL]
    yield
    assert [signal.getsignal(number) for number in ALL] == before
    assert not {*ALL} & signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.parametrize("number", ALL)
def test_the_first_signal_asks_to_stop(number: int):
    with StopRequest() as stop:
        assert not stop
        signal.raise_signal(number)
        assert stop
    assert stop


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the clock shows, in seconds; the last number counts."""
    shown = [1000.0]
    monkeypatch.setattr(signals, "time", SimpleNamespace(monotonic=lambda: shown[-1]))
    return shown


@pytest.mark.parametrize("number", ALL)
def test_ctrl_c_ends_at_once_what_was_asked_to_stop(number: int, clock: list[float]):
    with StopRequest() as stop:
        signal.raise_signal(number)
        assert stop
        clock.append(1001.0)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_two_interrupts_at_once_are_one(clock: list[float]):
    """As ``timeout -s INT`` sends them; a key that is held down ends it all the same."""
    with StopRequest() as stop:
        for now in (1000.0, 1000.1, 1000.4):
            clock.append(now)
            signal.raise_signal(signal.SIGINT)
        assert stop
        clock.append(1000.6)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_shell_or_a_batch_system_asks_once_however_often_it_says_so(number: int, clock: list[float]) -> None:
    with StopRequest() as stop:
        for clock[-1] in (1000.0, 1000.1, 1002.0):
            signal.raise_signal(number)
        signal.raise_signal(signal.SIGTERM)
        assert stop


def test_under_nohup_a_closed_terminal_is_nothing() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopRequest() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", ALL)
def test_what_was_to_be_called_is_called_once_and_in_order(number: int, clock: list[float]):
    called: list[str] = []
    with StopRequest() as stop:
        stop.when_asked(lambda: called.append(f"one, {bool(stop)}"))
        stop.when_asked(lambda: called.append("two"))
        assert called == []
        signal.raise_signal(number)
        assert called == ["one, True", "two"]
        clock.append(1001.0)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert called == ["one, True", "two"]


def test_after_the_request_it_is_called_at_once():
    """Ctrl-C may come while what is to hear of it is still being made."""
    called: list[int] = []
    with StopRequest() as stop:
        signal.raise_signal(signal.SIGINT)
        stop.when_asked(lambda: called.append(1))
        assert called == [1]
        stop.when_asked(lambda: called.append(2))
    assert called == [1, 2]


def test_without_a_request_nothing_is_called():
    with StopRequest() as stop:
        stop.when_asked(lambda: pytest.fail("nobody asked"))


def test_the_handlers_come_back_also_after_an_error():
    seen = []
    before = signal.signal(signal.SIGTERM, lambda *_: seen.append(1))
    try:
        with pytest.raises(RuntimeError, match="learner"), StopRequest() as stop:
            raise RuntimeError("learner")
        signal.raise_signal(signal.SIGTERM)
        assert seen == [1]
        assert not stop
    finally:
        signal.signal(signal.SIGTERM, before)


def test_an_interrupt_while_processes_start_is_kept_for_afterwards():
    with StopRequest() as stop:
        with interrupts_stay_here():
            signal.raise_signal(signal.SIGINT)
            assert not stop
        assert stop


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP", "SIGTERM"])
def test_processes_started_so_do_not_hear_what_their_group_is_sent(name: str):
    code = f"import signal; print(signal.{name} in signal.pthread_sigmask(signal.SIG_BLOCK, []))"

    def deaf() -> str:
        return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip()

    with interrupts_stay_here():
        assert deaf() == "True"
    assert deaf() == "False"


def test_what_a_process_started_so_starts_itself_is_ended_by_sigterm():
    """A simulator of an environment, say, which its environment closes with ``terminate()``."""
    code = """
import signal, subprocess, sys
from ibe_rl.runtime.signals import leave_sigterm_to_parent
leave_sigterm_to_parent()
signal.raise_signal(signal.SIGTERM)
simulator = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
simulator.terminate()
print(simulator.wait())
"""
    with interrupts_stay_here():
        ended = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert ended.stdout.strip() == str(-signal.SIGTERM)


def test_interrupts_come_back_also_after_an_error():
    with pytest.raises(OSError, match="no process"), interrupts_stay_here():
        raise OSError("no process")


@pytest.mark.slow
def test_processes_started_so_do_not_run_the_script(tmp_path: Path):
    """Without it a spawned process imports the script that started it, with all that it imports."""
    script = tmp_path / "script.py"
    script.write_text("""
import multiprocessing, sys
from contextlib import nullcontext
from ibe_rl.runtime.signals import script_stays_here
print("imported", flush=True)
if __name__ == "__main__":
    for context in (nullcontext(), script_stays_here()):
        print("start", flush=True)
        process = multiprocessing.get_context("spawn").Process(target=print, args=("works",))
        with context:
            process.start()
        process.join()
    print(__file__ == sys.argv[0])
""")
    out = subprocess.run([sys.executable, str(script)], check=True, capture_output=True, text=True).stdout
    assert out.split() == ["imported", "start", "imported", "works", "start", "works", "True"]
