"""The report of a sweep made by hand: its table, its page, and what it says where much is missing."""

from __future__ import annotations

import csv
import re
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from processes import call
from view_data import eventually, needed
from viewers import BROWSER_FLAGS

from ibe_rl.apps.sweep import report as sweep_report
from ibe_rl.apps.sweep.figures import curves, ends
from ibe_rl.apps.sweep.records import COLUMN_LABELS, LEARNING, read_sweep
from ibe_rl.apps.sweep.report import MAIN, by_condition, main_columns, report
from ibe_rl.types import ConfigError
from tests.apps.sweep.made import judge, run, sweep

LEVELS = {"mapping=axis": [0.5, 0.6, 0.7, 0.8, 0.9], "mapping=paper": [0.1, 0.2, 0.3], "mapping=lasso": [0.4]}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = sweep(tmp_path_factory.mktemp("sweep") / "sweep", LEVELS)
    run(made / "9_mapping=axis_seed=9", ["mapping=axis", "seed=9", "total_frames=1000"], 0.0, finished=False)
    call("explain", f"sweep={made}")
    return made


@pytest.fixture(scope="module")
def found(place: Path) -> dict[str, Any]:
    return by_condition(read_sweep(place))


def test_the_table_holds_every_condition_and_metric(place: Path) -> None:
    with (place / "figures" / "sweep.csv").open() as stream:
        rows = {(row["condition"], row["metric"]): row for row in csv.DictReader(stream)}
    assert {condition for condition, _ in rows} == set(LEVELS)
    axis = rows["mapping=axis", "eval/success_rate"]
    assert (axis["runs"], axis["iqm"]) == ("5", "0.7")  # the unfinished one does not count
    assert 0.5 <= float(axis["low"]) < 0.7 < float(axis["high"]) <= 0.9
    assert axis["each"] == "0.5 0.6 0.7 0.8 0.9"
    lasso = rows["mapping=lasso", "ibe/motion_auc"]
    assert (lasso["runs"], lasso["iqm"], lasso["low"], lasso["high"]) == ("1", "0.7", "", "")


def test_the_page_says_what_is_missing_before_the_numbers(place: Path) -> None:
    page = (place / "figures" / "report.html").read_text()
    notice, rest = page.split("Final values", 1)
    assert "1 of 10 runs are not finished and do not count" in notice
    assert "mapping=axis, seed=9: not finished, at 1,000 frames" in notice
    assert "a single run, so no interval and no conclusion: mapping=lasso" in notice
    assert "intervals over 3 runs are rough" in notice
    assert rest.count("data:image/png;base64,") == 3
    assert re.search(
        r"<td>mapping=axis</td><td class=\"number\">5</td><td class=\"number\">0.700 \[0.\d+, 0.\d+\]", rest
    )
    assert re.search(r"<td>mapping=lasso</td><td class=\"number\">1</td><td class=\"number\">0.400</td>", rest)
    assert f"-m ibe_rl.viewer {place}" in rest
    assert {path.name for path in (place / "figures").iterdir()} == {
        *("report.html", "sweep.csv", "learning.png", "truth.png", "ends.png")
    }


def test_it_prints_the_table_and_where_the_rest_is(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report(place)
    said = capsys.readouterr().out
    assert "0.700" in said
    assert "mapping=paper" in said
    assert f"report: {place / 'figures' / 'report.html'}" in said
    assert f"-m ibe_rl.viewer {place}" in said
    assert "note: a single run" in said


def test_curves_are_drawn_with_their_means_and_bands(found: dict[str, Any]) -> None:
    figure = curves(found["conditions"], LEARNING)
    panels = {axis.get_title(): axis for axis in figure.axes if axis.get_visible()}
    assert list(panels) == list(LEARNING.values())
    axis = panels[LEARNING["train/success_rate"]]
    ends_of = [line.get_ydata()[-1] for line in axis.lines if len(line.get_ydata())]
    assert ends_of == pytest.approx([0.7, 0.2, 0.4], abs=1e-3)
    assert len(axis.collections) == 2  # a single run has no band
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        *("mapping=axis (5 runs)", "mapping=paper (3 runs)", "mapping=lasso (1 run)")
    ]


