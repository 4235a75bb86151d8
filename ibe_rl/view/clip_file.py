"""Writes an explained episode to a file as a moving picture: GIF, or MP4 with the extra ``mp4``."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ibe_rl.storage.run_folder import write_atomically
from ibe_rl.types import ConfigError
from ibe_rl.view import palette as colours
from ibe_rl.view.clip import FRAME_HEIGHT, FRAME_WIDTH, Clip, frames_of, shade_of

ENDINGS = (".gif", ".mp4")
LAST_S = 1.5
"""Seconds that the last frame stands still."""


def check_clip(path: Path, key: str) -> None:
    """Refuse a clip that cannot be written, before an episode is played for it.

    Args:
        path: of the file.
        key: the setting that names it.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if path.suffix not in ENDINGS:
        raise ConfigError(f"{key}={path}: allowed is a file that ends in {' or '.join(ENDINGS)}")
    if path.suffix == ".mp4":
        try:
            import_module("imageio_ffmpeg")
        except ImportError:
            raise ConfigError(f"{key}={path}: needs imageio-ffmpeg; install the extra ibe_rl[mp4]") from None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.with_name(path.name + ".partial").touch()
    except OSError as error:
        raise ConfigError(f"{key}={path}: allowed is a file that can be written ({error.strerror})") from None
    path.with_name(path.name + ".partial").unlink()


def write_clip(clip: Clip, path: Path) -> None:
    """Write a clip to a ``.gif`` or ``.mp4`` file, which is complete or not there.

    Raises:
        OSError: if it cannot be written.
    """
    frames = frames_of(clip)
    if path.suffix == ".mp4":
        _write_mp4(frames, clip.frames_per_s, path)
        return
    palette = _palette(clip)  # one for all frames: then only what changes is stored
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    shown_ms = round(100 / clip.frames_per_s) * 10  # GIF counts hundredths of a second
    times_ms = [shown_ms] * (len(few) - 1) + [round(LAST_S * 1000)]
    write_atomically(
        path,
        lambda stream: few[0].save(
            stream, "GIF", save_all=True, append_images=few[1:], duration=times_ms, loop=0, optimize=False
        ),
    )


def _palette(clip: Clip) -> Image.Image:
    """All colours that are drawn, each in steps from the background."""
    shapes = [*clip.watched.background, *clip.watched.figures[0]]
    named = (colours.TRAIL, colours.WHITE, colours.GREEN, colours.PINK, colours.INSTRUCTED, colours.AXIS, colours.MUTED)
    spoken = {shade_of(one) for said in clip.said for one in said.all_spans}
    drawn = np.array(sorted({*named, colours.GRID, *(shape.colour for shape in shapes), *spoken}))[:127]
    shares = np.linspace(1, 0, 255 // len(drawn), endpoint=False)[:, None, None]
    ground = np.array(colours.BACKGROUND)
    mixed = np.round(ground + shares * (drawn - ground)).astype(np.uint8).reshape(-1, 3)
    palette = Image.new("P", (1, 1))
    palette.putpalette([*ground.tolist(), *mixed.ravel().tolist()])
    return palette


def _write_mp4(frames: Iterator[Image.Image], frames_per_s: float, path: Path) -> None:
    ffmpeg: Any = import_module("imageio_ffmpeg")
    temporary = path.with_name(path.stem + ".partial.mp4")  # its format is that of its ending
    writer = ffmpeg.write_frames(str(temporary), (FRAME_WIDTH, FRAME_HEIGHT), fps=frames_per_s, macro_block_size=16)
    writer.send(None)
    try:
        for frame in frames:
            writer.send(frame.tobytes())
        for _ in range(round(LAST_S * frames_per_s)):
            writer.send(frame.tobytes())
        writer.close()
        temporary.replace(path)
    finally:
        writer.close()
        temporary.unlink(missing_ok=True)
