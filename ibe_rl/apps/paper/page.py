"""The report: all figures as PNG files, and one page that holds them, its tables and its answers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from ibe_rl.apps.paper import charts, strips
from ibe_rl.apps.paper.answers import answers, headlines, table
from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    CUT_NAMES,
    DEFAULT,
    NO_WORDS,
    OBSERVER_LABELS,
    PAPERS,
    VARIANT_LABELS,
    VOCABULARY_NAMES,
)
from ibe_rl.apps.paper.prediction_task import ObservedEpisodes
from ibe_rl.apps.report_page import write_page


class PageFigure(NamedTuple):
    """A figure of the page: its PNG file, the caption below it, and what draws it."""

    file: str
    caption: str
    draw: Callable[[], Figure]


CHARTS = {
    "agents": [("agents.png", "All evaluated policies, and the three that are used below.", charts.policies_chart)],
    "preliminary": [
        (
            "moves.png",
            "The paper's histograms. The paper shows the first two columns, for A and B.",
            charts.movements_chart,
        ),
        ("claim.png", "The claim, tested with each episode counted once.", charts.claim_chart),
    ],
    "words": [
        (
            "expressions.png",
            "What each cluster is called (m^i in the paper): by the paper's mapping and by ours.",
            charts.expressions_chart,
        )
    ],
    "straight": [
        (
            "straight.png",
            "Left: share of movements of each size called straight; shaded: the small ones. Right: the small ones, in "
            "vocabularies that exchange one half at a time.",
            charts.straight_chart,
        )
    ],
    "prediction": [
        ("observers.png", "Every observer; all read an explanation by the same fixed rule.", charts.errors_chart),
        ("episodes.png", "The same, episode by episode.", charts.episodes_chart),
    ],
}
"""File, caption and function of the figures that are drawn from numbers alone, by section of the page."""


def page_figures(
    found: dict[str, Any], observed: dict[str, dict[str, ObservedEpisodes]]
) -> dict[str, list[PageFigure]]:
    """All figures, by the section of the page that they belong to."""
    drawn = {
        section: [PageFigure(file, caption, partial(draw, found)) for file, caption, draw in several]
        for section, several in CHARTS.items()
    }
    for agent in found["prediction"]:
        cuts = observed[agent["agent"]]
        drawn[f"strips_{agent['agent']}"] = [one for cut in CUT_NAMES for one in _strips(agent, cuts[cut])]
    return drawn


def _strips(agent: dict[str, Any], observed: ObservedEpisodes) -> list[PageFigure]:
    """The episodes in which an explanation helps and misleads most, for both vocabularies; then all episodes."""
    of = f"Agent {agent['agent']}, {CUT_NAMES[observed.cut]}"
    drawn = []
    for row, extremes in _most_telling(agent["cuts"][observed.cut]).items():
        title = f"{of}, episode {row + 1}: here {' and '.join(extremes)}"
        file = strip_file(agent["agent"], observed.cut, row)
        drawn.append(PageFigure(file, f"{title}.", partial(strips.episode_strip, observed, row, title)))
    title = f"{of}: all {len(observed.shown)} episodes"
    draw = partial(strips.gallery, observed, title)
    return [*drawn, PageFigure(f"gallery_{agent['agent']}_{observed.cut}.png", f"{title}.", draw)]


def strip_file(agent: str, cut: str, row: int) -> str:
    """The name of the file of one episode."""
    return f"strip_{agent}_{cut}_{row + 1:02d}.png"


def _most_telling(results: dict[str, Any]) -> dict[int, list[str]]:
    """Episodes to what they are the extreme of."""
    found: dict[int, list[str]] = {}
    for vocabulary in (DEFAULT, PAPERS):
        best, worst = results["most_telling"][vocabulary]
        for row, much, little in ((best, "helps most", "misleads least"), (worst, "helps least", "misleads most")):
            errors = results["episodes"][row]["errors"]
            helps = errors[vocabulary] < errors[NO_WORDS]
            found.setdefault(row, []).append(f"{VOCABULARY_NAMES[vocabulary]} {much if helps else little}")
    return found


def write_report(
    folder: Path, found: dict[str, Any], observed: dict[str, dict[str, ObservedEpisodes]]
) -> tuple[list[Path], Path]:
    """Draw all figures and write the page that holds them.

    Args:
        folder: where they go.
        found: what paper.json holds.
        observed: the episodes of the prediction observed, by agent and cut.

    Returns:
        The PNG files and the page.
    """
    sections = page_figures(found, observed)
    every = {figure.file: figure for section in sections.values() for figure in section}
    agent = found["prediction"][0]
    first = strip_file(agent["agent"], AT_CONTACT, agent["cuts"][AT_CONTACT]["most_telling"][DEFAULT][0])
    files, page = write_page(
        "ibe_rl.apps.paper",
        folder,
        {name: figure.draw for name, figure in every.items()},
        found=found,
        first=every[first],
        headlines=headlines(found),
        answers=answers(found),
        table=table(found),
        sections=sections,
        labels=OBSERVER_LABELS,
        variants=VARIANT_LABELS,
        cuts=CUT_NAMES,
    )
    for old in {*folder.glob("strip_*.png")} - {*files}:  # of a report before, with other episodes
        old.unlink()
    return files, page
