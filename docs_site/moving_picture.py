"""The moving picture of README: the live view of one explained episode.

python explain.py run=demo seed=1 context=right viewer=file output=demo.rrd
python -m docs_site.moving_picture demo.rrd          a few minutes; needs mesa-vulkan-drivers and libvulkan1
"""

import io
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from ibe_rl.runtime.ports import free_port
from ibe_rl.view.blueprint import FILM
from ibe_rl.view.relay import rerun_binary

PICTURE = Path(__file__).parent.parent / "docs" / "img" / "live_view.webp"
WINDOW, WIDTH = (1280, 800), 960
TOOLBAR_ROWS = 34
"""Of rerun's window; it names the machine's graphics driver."""
STEPS_PER_PICTURE, SHOWN_MS, LAST_SHOWN_MS = 4, 120, 2500
START_S, SETTLE_S = 60.0, 10.0
NOTICE_S = 8.0
"""So long rerun shows a notice over the view once it has started."""


@contextmanager
def headless_viewer() -> Iterator[ViewerClient]:
    """Rerun's own viewer without a screen, on a free port of this machine."""
    port = free_port(9876)
    size = "x".join(map(str, WINDOW))
    command = [str(rerun_binary()), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:  # noqa: S603 - our own
        try:
            yield connected(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            process.kill()


def connected(url: str) -> ViewerClient:
    """The client of a viewer that is starting.

    Raises:
        ConnectionError: if it does not answer within a minute.
    """
    until = time.monotonic() + START_S
    while True:
        try:
            client = ViewerClient.connect(url)
            client.get_state()
        except ConnectionError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)
        else:
            return client


def settled(viewer: ViewerClient) -> Image.Image:
    """The window once it does not change any more, without the toolbar."""
    shot, until = viewer.take_screenshot(), time.monotonic() + SETTLE_S
    while (again := viewer.take_screenshot()) != shot and time.monotonic() < until:
        shot = again
    image = Image.open(io.BytesIO(again)).convert("RGB")
    image = image.crop((0, TOOLBAR_ROWS, image.width, image.height))
    return image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)


def shoot(recording: Path) -> list[Image.Image]:
    """Pictures of the view at every fourth step of the episode."""
    with headless_viewer() as viewer:
        viewer.open(str(recording.resolve()))
        [opened] = viewer.get_state().recordings
        [steps] = [line for line in opened.timelines if line.name == FILM]
        end, pictures = steps.end or 0, []
        time.sleep(NOTICE_S)
        for step in [*range(STEPS_PER_PICTURE, end, STEPS_PER_PICTURE), end]:
            viewer.set_time(FILM, sequence=step, play_state="paused")
            pictures.append(settled(viewer))
    return pictures


def main(recording: Path, output: Path = PICTURE) -> None:
    """Write the animated WebP."""
    first, *others = shoot(recording)
    durations = [SHOWN_MS] * len(others) + [LAST_SHOWN_MS]
    first.save(output, save_all=True, append_images=others, duration=durations, loop=0, quality=70, method=4)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
