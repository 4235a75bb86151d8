"""The trainings of other environments: tables and files by hand, and one of them trained small."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import tutorial
from benchmarks.kept import add, forget, holds, kept
from ibe_rl.ibe.mapping import ClusterMapping


def run(*refreshes: float | None, level: str = "good", auc: float | None = 0.9731) -> dict[str, Any]:
    judged = {"value": auc, "low": 0.96, "high": 0.984}
    return {
        "refreshes": list(refreshes),
        "horizon_steps": 36,
        "success": 0.99,
        "verdict": {"level": level, "motion_auc": judged, "text": f"{level}: some words"},
    }


def test_one_of_them_trained_and_judged(tmp_path: Path):
    """The files are the page's own; the number of the first refresh has been read with its meaning."""
    tutorial.main(["--quick", "--only", "the tutorial's", "--seeds", "3", "--output", str(tmp_path)])
    found = kept(tmp_path / "tutorial.json")
    [(seed, one)] = found["the tutorial's"].items()
    assert (seed, one["horizon_steps"], len(one["refreshes"])) == ("3", 20, 3)
    assert 0 <= one["success"] <= 1
    assert set(one["verdict"]) >= {"level", "motion_auc", "text"}
    assert "\n".join(tutorial.table(found)) in (tmp_path / "OWN_ENVIRONMENT.md").read_text()
    assert (tmp_path / "QUALITY.md").read_text().startswith("<!-- few: python -m benchmarks.tutorial -->")


def test_a_row_tells_what_could_not_be_told():
    found = {"a": {"10": run(None, 0.914, 1.0), "9": run(0.5, level="unknown", auc=None)}}
    assert tutorial.table(found)[2:] == [
        "| a | 9 | 0.50 | 36 | 0.99 | - | unknown |",
        "| a | 10 | - 0.91 1.00 | 36 | 0.99 | 0.97 [0.96, 0.98] | good |",
    ]
    assert tutorial.table({"a": {"0": run(level="unknown", auc=0.03)}})[2].endswith("| - | unknown |")


@pytest.mark.parametrize(
    ("meanings", "aucs", "expected"),
    [
        ([True], [0.75], 0.75),
        ([True, True], [0.75, 0.5], 0.5),
        ([True, False], [0.75, 0.5], None),
        ([True], [None], None),
    ],
)
def test_a_refresh_counts_where_all_words_are_known(
    meanings: list[bool], aucs: list[float | None], expected: float | None, monkeypatch: pytest.MonkeyPatch
):
    class Known:
        def __init__(self, known: bool):
            self.known = known

    class Mapping:
        def __init__(self, meanings: list[bool]):
            self.meanings = [*map(Known, meanings)]

    monkeypatch.setattr(ClusterMapping, "from_dict", Mapping)
    refresh = {"mapping": meanings, "scores_of_numbers": [{"motion_auc": auc} for auc in aucs]}
    assert tutorial.truth_at(refresh) == expected


def test_only_what_lacks_is_trained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    trained: list[tuple[str, int]] = []

    def train(settings: tuple[str, ...], seed: int, _: bool) -> dict[str, Any]:
        trained.append((settings[0], seed))
        return run(1.0)

    monkeypatch.setattr(tutorial, "train", train)
    asked = ["--only", "1 a step", "`env=reacher`", "--output", str(tmp_path)]
    tutorial.main([*asked, "--seeds", "7"])
    assert trained == [("env=my_cart", 7), ("env=reacher", 7)]
    tutorial.main([*asked, "--missing"])
    assert trained[2:] == [*(("env=my_cart", seed) for seed in range(5)), ("env=reacher", 0)]
    tutorial.main([*asked, "--missing"])
    tutorial.main(["--report", "--output", str(tmp_path)])
    assert len(trained) == 8
    tutorial.main([*asked, "--seeds", "7"])
    assert json.loads((tmp_path / "tutorial.json").read_text()) == {
        "1 a step": {"7": run(1.0)},
        "`env=reacher`": {"7": run(1.0)},
    }


def test_a_page_without_the_files_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    page = tmp_path / "OWN_ENVIRONMENT.md"
    page.write_text("```python\nx = 1\n```\n")
    monkeypatch.setattr(tutorial, "SHOWN", page)
    with pytest.raises(ValueError, match="has no block of yaml; allowed is a page that shows the environment's files"):
        tutorial.write_files(tmp_path / "place")


def test_a_file_holds_what_several_have_added(tmp_path: Path):
    results = tmp_path / "new" / "results.json"
    assert kept(results) == {}
    assert not holds(results, "a", "b")
    add(results, [1], "a", "b")
    add(results, None, "a", "c")
    assert kept(results) == {"a": {"b": [1], "c": None}}
    assert holds(results, "a", "c")
    assert not holds(results, "a", "d")
    assert not holds(results, "d", "b")
    add(results, 2, "e")
    forget(results, ["a", "d"])
    assert kept(results) == {"e": 2}
