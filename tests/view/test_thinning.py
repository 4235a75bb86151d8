"""What is kept as a recording fills, by hand."""

import pytest

from ibe_rl.view.thinning import Thinning

LIMIT = 850_000  # of a megabyte, without the end of the file


def used(size: float) -> Thinning:
    """A file of this size, vocabularies of 50,000 bytes and no episode yet."""
    thinning = Thinning(1_000_000)
    thinning.took(int(size))
    return thinning


@pytest.mark.parametrize(
    ("share", "every", "small"),
    [(0.0, 1, 1), (0.49, 1, 1), (0.51, 4, 1), (0.76, 16, 1), (0.88, 64, 4), (0.94, 256, 16), (1.1, 4**60, 4**58)],
)
def test_less_is_kept_with_each_half_of_the_room(share: float, every: int, small: int) -> None:
    thinning = used(share * (LIMIT - 50_000))
    assert thinning.every() == every
    assert thinning.every(small=True) == small


def test_room_is_left_for_a_last_vocabulary_and_episode() -> None:
    thinning = used(0)
    thinning.took(100_000, steps=100)
    assert thinning.episode_bytes(100) == pytest.approx(125_000)
    assert thinning.episode_bytes(200) == pytest.approx(250_000)
    left = LIMIT - 100_000 - 50_000 - 125_000
    assert thinning.fits(left - 1)
    assert not thinning.fits(left + 1)
    assert thinning.fits_at_the_end(left + 175_000 - 1)
    assert not thinning.fits_at_the_end(left + 175_000 + 1)


def test_the_largest_so_far_counts() -> None:
    thinning = used(0)
    thinning.took(80_000, refreshes=1)
    thinning.took(90_000, refreshes=1)
    assert thinning.refresh_bytes() == pytest.approx(100_000)


def test_a_file_too_small_for_anything_is_full() -> None:
    thinning = Thinning(50_000)
    assert thinning.halves() == 60
    assert not thinning.fits(1)
