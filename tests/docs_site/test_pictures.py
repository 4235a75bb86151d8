"""The pictures that docs and README show, and the pieces that make them."""

from pathlib import Path

from PIL import Image
from processes import ROOT

from docs_site import drawings

LARGEST_BYTES = 3_000_000


def test_the_moving_picture_moves_and_is_small() -> None:
    path = ROOT / "docs" / "img" / "live_view.webp"
    assert path.stat().st_size < LARGEST_BYTES
    assert f"({path.relative_to(ROOT)})" in (ROOT / "README.md").read_text()
    with Image.open(path) as image:
        assert image.n_frames > 50
        assert image.info["loop"] == 0


def test_the_pictures_of_how_it_works_are_drawn(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(drawings, "EPISODES", 2)
    drawings.main(tmp_path)
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == {path.name for path in drawings.PICTURES.glob("how_*.png")}
    assert all(name in (ROOT / "docs" / "HOW_IT_WORKS.md").read_text() for name in drawn)
