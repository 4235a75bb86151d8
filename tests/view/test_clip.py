"""An explained episode as a moving picture: what its frames show, and what its files hold."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gates import task
from PIL import Image

from ibe_rl.task import RecordedRollout
from ibe_rl.types import ConfigError, Episode, Explanation, Moment
from ibe_rl.view import palette as colours
from ibe_rl.view.clip import FRAME_HEIGHT, FRAME_WIDTH, SCENE, Clip, frames_of
from ibe_rl.view.clip_file import check_clip, write_clip

STEPS = 10


def said_at(step: int, states: np.ndarray, known: bool = True) -> Explanation:
    expression = np.array([1.0])
    ahead = np.repeat(states[step : step + 1], 4, axis=0)
    return Explanation(expression, "opening", 0, states[1] - states[0], 3, 0.9, ahead, states[:1], known=known)


def clip(steps_per_s: float = 25.0, known: bool = True, numbers: int = 1) -> Clip:
    """Ten steps of a gate that opens; the instructor says -1, the agent +1, in each number."""
    states = np.stack([np.linspace(-1, 1, STEPS + 1), np.full(STEPS + 1, 0.2)], axis=-1)
    told, given = np.full((STEPS, numbers), -1.0), np.ones(STEPS, bool)
    episode = Episode(states, np.zeros(STEPS, int), np.zeros(STEPS), told, given, False, True, "any")
    moments = [Moment(state, told[0], True) for state in states[:-1]]
    watched = RecordedRollout(episode, moments, [], [[]] * (STEPS + 1))
    said = [
        replace(said_at(step, states, known), expression=np.ones(numbers), phrase=", ".join(["opening"] * numbers))
        for step in range(STEPS)
    ]
    gate = task()
    several = {name: getattr(gate, name) * numbers for name in ("phrases", "explained", "explained_band")}
    return Clip(task(**several), watched, said, ["opening"] * STEPS, steps_per_s)


def test_a_frame_shows_the_way_the_words_and_the_gauge() -> None:
    frames = [np.asarray(frame) for frame in frames_of(clip())]
    assert len(frames) == STEPS + 1
    assert {frame.shape for frame in frames} == {(FRAME_HEIGHT, FRAME_WIDTH, 3)}
    first, last = frames[0], frames[-1]
    assert tuple(first[392, FRAME_WIDTH - 24]) == colours.POSITIVE  # the agent's dot at +1
    assert tuple(first[380, SCENE + 16]) == colours.INSTRUCTED  # the instructor's mark at -1
    trail = (np.asarray(colours.TRAIL) == last[:, :SCENE]).all(axis=-1)
    assert trail.sum() > (np.asarray(colours.TRAIL) == first[:, :SCENE]).all(axis=-1).sum()
    across = np.flatnonzero(trail.any(axis=0))
    assert across[-1] - across[0] > SCENE / 2  # the gate opens from one side to the other


def test_each_of_three_numbers_has_a_gauge() -> None:
    frame = np.asarray(next(frames_of(clip(numbers=3))))
    for y in (372, 410, 448):
        assert frame[y, FRAME_WIDTH - 24].max() > 200  # the agent's dot at +1
        assert tuple(frame[y - 12, SCENE + 16]) == colours.INSTRUCTED


def test_what_the_agent_does_not_know_has_no_colour_and_no_dot() -> None:
    frame = np.asarray(next(frames_of(clip(known=False))))
    assert not (frame == np.asarray(colours.POSITIVE)).all(axis=-1).any()


def test_a_fast_environment_is_shown_every_few_steps(tmp_path: Path) -> None:
    fast = clip(steps_per_s=50.0)
    assert (fast.stride_steps, fast.frames_per_s) == (2, 25.0)
    write_clip(fast, tmp_path / "fast.gif")
    with Image.open(tmp_path / "fast.gif") as picture:
        assert (picture.n_frames, picture.size) == (6, (FRAME_WIDTH, FRAME_HEIGHT))
        assert picture.info["duration"] == 40
    assert [path.name for path in tmp_path.iterdir()] == ["fast.gif"]


def test_mp4_is_left_to_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    got: list[Any] = []

    def write_frames(path: str, *_: Any, **__: Any) -> Any:
        Path(path).touch()
        while True:
            got.append((yield))

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", SimpleNamespace(write_frames=write_frames))
    write_clip(clip(), tmp_path / "gate.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["gate.mp4"]
    assert {len(frame) for frame in got} == {FRAME_WIDTH * FRAME_HEIGHT * 3}
    assert len(got) == STEPS + 1 + 38  # the last frame stands for a second and a half


def test_what_cannot_be_written_is_refused_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    (tmp_path / "file").touch()
    for name, message in {
        "clip.avi": r"clip=.*clip.avi: allowed is a file that ends in .gif or .mp4",
        "clip.mp4": r"clip=.*clip.mp4: needs imageio-ffmpeg; install the extra ibe_rl\[mp4\]",
        "file/clip.gif": r"clip=.*clip.gif: allowed is a file that can be written \(",
    }.items():
        with pytest.raises(ConfigError, match=message):
            check_clip(tmp_path / name, "clip")
    check_clip(tmp_path / "new" / "clip.gif", "clip")
    assert [*(tmp_path / "new").iterdir()] == []
