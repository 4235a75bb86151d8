"""A training of a few seconds with all that is our own."""

from pathlib import Path

from train import train

FEW = {"processes": 1, "envs_per_process": 8, "steps_per_batch": 128}


def test_it_trains_and_explains_itself(tmp_path: Path) -> None:
    """Into a folder of its own."""
    explained = train(
        str(tmp_path / "run"), total_frames=6_000, refresh_every_frames=3_000, eval_episodes=5, collect=FEW
    )
    assert explained.run.config.mapping.quiet == 0.1
    assert "Corridor" in str(explained.explain(seed=3))
    assert explained.clip(tmp_path / "corridor.gif", seed=3).stat().st_size > 1_000
    assert len((tmp_path / "run" / "diary.txt").read_text().splitlines()) == 2
