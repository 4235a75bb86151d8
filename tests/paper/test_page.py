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

from ibe_rl.paper import page
from ibe_rl.paper.answers import answers, table
from ibe_rl.paper.foretelling import CONTACT, END
from ibe_rl.paper.page import pictures, write_report
from ibe_rl.paper.strips import Told

ODD = "<script>alert('a & b')</script>"
Write = Callable[[dict[str, Any], list[str]], str]


def told(names: list[str]) -> dict[str, dict[str, Told]]:
    return {name: {cut: flights(cut, 3) for cut in (END, CONTACT)} for name in names}


def few(names: list[str], run: str = "dqn0") -> dict[str, Any]:
    """With three episodes of each agent to be foretold."""
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
        said, files, report = write_report(tmp_path, of, told(names))
        assert said == answers(of)
        assert [*files, report] == [tmp_path / path.name for path in (*files, report)]
        assert {*files, report} == {*tmp_path.iterdir()}
        return report.read_text(encoding="utf-8")

    monkeypatch.setattr(page, "save", save)
    return written


def test_every_picture_has_a_file_of_its_own_and_says_what_it_is() -> None:
    sections = pictures(few(["A", "B", "C"]), told(["B", "C"]))
    every = [picture for section in sections.values() for picture in section]
    assert len({picture.file for picture in every}) == len(every) == 7 + 2 * 2 * 5
    assert all(len(picture.caption) > 20 for picture in every)
    for name in ("B", "C"):
        captions = [picture.caption for picture in sections[f"strips_{name}"]]
        assert len(set(captions)) == 10
        assert all(f"Agent {name}" in caption for caption in captions)
        for kind in ("helps", "misleads"):
            assert sum(kind in caption for caption in captions) == 4


def test_strips_are_of_the_most_telling_episodes() -> None:
    for picture in pictures(few(["B"]), told(["B"]))["strips_B"]:
        if picture.file.startswith("strip"):
            episode = 1 if "helps" in picture.caption else 3
            assert f"episode {episode}:" in picture.caption
            assert f"episode {episode}:" in picture.draw().get_suptitle()


def test_the_page_holds_all_that_was_found(write: Write) -> None:
    made = few(["A", "B", "C"])
    text = write(made, ["B", "C"])
    words = unescape(text)
    assert "No people took part" in words
    for answer in answers(made):
        assert answer in words
    for row in table(made):
        assert all(f"<td>{cell}</td>" in words for cell in row)
    for section in pictures(made, told(["B", "C"])).values():
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
    told_left, told_nothing, told_right = (told_so["claim"] for told_so in made["preliminary"][0]["told"].values())
    told_left["within"]["superiority"] = UNKNOWN
    told_nothing["within"]["superiority"] = UNKNOWN | {"value": 0.875}
    told_right |= dict.fromkeys(told_right)
    text = write(made, ["B"])
    assert '<td class="number">-</td>' in text
    assert '<td class="number">0.88</td>' in text
    rows = [row for row in text.split("<tr>") if row.startswith("<td>B</td><td>falling ")]
    assert len(rows) == 4 + 4  # nobody was told to go right
    assert "None" not in text.split("</details>")[0]


def test_an_agent_unlike_the_papers_is_named(write: Write) -> None:
    notices = [part.split("</p>")[0] for part in write(few(["B"]), ["B"]).split('<p class="notice">')[1:]]
    assert [any(f"Agent {name} " in notice for notice in notices) for name in "ABC"] == [True, False, False]
