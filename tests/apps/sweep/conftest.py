"""What the tests of sweeps share."""

from collections.abc import Iterator

import pytest

from ibe_rl.apps.sweep.intervals import interquartile


@pytest.fixture(scope="session", autouse=True)
def few_resamples() -> Iterator[None]:
    """Enough to tell an interval from a point."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interquartile, "__defaults__", (200,))
        yield
