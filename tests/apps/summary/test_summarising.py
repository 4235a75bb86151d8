"""``task=summary`` as a user runs it: a small run beside an earlier state of itself and beside another run."""

from __future__ import annotations

import json
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import SMALL, call
from view_data import eventually, needed
from viewers import BROWSER_FLAGS

import ibe_rl

pytestmark = pytest.mark.slow

QUICK = ["viewer=off", "predictor.processes=1", "predictor.futures=1", "summary.episodes=3", "summary.resamples=40"]
CART = ["env=cart_pole", "mapping.meaning=assumed"]


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("summed") / "run"
    call("train", *SMALL, *CART, f"run_dir={folder}", "viewer=off")
    return folder


@pytest.fixture(scope="module")
def summed(trained: Path) -> Path:
    """The run beside its own policy of half the training."""
    call("explain", f"run={trained}", "task=summary", *QUICK, "with_frame=3000")
    return trained


def numbers(folder: Path) -> Any:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    return json.loads((folder / "summary" / "summary.json").read_text(), parse_constant=refuse)


def test_it_holds_shares_moments_episodes_and_the_other_agent(summed: Path) -> None:
    found = numbers(summed)
    assert found.keys() == {"protocol", "shares", "not_as_told", "telling_episodes", "episodes", "beside"}
    about = found["protocol"]
    assert (about["episodes"], about["policy_frame"]) == (3, 6144)
    assert about["steps"] == sum(one["steps"] for one in found["episodes"])
    assert about["seeds"] == [one["seed"] for one in found["episodes"]][::2]
    for row in found["shares"]:
        for each in ("said", "came"):
            assert sum(row[each].values()) == pytest.approx(1, abs=1e-3)
    assert found["beside"]["other"]["policy_frame"] == 3072
    [success] = [row for row in found["beside"]["measures"] if row["name"] == "success"]
    assert success["this"]["value"] == np.mean([one["success"] for one in found["episodes"]])
    assert {"report.html", "summary.json"} == {path.name for path in (summed / "summary").iterdir()}
    assert (summed / "summary.json").is_file()  # the training's own stays


def test_it_says_the_most_important_in_the_terminal(trained: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("explain", f"run={trained}", "task=summary", *QUICK)
    said = capsys.readouterr().out
    for part in ("3 unseen episodes", "whole episode", "last third", "The episodes that say most about it:"):
        assert part in said
    assert f"page:    {trained / 'summary' / 'report.html'}" in said
    assert numbers(trained)["beside"] is None


def test_the_same_seeds_give_the_same_numbers_and_another_run_is_set_beside(trained: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(trained, other)
    for _ in range(2):
        call("explain", f"run={trained}", "task=summary", *QUICK, f"with={other}")
        found = numbers(trained)
        assert found["beside"]["other"]["run"] == "other"
        rows = [*found["beside"]["measures"], *found["beside"]["phrases"]]
        assert all(row["difference"]["value"] in (0.0, None) for row in rows)


def test_a_program_gets_the_same(trained: Path) -> None:
    opened = ibe_rl.open_run(trained)
    opened.config.summary.episodes, opened.config.predictor.processes = 2, 1
    assert opened.summarise()["protocol"]["episodes"] == 2


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (["with=nowhere"], "run=nowhere: not a run folder"),
        (["with_frame=6144"], r"with_frame=6144: that is the agent itself, its policy of frame 6,144; allowed is"),
        (["with={run}"], r"with=.*: that is the agent itself"),
        (["with_frame=-1"], "with_frame=-1: allowed is at least 0"),
        (["with=demo"], r"with=demo: it is of Lunar Lander with pads; allowed is a run of "),
        (["summary.episodes=1"], "summary.episodes=1: allowed is at least 2"),
    ],
)
def test_what_cannot_stand_beside_it_is_refused_before_any_episode(
    trained: Path, settings: list[str], expected: str
) -> None:
    given = [one.format(run=trained) for one in settings]
    before = (trained / "summary").exists() and (trained / "summary" / "summary.json").stat().st_mtime_ns
    with pytest.raises(SystemExit, match=f"^error: {expected}"):
        call("explain", f"run={trained}", "task=summary", *QUICK, *given)
    assert ((trained / "summary").exists() and (trained / "summary" / "summary.json").stat().st_mtime_ns) == before


def test_a_folder_that_cannot_be_written_is_refused(trained: Path, tmp_path: Path) -> None:
    shutil.copytree(trained, tmp_path / "run", ignore=shutil.ignore_patterns("summary"))
    (tmp_path / "run" / "summary").write_text("a file")
    with pytest.raises(SystemExit, match="allowed is a folder that can be written to"):
        call("explain", f"run={tmp_path / 'run'}", "task=summary", *QUICK)


@pytest.mark.parametrize("width", [1280, 360])
def test_the_page_plays_its_films_on_any_screen(summed: Path, width: int) -> None:
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = shutil.which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    call("explain", f"run={summed}", "task=summary", *QUICK, "with_frame=3000")
    with sync_playwright() as driver, driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
        page = browser.new_page(viewport={"width": width, "height": 900})
        failed: list[str] = []
        page.on("pageerror", lambda error: failed.append(str(error)))
        page.goto(f"file://{summed / 'summary' / 'report.html'}")
        assert page.inner_text("h1") == "What this agent does, in its words"
        first = page.locator("[data-film] >> nth=0")
        assert eventually(lambda: "step 0 " not in first.inner_text())
        first.locator("button").click()
        assert first.locator("button").inner_text() == "play"
        first.locator(".lanes").press("Home")
        assert "step 0 of" in first.inner_text()
        first.locator(".lanes").press("ArrowRight")
        assert "step 3 of" in first.inner_text()
        coloured = (
            "canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(Boolean)"
        )
        assert first.locator("canvas").evaluate(coloured)
        assert page.evaluate("document.documentElement.scrollWidth") <= width  # nothing sticks out
        assert failed == []
        assert "this minus other" in page.inner_text("main")
