"""``explain.py task=figures`` as a user runs it: the paper's experiments with a small run, and their report."""

from __future__ import annotations

import base64
import json
import re
import shutil
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any, NoReturn

import pytest
from few import FEW
from matplotlib.image import imread
from processes import SMALL, call
from view_data import needed
from viewers import BROWSER_FLAGS

from ibe_rl.apps.paper import agents, experiments
from ibe_rl.apps.paper.answers import answers, headlines, table
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.trained_run import TrainedRun

SECTIONS = {"protocol", "phrases", "change_label", "screened", "agents"}
SECTIONS |= {"preliminary", "expressions", "straight", "prediction"}
CHARTS = {"agents", "moves", "claim", "expressions", "straight", "observers", "episodes"}
GALLERIES = {f"gallery_{agent}_{cut}" for agent in "BC" for cut in ("end", "contact")}
HARDLY_TRAINED = 6144


def no_number(name: str) -> NoReturn:
    raise AssertionError(f"{name} is no JSON")


def read(folder: Path) -> Any:
    """The numbers of a report; strict, so neither NaN nor Infinity."""
    return json.loads((folder / "evaluation" / "paper.json").read_text(), parse_constant=no_number)


@pytest.fixture(scope="module", autouse=True)
def few_flights() -> Iterator[None]:
    """A policy flies a handful of episodes to be chosen, where it would be hundreds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(agents, "ROUND_EPISODES", (4, 5, 6, 8, 10))
        yield


@pytest.fixture(scope="module")
def run(trained: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run with its report."""
    folder = tmp_path_factory.mktemp("reported") / "run"
    shutil.copytree(trained, folder)
    call("explain", f"run={folder}", *FEW)
    return folder


def drawn(run: Path) -> set[str]:
    """The names of all pictures that there should be: a strip for each episode that is telling."""
    strips = {
        f"strip_{agent['agent']}_{cut}_{row + 1:02d}"
        for agent in read(run)["prediction"]
        for cut, judged in agent["cuts"].items()
        for rows in judged["most_telling"].values()
        for row in rows
    }
    return CHARTS | GALLERIES | strips


def source(run: Path) -> str:
    return (run / "figures" / "report.html").read_text(encoding="utf-8")


class Page(HTMLParser):
    """What is in a page: its words, the sources and links in it, and the ids that links can lead to."""

    def __init__(self, text: str):
        super().__init__()
        self.words, self.links, self.images = "", list[str](), dict[str, str]()
        self.ids, self.tags = list[str](), list[tuple[str, dict[str, str | None]]]()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append((tag, given))
        self.ids += [given["id"] or ""] if "id" in given else []
        self.links += [given["href"] or ""] if "href" in given else []
        if tag == "img":
            self.images[self.ids[-1]] = given["src"] or ""  # named by the figure around it

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.fixture(scope="module")
def page(run: Path) -> Page:
    return Page(source(run))


def test_the_numbers_are_all_there_and_strict_json(run: Path) -> None:
    found = read(run)
    assert found.keys() == SECTIONS
    assert [one["name"] for one in found["agents"]] == ["A", "B", "C"]
    assert [one["agent"] for one in found["preliminary"]] == ["A", "B", "C"]
    for section in ("expressions", "straight", "prediction"):
        assert [one["agent"] for one in found[section]] == ["B", "C"]
    assert found["agents"][2]["frame"] == 9216
    assert [each["frame"] for each in found["screened"]] == [3072, 4608, HARDLY_TRAINED, 9216]
    assert found["protocol"]["horizon_steps"] == 20
    assert found["protocol"]["run"] == "run"
    assert {one["episodes"] for one in found["agents"]} == {20}
    for agent in found["prediction"]:
        for cut in agent["cuts"].values():
            assert len(cut["episodes"]) == 3
            assert all(test["p"] <= test["p_corrected"] <= 1 for test in cut["tests"])
            assert {each["errors"]["true_future"] for each in cut["episodes"]} == {0}


def test_vocabularies_of_each_agent_are_learnt_from_its_own_windows(run: Path) -> None:
    for results in read(run)["expressions"]:
        for words in results["vocabularies"].values():
            assert words["expressions"] == sorted(words["expressions"])
            assert len(words["sizes"]) == len(words["expressions"]) == 8


def test_all_pictures_are_there_and_show_something(run: Path) -> None:
    files = {path.stem: path for path in (run / "figures").glob("*.png")}
    assert files.keys() == drawn(run)
    for path in files.values():
        picture = imread(path)
        assert min(picture.shape[:2]) > 200
        assert picture[..., :3].std() > 0.03, path.name


