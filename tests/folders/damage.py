"""Damage done to files by chance, and a fence around whoever opens them."""

from __future__ import annotations

import json
import random
import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

STRANGE = (None, True, -1, 0, 10**12, 2**70, 1e300, float("nan"), float("inf"), "", "x", "../..", [], {}, [[]], [None])
"""What may stand where something else should."""
MOST_BYTES = 1_500_000_000
"""That opening a folder may ask for, beyond what the process has."""
LONGEST_S = 60


def chance_of(*seed: object) -> random.Random:
    """The same for the same seed."""
    return random.Random(str(seed))  # noqa: S311 - no secret


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Cut short, overwrite or lengthen a file."""
    way = chance.randrange(5)
    at = chance.randrange(max(1, len(data)))
    if way == 0:
        return data[:at]
    if way == 1:
        return data[:at] + chance.randbytes(chance.randrange(1, 40)) + data[at:]
    some = bytearray(data)
    places = [at] if way == 2 else [chance.randrange(max(1, len(data))) for _ in range(chance.randrange(1, 30))]
    if way == 4:  # the beginning, where the heads of files are
        places = [chance.randrange(min(200, max(1, len(data)))) for _ in range(4)]
    for place in places:
        if place < len(some):
            some[place] = chance.randrange(256)
    return bytes(some)


def damaged_json(text: str, chance: random.Random) -> str:
    """Put something else in one place of a JSON document, or leave it out."""
    return json.dumps(damaged_value(json.loads(text), chance))


def damaged_value(value: Any, chance: random.Random) -> Any:
    """A copy of nested lists and dicts in which one thing is strange or missing."""
    if chance.random() < 0.15 or not isinstance(value, list | dict | tuple) or not len(value):
        return chance.choice(STRANGE)
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    key = chance.choice(keys)
    if chance.random() < 0.2:
        left = [one for one in keys if one != key]
        return {one: value[one] for one in left} if isinstance(value, dict) else [value[one] for one in left]
    copy: Any = dict(value) if isinstance(value, dict) else list(value)
    copy[key] = damaged_value(value[key], chance)
    return copy


@contextmanager
def fence() -> Iterator[None]:
    """Whoever asks for gigabytes in here gets a MemoryError, whoever hangs a TimeoutError."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGALRM, _too_long)
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_BYTES, before[1]))
    left_s = signal.alarm(LONGEST_S)  # of the test's own limit
    try:
        yield
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.signal(signal.SIGALRM, handler)
        signal.alarm(left_s)


def _too_long(*_: object) -> None:
    raise TimeoutError(f"not done after {LONGEST_S} s")


def refusal(open_it: Callable[[], Any]) -> str | None:
    """Open something that may be damaged; None if it opens, else the message.

    Only a ValueError (a ConfigError is one) of one line passes.
    """
    try:
        with fence():
            open_it()
    except ValueError as error:
        if not 0 < len(str(error)) <= 600 or "\n" in str(error):
            raise AssertionError(f"not one clear line: {error}") from error
        return str(error)
    return None
