"""What a checkpoint holds to resume from, and one line for a state that does not fit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ibe_rl.types import ConfigError

State = dict[str, Any]
DOES_NOT_FIT = (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError, ArithmeticError)
PARTS = ("agent", "log", "development", "obedience", "predictor", "recorder", "random")
"""What a checkpoint holds the state of."""


@contextmanager
def must_fit(folder: Path) -> Iterator[None]:
    """Report errors of the body as a state that does not fit.

    Raises:
        ConfigError: naming the run.
    """
    try:
        yield
    except ConfigError:
        raise
    except DOES_NOT_FIT as error:
        first = str(error).splitlines()[0][:200] if str(error) else ""
        raise ConfigError(
            f"resume={folder}: its state does not fit this version of ibe_rl or its own settings "
            f"({type(error).__name__}: {first}); train it anew"
        ) from None
