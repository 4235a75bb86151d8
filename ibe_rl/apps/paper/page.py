"""The report: all figures as PNG files, and one page that holds them, its tables and its answers."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from ibe_rl.apps.paper import charts, strips
from ibe_rl.apps.paper.answers import CUT_NAMES, answers, headlines, table
from ibe_rl.apps.paper.charts import NAMES
from ibe_rl.apps.paper.foretelling import CONTACT, END, NOTHING
from ibe_rl.apps.paper.plot_style import LABELS, VARIANTS
from ibe_rl.apps.paper.strips import Told
from ibe_rl.apps.paper.words import OURS, PAPER
from ibe_rl.evaluation.figures import save
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.storage.run_folder import write_atomically

CUTS = (END, CONTACT)


@dataclass(frozen=True)
class Picture:
    """A figure of the page.

    Attributes:
        file: name of the PNG file.
        caption: below it.
        draw: makes it.
    """

    file: str
    caption: str
    draw: Callable[[], Figure]


def pictures(found: dict[str, Any], told: dict[str, dict[str, Told]]) -> dict[str, list[Picture]]:
    """All figures, by the section of the page that they belong to."""
    return {
        "agents": [
            Picture(
                "agents.png",
                "Every policy that was tried out, and the three that fly on.",
                partial(charts.agents, found),
            )
        ],
        "preliminary": [
            Picture(
                "moves.png",
                "The paper's histograms; it shows the first two columns, for A and B.",
                partial(charts.moves, found),
            ),
            Picture("claim.png", "The claim, tested with each episode counted once.", partial(charts.claim, found)),
        ],
        "words": [
            Picture("expressions.png", "The paper's figure of m^i, and ours.", partial(charts.expressions, found))
        ],
        "straight": [
            Picture(
                "straight.png",
                "Left: share of movements of each size called straight; shaded: the small ones. Right: the small ones, "
                "in vocabularies that exchange one half at a time.",
                partial(charts.straight, found),
            )
        ],
        "prediction": [
            Picture(
                "observers.png", "Every observer; all listen in the same fixed way.", partial(charts.errors, found)
            ),
            Picture("episodes.png", "The same, episode by episode.", partial(charts.by_episode, found)),
        ],
        **{
            f"strips_{name}": [one for cut in CUTS for one in _strips(found, name, cuts[cut])]
            for name, cuts in told.items()
        },
    }


def _strips(found: dict[str, Any], name: str, told: Told) -> list[Picture]:
    """The episodes in which an explanation helps and misleads most, for both vocabularies; then all episodes."""
    [agent] = [each for each in found["prediction"] if each["agent"] == name]
    cut = CUT_NAMES[told.cut]
    drawn = []
    for row, told_of_it in _most_telling(agent["cuts"][told.cut]).items():
        title = f"Agent {name}, {cut}, episode {row + 1}: here {' and '.join(told_of_it)}"
        drawn.append(Picture(strip_file(name, told.cut, row), f"{title}.", partial(strips.strip, told, row, title)))
    title = f"Agent {name}, {cut}: all {len(told.shown)} episodes"
    return [*drawn, Picture(f"gallery_{name}_{told.cut}.png", f"{title}.", partial(strips.gallery, told, title))]


def strip_file(agent: str, cut: str, row: int) -> str:
    """The name of the file of one episode."""
    return f"strip_{agent}_{cut}_{row + 1:02d}.png"


def _most_telling(judged: dict[str, Any]) -> dict[int, list[str]]:
    """Episodes to what they are the extreme of."""
    found: dict[int, list[str]] = {}
    for vocabulary in (OURS, PAPER):
        best, worst = judged["most_telling"][vocabulary]
        for row, much, little in ((best, "helps most", "misleads least"), (worst, "helps least", "misleads most")):
            errors = judged["episodes"][row]["errors"]
            helps = errors[vocabulary] < errors[NOTHING]
            found.setdefault(row, []).append(f"{NAMES[vocabulary]} {much if helps else little}")
    return found


def write_report(folder: Path, found: dict[str, Any], told: dict[str, dict[str, Told]]) -> tuple[list[Path], Path]:
    """Draw all figures and write the page that holds them.

    Args:
        folder: where they go.
        found: what paper.json holds.
        told: the episodes of the prediction task, by agent and cut.

    Returns:
        The PNG files and the page.
    """
    sections = pictures(found, told)
    every = [picture for section in sections.values() for picture in section]
    agent = found["prediction"][0]
    first = strip_file(agent["agent"], CONTACT, agent["cuts"][CONTACT]["most_telling"][OURS][0])
    with progress_bar("figures", len(every)) as step:
        files = []
        for picture in every:
            files.append(save(picture.draw(), folder / picture.file))
            step()
    for old in {*folder.glob("strip_*.png")} - {*files}:  # of a report before, with other episodes
        old.unlink()
    encoded = {path.name: base64.b64encode(path.read_bytes()).decode() for path in files}
    page = template("ibe_rl.apps.paper").render(
        found=found,
        first=next(picture for picture in every if picture.file == first),
        headlines=headlines(found),
        answers=answers(found),
        table=table(found),
        sections=sections,
        encoded=encoded,
        labels=LABELS,
        variants=VARIANTS,
        cuts=CUT_NAMES,
    )
    write_atomically(folder / "report.html", lambda stream: stream.write(page.encode()))
    return files, folder / "report.html"


def template(package: str) -> Any:
    """The page ``report.html.jinja`` of a package; it may include what lies beside this file."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("ibe_rl.apps.paper", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    return environment.get_template("report.html.jinja")


def number(told: dict[str, Any] | None, digits: int = 2, sign: bool = False) -> str:
    """A value with its interval."""
    if told is None or told["value"] is None:
        return "-"
    plus = "+" if sign else ""
    text = f"{told['value']:{plus}.{digits}f}"
    return text if told["low"] is None else f"{text} [{told['low']:{plus}.{digits}f}, {told['high']:{plus}.{digits}f}]"
