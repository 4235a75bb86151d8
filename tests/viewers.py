"""Real viewers, native and in a browser, and pictures of their panels."""

import ctypes.util
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rerun.experimental import ViewerClient
from view_data import eventually, free_ports, needed

from ibe_rl.runtime.ports import is_free
from ibe_rl.view.relay import rerun_binary

FILLED = 0.003
BROWSER_FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]


def pixels(path: Path) -> np.ndarray:
    """A picture ``(h, w, 3)`` with five bits a colour, so that smoothing at edges counts little."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")) >> 3


def colours(picture: np.ndarray) -> np.ndarray:
    """One number for each pixel's colour ``(h, w)``."""
    return picture.astype(int) @ (1, 32, 1024)


def new_share(picture: np.ndarray, empty: np.ndarray) -> float:
    """Share of the pixels whose colour is nowhere in the empty panel: "not black" would prove nothing."""
    return float(np.mean(~np.isin(colours(picture), colours(empty))))


@pytest.fixture
def viewer() -> Iterator[ViewerClient]:
    drivers = [*Path("/usr/share/vulkan/icd.d").glob("*.json"), *Path("/etc/vulkan/icd.d").glob("*.json")]
    there = ctypes.util.find_library("vulkan") is not None and bool(drivers)
    needed(there, "a Vulkan driver (apt install mesa-vulkan-drivers libvulkan1)")
    port = free_ports().grpc
    address = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1440x900"]
    with subprocess.Popen([rerun_binary(), *address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            assert eventually(lambda: not is_free(port))
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            process.kill()


def shoot(client: ViewerClient, name: str, shot: Path) -> np.ndarray | None:
    """A picture of one panel, or None while the viewer is about to lay out its panels again."""
    try:
        [view] = [view for view in client.get_state().views if view.name == name]
        assert not view.reports
        client.save_screenshot(str(shot), view.view_id)
    except (ConnectionError, ValueError):
        return None
    return pixels(shot)


def panels(client: ViewerClient, shot: Path) -> dict[str, np.ndarray]:
    """A picture of every panel by its title, of the recording opened last."""
    pictures: dict[str, np.ndarray] = {}

    def all_there() -> bool:
        names = {view.name for view in client.get_state().views}
        found = {name: shoot(client, name, shot) for name in names}
        pictures.update({name: picture for name, picture in found.items() if picture is not None})
        return bool(names) and pictures.keys() >= names

    assert eventually(all_there)
    return pictures


def opened(client: ViewerClient, path: Path) -> None:
    before = len(client.get_state().recordings)
    client.open(str(path))
    assert eventually(lambda: len(client.get_state().recordings) > before)
    assert eventually(lambda: not client.get_state().loading and client.get_state().views)


def settled(client: ViewerClient, name: str, shot: Path) -> np.ndarray:
    """A picture of one panel once two in a row are the same."""
    pictures: list[np.ndarray | None] = [None]

    def same() -> bool:
        pictures.append(shoot(client, name, shot))
        return pictures[-1] is not None and np.array_equal(pictures[-1], pictures[-2])

    assert eventually(same)
    return pictures[-1]
