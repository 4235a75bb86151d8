"""The registration says what study.yaml says."""

from __future__ import annotations

from pathlib import Path

import pytest
from own_study import write_study

from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.registration import REGISTRATION, registration, write_registration
from ibe_rl.apps.study.settings import NEXT_WORDS
from ibe_rl.storage.run_folder import write_json


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_study(tmp_path / "study", hypotheses=["People err less with words."], title="Do words help?")


def test_it_is_filled_in(folder: Path) -> None:
    before = open_study(folder).protocol
    assert write_registration(folder) == folder / REGISTRATION
    text = (folder / REGISTRATION).read_text()
    for part in (
        "# Registration: Do words help?",
        before,
        "- People err less with words.",
        "design `between`",
        "- `ibe`: our vocabulary",
        "A person sees 3 of 3 episodes",
        "6 people who finish",
        "percent of the picture's width",
        "Scale: satisfaction.",
        "fails more than 1 of 1 attention checks",
        "median time of an answer is below 1 s",
        "who does not finish",
        "`ibe` against `none`: a two-sided permutation test",
        "200 resamples, alpha = 0.05",
        "`study power` simulates it",
    ):
        assert part in text
    assert open_study(folder).protocol == before  # it is no part of what people see


def test_the_simulated_power_is_stated(folder: Path) -> None:
    rows = [
        {"arms": ["ibe", "none"], "people": [20, 40], "needed": 33},
        {"arms": ["paper", "none"], "people": [20, 40], "needed": None},
    ]
    (folder / "analysis").mkdir()
    write_json(folder / "analysis/power.json", {"studies": 1000, "rows": rows})
    text = write_registration(folder).read_text()
    assert "our vocabulary against no explanation: 33 people for a power of 80%, by 1000 simulated studies" in text
    assert "the paper's vocabulary against no explanation: more than 40 people" in text


def test_what_only_the_researcher_knows_is_left_open(tmp_path: Path) -> None:
    trials = {"task": NEXT_WORDS, "practice": 0, "each_arm": 2, "confidence": False}
    study = open_study(write_study(tmp_path / "study", trials=trials, exclusions={"unfinished": False}))
    text = registration(study, None)
    assert text.count("**To be filled in:**") == 3
    assert "share of wrong choices" in text
    assert "Confidence" not in text
    assert "who does not finish" not in text
