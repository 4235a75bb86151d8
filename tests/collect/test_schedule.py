"""When something is due: at each multiple, at the end, and ever more rarely."""

from typing import Any

import numpy as np

from ibe_rl.collect.schedule import DENSE, GeometricSchedule, RefreshSchedule, Schedule, refresh_interval
from ibe_rl.config.settings import TrainConfig


def test_every_is_true_once_at_each_multiple():
    due = Schedule(100)
    assert [due(frames) for frames in (50, 99, 100, 150, 199, 350, 399, 400, 1000, 1001)] == [
        False, False, True, False, False, True, False, True, True, False,
    ]  # fmt: skip


def test_every_is_true_at_the_end_unless_it_never_is():
    assert [Schedule(100)(150, last) for last in (False, True)] == [True, True]
    assert [Schedule(100)(50, last) for last in (False, True)] == [False, True]
    assert [Schedule(None)(150, last) for last in (False, True)] == [False, False]


def test_a_run_has_eight_refreshes_unless_it_is_long_or_they_are_asked_for():
    def interval(total_frames: int, **named: Any) -> int | None:
        return refresh_interval(TrainConfig(total_frames=total_frames, **named))

    assert [interval(each) for each in (1, 7, 8, 20, 200_000, 600_000)] == [1, 1, 1, 2, 25_000, 75_000]
    assert [interval(each) for each in (2_000_000, 10_000_000)] == [250_000, 250_000]
    assert interval(200_000, refresh_every_frames=250_000) == 250_000
    assert interval(200_000, refresh_every_frames=None) is None


def refreshes(seen: list[tuple[int, int]], begun: bool = False, **named: Any) -> list[int]:
    """The frames at which a refresh is due, of those ``seen`` with as many episodes."""
    settings = {"refresh_every_frames": 100, "first_refresh_episodes": 5, **named}
    due = RefreshSchedule(TrainConfig(**settings), begun=begun)
    return [frames for frames, episodes in seen if due(frames, episodes)]


def test_the_first_refresh_comes_once_enough_episodes_have_ended():
    seen = [(30, 4), (60, 5), (90, 11), (120, 15), (150, 20), (210, 25)]
    assert refreshes(seen) == [60, 120, 210]
    assert refreshes(seen, first_refresh_episodes=12) == [120, 210]  # at the multiple, or after it: no other one
    assert refreshes(seen, first_refresh_episodes=18) == [120, 210]
    assert refreshes(seen, first_refresh_episodes=0) == [120, 210]
    assert refreshes(seen, begun=True) == [120, 210]
    assert refreshes(seen, refresh_every_frames=None) == []


def test_an_early_refresh_does_not_take_the_place_of_the_last_one():
    due = RefreshSchedule(TrainConfig(refresh_every_frames=100, first_refresh_episodes=5))
    assert [due(60, 5), due(80, 7, last=True)] == [True, True]


def kept(every: int, until: int, batch: int, now: int = 0) -> list[int]:
    due = GeometricSchedule(every, now)
    return [frames for frames in range(now + batch, until + 1, batch) if due(frames)]


def test_what_stays_for_ever_is_kept_more_and_more_rarely():
    often, end = kept(10, 16 * DENSE * 10, batch=10), 16 * DENSE * 10
    assert often[: 2 * DENSE - 1] == list(range(10, 2 * DENSE * 10, 10))
    for times in (2, 4, 8):  # of DENSE
        within = [frames for frames in often if times * DENSE * 10 <= frames < 2 * times * DENSE * 10]
        assert len(within) == DENSE
        assert set(np.diff(within)) == {10 * times}
    assert often[-1] == end
    assert len(kept(10, end, batch=70)) <= len(often)


def test_a_clock_that_is_taken_up_rings_as_if_it_had_never_stood_still():
    end = 9 * DENSE * 10
    for now in (70, 7 * 900, 7 * 1_000):
        assert kept(10, end, 7, now) == [frames for frames in kept(10, end, 7) if frames > now]


def test_a_rare_clock_that_never_rings():
    assert not GeometricSchedule(None)(10**9)