def test_the_page_needs_nothing_but_itself(run: Path, page: Page) -> None:
    assert {link[0] for link in page.links} == {"#"}
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links} <= {*page.ids}
    assert {tag for tag, _ in page.tags} & {"script", "link", "iframe", "object", "embed"} == set()
    assert not re.search(r"https?:|@import|url\(", re.sub(r"base64,[^\"]+", "", source(run)))
    sources = [value for _, given in page.tags for name, value in given.items() if name in ("src", "srcset", "poster")]
    assert len(sources) == len(page.images)
    assert page.images.pop("first") in page.images.values()
    for name, image in page.images.items():
        kind, _, encoded = image.partition(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(encoded) == (run / "figures" / f"{name}.png").read_bytes()
    assert page.images.keys() == drawn(run)


def test_the_page_tells_what_came_out(run: Path, page: Page) -> None:
    found, words = read(run), page.words
    assert "No people" in words
    for section in answers(found).values():
        assert all(answer in words for answer in section)
    assert len(table(found)) > 10
    for row in table(found):
        assert all(cell in words for cell in row)
    heads = [part for part in ("the paper", "here") if re.search(rf"<th>{part}\b", source(run))]
    assert heads == ["the paper", "here"]
    for name in drawn(run):
        assert f"{name}.png" in words
    for tag, given in page.tags:
        assert tag != "img" or given["alt"]


def test_agents_that_are_not_like_the_papers_are_named(run: Path) -> None:
    found, notices = read(run), re.findall(r'<p class="notice">(.*?)</p>', source(run), re.DOTALL)
    assert not found["agents"][0]["near"]  # nothing between those who never land and those who nearly always do
    assert found["agents"][2]["near"]
    for one in found["agents"]:
        assert any(f"Agent {one['name']} " in notice for notice in notices) is not one["near"]


def test_the_same_seeds_give_the_same_bytes_and_need_no_log(
    trained: Path, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "run"
    shutil.copytree(trained, again, ignore=shutil.ignore_patterns("trajectories"))
    call("explain", f"run={again}", *FEW)
    files = sorted(path.relative_to(run) for name in ("evaluation", "figures") for path in (run / name).iterdir())
    assert len(files) == 2 + len(drawn(run))
    for path in files:
        assert (run / path).read_bytes() == (again / path).read_bytes(), path
    said = " ".join(capsys.readouterr().out.split())
    for line in headlines(read(run)):
        assert line in said
    assert f"report: {again / 'figures' / 'report.html'}" in said


def without_drawing(folder: Path, found: Any, results: Any) -> tuple[list[Path], Path]:  # noqa: ARG001 - called as write_report is
    return [], folder / "report.html"


def test_another_seed_rolls_out_other_episodes(
    trained: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiments, "write_report", without_drawing)
    shutil.copytree(trained, tmp_path / "run")
    call("explain", f"run={tmp_path / 'run'}", *FEW, "figures.seed=1")
    first, other = read(run), read(tmp_path / "run")
    for purpose, seeds in first["protocol"]["seeds"].items():
        assert seeds[1] < other["protocol"]["seeds"][purpose][0]
    for section in ("agents", "preliminary", "expressions", "straight", "prediction"):
        assert first[section] != other[section], section


def test_training_can_go_on_to_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[ExplainConfig] = []

    def reproduce(opened: TrainedRun, settings: ExplainConfig) -> None:
        assert opened.folder == Path(str(settings.run))
        assert (opened.folder / "summary.json").is_file()
        asked.append(settings)

    monkeypatch.setattr(experiments, "reproduce", reproduce)
    short = [*SMALL, "total_frames=2000", "viewer=off"]
    call("train", *short, f"run_dir={tmp_path / 'without'}")
    assert not asked
    call("train", *short, f"run_dir={tmp_path / 'run'}", "report=true", "predictor.futures=2")
    [settings] = asked
    assert (settings.run, settings.task) == (str(tmp_path / "run"), "figures")
    assert settings.predictor.futures == 2


def test_a_browser_shows_the_page_without_a_network(run: Path) -> None:
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    complaints, asked = list[str](), list[str]()
    with sync_playwright() as driver, driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
        page = browser.new_context(offline=True, viewport={"width": 1280, "height": 800}).new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: asked.append(request.url.partition(":")[0]))
        page.goto((run / "figures" / "report.html").as_uri())
        widths = page.eval_on_selector_all("img", "images => images.map(image => image.naturalWidth)")
        assert len(widths) == 1 + len(drawn(run))
        assert min(widths) > 200
        assert page.evaluate("document.documentElement.scrollWidth") <= 1280
        folded = page.locator("details", has=page.locator("#gallery_C_end"))
        picture = folded.locator("#gallery_C_end img")
        assert not picture.is_visible()
        folded.locator("summary").click()
        assert all(image.is_visible() for image in folded.locator("img").all())
        assert folded.locator("img").count() == len([name for name in drawn(run) if "_C_" in name])
        picture.scroll_into_view_if_needed()
        box = picture.bounding_box()
        assert box is not None
        assert 0 <= box["x"] < box["x"] + box["width"] <= 1280
        assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    assert complaints == []
    assert asked.count("file") == 1
    assert set(asked) <= {"file", "data"}
