"""The page of an analysis with its figures."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ibe_rl.apps.report_page import write_page
from ibe_rl.apps.study import analysis_charts as charts
from ibe_rl.apps.study.arm_names import ARM_NAMES, unit
from ibe_rl.apps.study.exclusions import RULES
from ibe_rl.apps.study.findings import beside_paper, caveats, outcome, p_value
from ibe_rl.apps.study.measures import RIGHT_WITHIN

FIGURES_OF = {
    "means.png": ("trials", charts.means_chart),
    "episodes.png": ("episodes", charts.each_episode_chart),
    "confidence.png": ("calibration", charts.confidence_chart),
    "learning.png": ("learning", charts.learning_chart),
    "scales.png": ("scales", charts.scales_chart),
}
"""Files of figures to what of the findings they need, and what draws them."""


def write_analysis_page(folder: Path, found: dict[str, Any], script: str) -> Path:
    """Draw the figures that there are numbers for, and write the page with them.

    Args:
        folder: where they go.
        found: what results.json holds.
        script: the models for R.

    Returns:
        The page.
    """
    drawn: dict[str, Callable[[], Figure]] = {
        file: partial(draw, found) for file, (needs, draw) in FIGURES_OF.items() if found[needs]
    }
    _, page = write_page(
        "ibe_rl.apps.study",
        folder,
        drawn,
        found=found,
        outcome=outcome(found),
        caveats=caveats(found),
        paper=beside_paper(found),
        arm_names=ARM_NAMES,
        rules=RULES,
        unit=unit(found),
        p_value=p_value,
        right_within=RIGHT_WITHIN,
        script=script,
    )
    for file in set(FIGURES_OF) - set(drawn):  # of an analysis before, with more answers
        (folder / file).unlink(missing_ok=True)
    return page