def test_every_run_is_drawn_where_it_ended(found: dict[str, Any]) -> None:
    columns = main_columns(found["conditions"])
    assert columns == ["eval/success_rate", "eval/return_mean", "ibe/motion_auc"]
    axis = ends(found["conditions"], columns).axes[0]
    points = [line.get_xdata().tolist() for line in map(as_arrays, axis.lines)]
    assert [0.5, 0.6, 0.7, 0.8, 0.9] in points
    assert [0.4] in points


def as_arrays(line: Any) -> Any:
    line.recache_always()
    return line


def test_everything_in_the_short_table_has_a_name() -> None:
    assert set(MAIN) <= set(COLUMN_LABELS)


def test_judged_runs_show_what_was_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = sweep(tmp_path / "sweep", {"agent=dqn": [0.5, 0.6]})
    for number, folder in enumerate(sorted(place.iterdir())):
        judge(folder, vocabulary_loss=0.02 + number / 100)
    report(place)
    assert "0.025" in capsys.readouterr().out
    assert COLUMN_LABELS["quality/vocabulary_loss"] in (place / "figures" / "report.html").read_text()


def test_a_single_run_without_explanations_is_reported_too(tmp_path: Path) -> None:
    one = run(tmp_path / "sweep" / "0", ["seed=0"])
    (one / "metrics.csv").write_text("frames,train/return_mean,eval/success_rate\n1,2,\n2,3,0.5\n")
    report(tmp_path / "sweep")
    page = (tmp_path / "sweep" / "figures" / "report.html").read_text()
    assert "1 condition<" in page
    assert page.count("data:image/png;base64,") == 2
    assert not (tmp_path / "sweep" / "figures" / "truth.png").exists()


def test_without_a_finished_run_there_is_nothing_to_report(tmp_path: Path) -> None:
    run(tmp_path / "0_seed=0", ["seed=0"], finished=False)
    run(tmp_path / "1_agent=dqn", ["agent=dqn"], finished=False)
    with pytest.raises(ConfigError, match=r"none of its 2 runs is finished \(.*: not finished, at 1,000 frames; "):
        report(tmp_path)


def test_a_condition_without_a_finished_run_is_named(tmp_path: Path) -> None:
    run(tmp_path / "0_a", ["agent=ppo", "seed=0"])
    run(tmp_path / "1_b", ["agent=dqn", "seed=0"], finished=False)
    result = by_condition(read_sweep(tmp_path))
    assert [one["name"] for one in result["conditions"]] == ["agent=ppo"]
    assert "no finished run with agent=dqn" in result["notices"]


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    run(tmp_path / "0", ["seed=0"])
    (tmp_path / "figures").write_text("a file")
    with pytest.raises(ConfigError, match=r"sweep=.*: allowed is a folder that can be written to"):
        report(tmp_path)


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["sweep=nowhere"], "sweep=nowhere: there is no run in it"),
        (["sweep=a", "run=b"], "sweep=a reports a whole sweep; allowed is no run=, agent= or task= beside it"),
        (["sweep=a", "task=evaluate"], "sweep=a reports a whole sweep"),
        (["sweep=a", "viewer=live", "viewer.web_port=70000"], "viewer.web_port=70000: allowed is at least 1"),
    ],
)
def test_explain_refuses_in_one_line(overrides: list[str], expected: str) -> None:
    with pytest.raises(SystemExit, match=f"^error: {expected}"):
        call("explain", *overrides)


def test_with_the_live_viewer_all_recordings_are_opened(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[list[str]] = []
    monkeypatch.setattr(sweep_report, "open_recordings", shown.append)
    call("explain", f"sweep={place}", "viewer=live")
    [given] = shown
    assert given[0] == str(place)
    assert given[1::2] == ["--grpc-port", "--web-port"]


def test_the_page_is_drawn_in_a_browser(place: Path) -> None:
    needed(find_spec("playwright") is not None, "playwright (pip install playwright)")
    chromium = shutil.which("chromium")
    needed(chromium is not None, "Chromium (apt install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver, driver.chromium.launch(executable_path=chromium, args=BROWSER_FLAGS) as browser:
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.goto(f"file://{place / 'figures' / 'report.html'}")
        assert eventually(lambda: page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 500)"))
        assert page.evaluate("document.documentElement.scrollWidth") <= 1200  # nothing sticks out
        assert page.inner_text("h1") == "Sweep sweep"
