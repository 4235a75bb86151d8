"""The figures show what they were given; how they look was looked at by eye."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from ibe_rl.evaluation.figures import by_explainer, changing, confidence, draw_all, over_horizons

OURS = "ibe:axis"


def estimate(value: float | None) -> dict[str, float | None]:
    return {
        "value": value,
        "low": None if value is None else value - 0.1,
        "high": None if value is None else value + 0.05,
    }


def row(name: str, horizon: int, auc: float | None, **more: Any) -> dict[str, Any]:
    return {
        "explainer": name,
        "horizon_steps": horizon,
        "motion_auc": estimate(auc),
        "motion_auc_disobeyed": estimate(None),
        **more,
    }


ROWS = [row(OURS, 60, 0.9), row("baseline:paper", 60, 0.7), row("baseline:shuffled", 60, 0.5, over="refits")]
ROWS += [row(OURS, 20, 0.8), row("baseline:paper", 20, None)]
AGES = [
    {
        "policy_frame": policy,
        "vocabulary_frame": age,
        **dict.fromkeys(("motion_auc", "motion_spearman", "came_true"), estimate(v)),
    }
    for policy, age, v in ((100_000, 50_000, 0.5), (200_000, 50_000, 0.6), (200_000, 150_000, None))
]
CALIBRATION = {
    "explainer": OURS,
    "horizon_steps": 60,
    "reliability": [
        {"moments": 3, "confidence": 0.4, "came_true": 0.5},
        {"moments": 9, "confidence": 0.9, "came_true": 1},
    ],
    "risk_coverage": {"coverage": [0.2, 1.0], "risk": [0.0, 0.25]},
}


def test_explainers_are_in_the_order_of_their_truth():
    figure = by_explainer(ROWS, 60)
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert names == ["shuffled", "paper", "ibe:axis"]
    points = [line.get_xdata()[0] for line in figure.axes[0].lines if len(line.get_xdata()) == 1]
    assert points == [0.5, 0.7, 0.9]
    assert "60 steps" in figure.get_suptitle()


def test_confidence_is_drawn_in_percent():
    figure = confidence(CALIBRATION)
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx([0, 25])
    assert [axis.get_xlabel() for axis in figure.axes] == [
        "confidence that it goes as predicted",
        "coverage, most confident moments first (%)",
    ]


def test_horizons_without_a_value_are_left_out():
    left = over_horizons(ROWS, (OURS, "baseline:paper"), 60).axes[0]
    assert [len(line.get_ydata()) for line in left.lines] == [2, 1, 2]  # and the dotted one
    assert left.get_xticks().tolist() == [20, 60]


def test_ages_that_no_policy_had_stay_empty():
    shown = changing(AGES, 60).axes[0].images[0].get_array()
    assert np.ma.getmaskarray(shown).tolist() == [[False, False], [True, True]]


def test_a_metric_that_nobody_could_tell_is_an_empty_picture():
    nothing = [each | {"motion_spearman": estimate(None)} for each in AGES]
    assert np.ma.getmaskarray(changing(nothing, 60).axes[1].images[0].get_array()).all()


@pytest.mark.slow
def test_dollars_in_a_name_are_no_formula(tmp_path: Path):
    """A formula of an unknown command would be an error, and a known one would look like something else."""
    name = r"ibe:$\unknown$ a_1"
    rows = [row(name, 60, 0.9), row(name, 20, 0.8)]
    quality = {"rows": rows, "protocol": {"horizon_steps": 60}, "changing_policy": []}
    assert len(draw_all(tmp_path, quality, CALIBRATION, name, [])) == 3


def test_all_are_written_as_pictures(tmp_path: Path):
    quality = {"protocol": {"horizon_steps": 60}, "rows": ROWS, "changing_policy": AGES}
    drawn = draw_all(tmp_path, quality, CALIBRATION, OURS, ("baseline:paper",))
    assert [path.name for path in drawn] == ["quality.png", "confidence.png", "horizons.png", "changing_policy.png"]
    assert sorted(tmp_path.iterdir()) == sorted(drawn)
    for path in drawn:
        picture = imread(path)
        assert min(picture.shape[:2]) > 200
        assert picture.std() > 0.05
    assert len(draw_all(tmp_path, quality | {"changing_policy": []}, CALIBRATION, OURS, ())) == 3
