"""The files of a report, read back."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from by_hand import WORDS
from lift import TASK, moments, words

from ibe_rl.evaluation.report import calibration_report, make_folders, reliability, write_moments
from ibe_rl.evaluation.rows import Judged, Truth
from ibe_rl.evaluation.verbalise import calibrate, speak
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.types import ConfigError

OURS = "ibe:lift"
HERE = moments([2, -2], [[2, 2, 2], [1.5, -3, -2]], instruction=[1, -1], episode=[0, 1], speed=[3, 4])


def judged() -> Judged:
    weights = episode_weights(HERE.episode, 20, 0)
    spoken = speak(words(), HERE, 5, [WORDS])
    truth = Truth.of(HERE, 5, TASK, np.zeros((2, 1)), weights)
    return Judged(
        truth, TASK.number_names, {}, {}, {OURS: spoken}, {OURS: calibrate(spoken)}, {OURS: np.array([0.85, 0.25])}
    )


def test_a_row_a_moment(tmp_path: Path):
    write_moments(tmp_path / "moments.csv", HERE, judged(), OURS, TASK)
    with (tmp_path / "moments.csv").open() as stream:
        first, second = list(csv.DictReader(stream))
    assert list(first) == [
        *("episode_seed", "step", "height", "speed", "floor", "m*", "m", "phrase", "known", "confidence"),
        *(f"{when}_delta_{name}" for when in ("predicted", "realised") for name in ("height", "speed", "floor")),
    ]
    assert (first["episode_seed"], second["episode_seed"]) == ("100", "101")
    assert [float(second[name]) for name in ("step", "speed", "m*", "m", "confidence")] == [1, 4, -1, -1, 0.25]
    assert (first["phrase"], second["phrase"]) == ("going up", "going down")  # what most of the futures are called
    assert [float(second[f"{when}_delta_height"]) for when in ("predicted", "realised")] == [-3, -2]


def test_reliability_is_counted_in_bins():
    bins = reliability(np.array([0.0, 0.05, 0.55, 1.0]), np.array([False, True, True, True]))
    assert [(each["from"], each["to"], each["moments"]) for each in bins] == [(0, 0.1, 2), (0.5, 0.6, 1), (0.9, 1, 1)]
    assert [each["came_true"] for each in bins] == [0.5, 1, 1]
    assert bins[0]["confidence"] == pytest.approx(0.025)


def test_the_calibration_can_be_read_back():
    found = calibration_report(judged(), OURS, mapping_frame=950)
    assert Calibration.from_dict(found["calibration"]).names == ("agreement", "purity")
    assert found["risk_coverage"] == {"coverage": [0.5, 1.0], "risk": [0.0, 0.0]}
    assert (found["mapping_frame"], found["horizon_steps"]) == (950, 5)  # the vocabulary that it is of


def test_folders_are_made_or_refused_before_any_work(tmp_path: Path):
    make_folders(tmp_path)
    make_folders(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["evaluation", "figures"]
    assert list((tmp_path / "evaluation").iterdir()) == []
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "evaluation").write_text("in the way")
    with pytest.raises(ConfigError, match=re.escape(f"run={tmp_path / 'other'}: allowed is a folder that can be")):
        make_folders(tmp_path / "other")
