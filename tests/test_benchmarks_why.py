"""Why mappings differ on real flights: the losses by hand, and all of it once on a lift that obeyed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import why
from benchmarks.plan import ROOT
from benchmarks.why_facts import explained_variance, losses
from benchmarks.why_figures import draw
from benchmarks.why_report import markdown, summarise
from benchmarks.why_variants import renamed
from ibe_rl.ibe import ClusterMapping, IBEConfig
from ibe_rl.ibe.space import scaled
from ibe_rl.metrics.quality import motion_auc
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError
from tests.by_hand import TASK, column, defy, obey

pytestmark = pytest.mark.slow


def test_lost_order_is_shared_by_the_moments_of_a_pair():
    lost, ties = losses(np.array([-1.0, 0, 0, 1]), np.array([-1, -1, 1, 1]))  # one pair of four is tied, on both sides
    assert lost.tolist() == [0, 0.0625, 0.0625, 0]
    assert ties == 0.125
    lost, ties = losses(np.array([1.0, -1]), np.array([-1, 1]))
    assert (lost.tolist(), ties) == ([0.5, 0.5], 0)


def test_what_the_moments_lose_adds_up():
    random = np.random.default_rng(0)
    said, change = random.integers(-3, 4, 200) / 3, random.normal(size=200)
    lost, _ = losses(said, np.where(np.abs(change) > 0.5, np.sign(change), 0))
    assert lost.sum() == pytest.approx(1 - motion_auc(said, change, 0.5))


def test_clusters_divide_the_dimension_they_differ_in():
    delta = np.array([[0, 0, 7], [0, 1, 7], [2, 0, 7], [2, 1, 7]], float)
    assert explained_variance(np.array([0, 0, 1, 1]), delta).tolist() == [1, 0, 0]


def test_cluster_is_named_by_the_mean_movement_of_its_windows():
    ones = np.ones(3)
    said = column(1, 0, -1)
    mapping = ClusterMapping(scaled(np.zeros(1), np.ones(1)), column(-9, 0, 9), said, said, ones, ones, ones, ones)
    made = renamed(mapping, column(-9, -8, 9, 1), np.array([-3.0, -5, 2, 0]))
    assert made.expressions.tolist() == [[-1], [0], [0.5]]
    assert renamed(mapping, column(-9), np.zeros(1)).expressions.tolist() == [[0], [0], [0]]


@pytest.fixture(scope="module")
def lift(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Vocabularies of a lift that obeyed, on flights of which one half obeys and one goes the other way."""
    folder = tmp_path_factory.mktemp("lift")
    log, flights = (TrajectoryLog(folder / name, 10_000, TASK.contexts) for name in ("log", "flights"))
    for _ in range(20):
        obey(log, seen_speed=False)  # or the axis would be the speed's, which never changes
    obey(flights)
    defy(flights)
    rolled_out = why.landed("lift", log, IBEConfig(horizon_steps=5), TASK, flights.read(range(6)))
    run, rows = why.measure(rolled_out, seeds=2, resamples=5)
    return {"protocol": {}, "runs": [run], "table": summarise([run], [rows])}


def test_variants_are_distinguished_on_real_flights(lift: dict[str, Any]):
    auc = {record["name"]: record["motion_auc"]["value"] for record in lift["table"]}
    assert (auc["paper"], auc["axis"], auc["height only"]) == (1, 1, 1)
    assert auc["without windows of instruction 0"] < 1  # what stands still has to be called up or down
    assert auc["without height"] is None  # nothing is left that moves
    assert "without floor" not in auc
    assert lift["runs"][0]["moments"] == 18
    assert lift["table"][0]["motion_auc_disobeyed"] == {"value": 1, "low": 1, "high": 1}


def test_facts_count_the_windows(lift: dict[str, Any]):
    known = lift["runs"][0]["facts"]
    assert known["learnt_from"]["told_by_context"]["lower"] == [0.3333, 0.3333, 0.3333]
    assert known["learnt_from"]["told_by_way"]["down"] == [0.3333, 0, 0]
    shares = {name: part["moments"] for name, part in known["paper"]["moments"].items()}
    assert (shares["told to move, did"], shares["told to move, went the other way"]) == (0.3333, 0.3333)
    assert (
        shares["told 0, stayed"] == shares["cut short by the end"] == 0.3333
    )  # of the steps 0, 4 and 8, only the last reaches past 12
    assert known["paper"]["lost"] == 0
    assert known["weights"]["axis"] == {"height": 1, "speed": 0, "floor": 0}
    assert sum(cluster["moments"] for cluster in known["paper"]["clusters"]) == 18


def test_table_shows_every_variant_and_a_dash_for_what_is_not_known(lift: dict[str, Any]):
    lines = markdown(lift)
    assert len(lines) == 2 + len(lift["table"]) + len({record["group"] for record in lift["table"]})
    assert next(line for line in lines if line.startswith("| paper |")).startswith("| paper | 1.000 |  |")
    assert next(line for line in lines if line.startswith("| without height |")).startswith("| without height | - |")


def test_fallen_run_has_a_column_of_its_own(lift: dict[str, Any]):
    fallen = lift["runs"][0] | {"name": "fallen", "success": 0.0}
    nothing = {key: {name: np.zeros(3) for name in why.SCORES} for key in fallen["variants"]}
    ones = {key: {name: np.ones(3) for name in why.SCORES} for key in fallen["variants"]}
    runs = [fallen, lift["runs"][0]]
    lines = markdown({"runs": runs, "table": summarise(runs, [nothing, ones])})
    assert lines[0].endswith("| fallen |")
    assert lines[3].startswith("| paper | 1.000 |")
    assert lines[3].endswith("| .000 |")


def test_pictures_are_drawn(lift: dict[str, Any], tmp_path: Path):
    assert [path.stat().st_size > 10_000 for path in draw(lift, tmp_path)] == [True] * 3


def test_page_shows_the_table_as_it_was_measured():
    found = json.loads((ROOT / "benchmarks" / "why.json").read_text())
    assert "\n".join(markdown(found)) in (ROOT / "docs" / "QUALITY.md").read_text()


def test_all_that_is_written_goes_into_the_folder_that_is_asked_for(
    lift: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    run = lift["runs"][0]
    rows = {key: {name: np.full(3, 0.5) for name in why.SCORES} for key in run["variants"]}
    monkeypatch.setattr(why, "fly", lambda folder, episodes: f"{folder}, {episodes} flights")
    monkeypatch.setattr(why, "measure", lambda flown, *_: (run | {"name": flown}, rows))
    why.main(["one", "two", "--quick", "--output", str(tmp_path / "new")])
    found = json.loads((tmp_path / "new" / "why.json").read_text())
    assert [each["name"] for each in found["runs"]] == ["one, 10 flights", "two, 10 flights"]
    assert found["protocol"]["resamples"] == 20
    assert "\n".join(markdown(found)) in (tmp_path / "new" / "QUALITY.md").read_text()
    assert len([*(tmp_path / "new").glob("quality_why_*.png")]) == 3


def test_folder_without_a_policy_or_a_log_is_refused(tmp_path: Path):
    shutil.copytree(ROOT / "demo" / ".hydra", tmp_path / ".hydra")
    with pytest.raises(ConfigError, match=r"it has no policy yet; allowed is a finished run"):
        why.fly(tmp_path, 1)
    with pytest.raises(ValueError, match=r"trajectories is not a readable log"):
        why.fly(ROOT / "demo", 1)


def test_number_of_flights_is_checked_before_any(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        why.main(["demo", "--episodes", "0"])
    assert "--episodes=0: allowed is at least 1" in capsys.readouterr().err
