"""The page holds what was found, whatever it is called; how it looks was looked at by eye."""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from outcome import UNKNOWN, flights, found

from ibe_rl.apps import report_page
from ibe_rl.apps.paper.answers import answers, headlines, table
from ibe_rl.apps.paper.names import AT_CONTACT, AT_END, DEFAULT, NO_WORDS, PAPERS
from ibe_rl.apps.paper.page import page_figures, write_report
from ibe_rl.apps.paper.prediction_task import ObservedEpisodes

pytestmark = pytest.mark.slow

ODD = "<script>alert('a & b')</script>"
Write = Callable[[dict[str, Any], list[str]], str]


def observed_episodes(names: list[str]) -> dict[str, dict[str, ObservedEpisodes]]:
    return {name: {cut: flights(cut, 3) for cut in (AT_END, AT_CONTACT)} for name in names}


def few(names: list[str], run: str = "dqn0") -> dict[str, Any]:
    """With three episodes of each agent for the prediction task."""
    made = found(names, run)
    for agent in made["prediction"]:
        for cut in agent["cuts"].values():
            cut["most_telling"] = {name: [0, 2] for name in cut["most_telling"]}
    return made


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes a page without drawing its pictures: the file of a picture holds its name."""

    def save(figure: Figure, path: Path) -> Path:
        assert isinstance(figure, Figure)
        path.write_text(path.name)
        return path

    def written(of: dict[str, Any], names: list[str]) -> str:
        files, report = write_report(tmp_path, of, observed_episodes(names))
        assert [*files, report] == [tmp_path / path.name for path in (*files, report)]
        assert {*files, report} == {*tmp_path.iterdir()}
        return report.read_text(encoding="utf-8")

    monkeypatch.setattr(report_page, "save", save)
    return written


def test_every_picture_has_a_file_of_its_own_and_says_what_it_is() -> None:
    sections = page_figures(few(["A", "B", "C"]), observed_episodes(["B", "C"]))
    every = [picture for section in sections.values() for picture in section]
    assert len({picture.file for picture in every}) == len(every) == 7 + 2 * 2 * 3
    assert all(len(picture.caption) > 20 for picture in every)
    for name in ("B", "C"):
        captions = [picture.caption for picture in sections[f"strips_{name}"]]
        assert len(set(captions)) == 6
        assert all(f"Agent {name}" in caption for caption in captions)


def test_strips_are_of_the_most_telling_episodes_each_drawn_once() -> None:
    made = few(["B"])
    for cut in made["prediction"][0]["cuts"].values():
        for row, ours, papers in ((0, 1.0, 2.0), (2, 6.0, 3.0)):
            cut["episodes"][row]["errors"] |= {NO_WORDS: 5.0, DEFAULT: ours, PAPERS: papers}
    drawn = [
        picture
        for picture in page_figures(made, observed_episodes(["B"]))["strips_B"]
        if picture.file.startswith("strip")
    ]
    assert [picture.file for picture in drawn] == [
        f"strip_B_{cut}_{number}.png" for cut in (AT_END, AT_CONTACT) for number in ("01", "03")
    ]
    for first, last in (drawn[:2], drawn[2:]):
        both = "here our default vocabulary helps most and the paper's vocabulary helps most"
        assert f"episode 1: {both}" in first.caption
        assert f"episode 1: {both}" in first.draw().get_suptitle()
        assert (
            "episode 3: here our default vocabulary misleads most and the paper's vocabulary helps least"
            in last.caption
        )


def test_an_explanation_that_never_helps_misleads_least_where_it_is_best() -> None:
    made = few(["B"])
    for cut in made["prediction"][0]["cuts"].values():
        for row in (0, 2):
            cut["episodes"][row]["errors"] |= {NO_WORDS: 1.0, DEFAULT: 2.0, PAPERS: 3.0 + row}
    first, last, *_ = page_figures(made, observed_episodes(["B"]))["strips_B"]
    assert "our default vocabulary misleads least and the paper's vocabulary misleads least" in first.caption
    assert last.caption.count("misleads most") == 2


def test_strips_of_an_earlier_report_do_not_stay(write: Write, tmp_path: Path) -> None:
    (tmp_path / "strip_B_end_99.png").touch()
    write(few(["B"]), ["B"])  # which looks at all that is there


def test_the_page_holds_all_that_was_found(write: Write) -> None:
    made = few(["A", "B", "C"])
    text = write(made, ["B", "C"])
    words = unescape(text)
    assert "No people took part" in words
    for section in answers(made).values():
        assert all(answer in words for answer in section)
    assert all(line in words.split("The paper / here</h2>")[0] for line in headlines(made))
    for row in table(made):
        assert all(f"<td>{cell}</td>" in words for cell in row)
    for section in page_figures(made, observed_episodes(["B", "C"])).values():
        for picture in section:
            assert base64.b64encode(picture.file.encode()).decode() in text
            assert f'id="{picture.file[:-4]}"' in text
            assert picture.caption in words
    for number in ("0.67 [0.57, 0.77]", "+0.150", "-0.125", "-0.002 [-0.032, +0.028]", "19, 77"):
        assert f'<td class="number">{number}</td>' in words


def test_names_are_text_and_no_code(write: Write) -> None:
    made = few(["B"], run=ODD)
    made["protocol"]["environment"] = made["change_label"] = ODD
    made["phrases"] = dict.fromkeys(made["phrases"], ODD)
    text = write(made, ["B"])
    assert "<script" not in text
    assert unescape(text).count(ODD) > 5


def test_what_is_not_known_is_a_dash_or_left_out(write: Write) -> None:
    made = few(["B"])
    left, straight, right = (group["claim"] for group in made["preliminary"][0]["told"].values())
    left["within"]["superiority"] = UNKNOWN
    straight["within"]["superiority"] = UNKNOWN | {"value": 0.875}
    right |= dict.fromkeys(right)
    text = write(made, ["B"])
    assert '<td class="number">-</td>' in text
    assert '<td class="number">0.88</td>' in text
    rows = [row for row in text.split("<tr>") if row.startswith("<td>B</td><td>falling ")]
    assert len(rows) == 4 + 4  # nobody was told to go right
    assert "None" not in text.split("</details>")[0]


def test_an_agent_unlike_the_papers_is_named(write: Write) -> None:
    notices = [part.split("</p>")[0] for part in write(few(["B"]), ["B"]).split('<p class="notice">')[1:]]
    assert [any(f"Agent {name} " in notice for notice in notices) for name in "ABC"] == [True, False, False]
