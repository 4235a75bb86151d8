"""The paper's claims counted over several runs, in paper.json files made by hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from benchmarks import paper, paper_report
from ibe_rl.storage.run_folder import read_json, write_json

MARKS = "<!-- paper: python -m benchmarks.paper -->\n{}<!-- end of paper -->\n"


def claim(holds: str | None) -> dict[str, str] | None:
    return None if holds is None else {"holds": holds}


def told(within: str | None, over_all: str | None) -> dict[str, Any]:
    return {"claim": {"within": claim(within), "all": claim(over_all), "left": None}}


def rates(straight: float, wrong: float | None = 0.1) -> dict[str, Any]:
    """To the left so often, to the right never called straight; so often the other way, to either side."""
    parts = {"straight_left": straight, "straight_right": 0.0, "wrong_left": wrong, "wrong_right": wrong}
    return {name: {"value": value} for name, value in parts.items()}


def trial(name: str, difference: float, p: float) -> dict[str, Any]:
    return {"explainer": name, "minus": "no_explanation", "difference": {"value": difference}, "p_corrected": p}


def cut(paper_says: float, ours: float, p: float = 0.01) -> dict[str, Any]:
    """How much smaller (below 0) the error is than 4 % without words, each with the same p."""
    errors = {"no_explanation": 4.0, "straight_down": 1.0, "paper": 4 + paper_says, "default": 4 + ours}
    tests = [{**trial("default", 9, 0), "minus": "paper"}, trial("default", ours, p), trial("paper", paper_says, p)]
    return {"error": {name: {"value": value} for name, value in errors.items()}, "tests": tests}


def outcome(kind: str = "ppo", near: bool = True, skew: float = 0.08, wrong: float | None = 0.1) -> dict[str, Any]:
    """As task=figures writes it, as far as it is counted: agent A has only claims, B all the rest."""
    words = {"paper": {"skew": skew}, "default": {"skew": -0.001}}
    shares = {"paper": rates(0.4, wrong), "paper_signs_kept": rates(0.6), "default": rates(0.0)}
    left, down, right = told("yes", "open"), told("no", "no"), told("yes", "no")
    return {
        "protocol": {"agent": kind},
        "agents": [{"name": "A", "near": near}, {"name": "B", "near": True}, {"name": "C", "near": True}],
        "preliminary": [{"agent": "A", "told": {"-1.0": left, "0.0": down, "1.0": right}}],
        "expressions": [{"agent": "B", "vocabularies": words}],
        "straight": [{"agent": "B", "rates": shares}],
        "prediction": [{"agent": "B", "cuts": {"end": cut(-3, -3.5), "contact": cut(1, -2)}}],
    }


def finish(run: Path, found: dict[str, Any] | None = None) -> Path:
    (run / "evaluation").mkdir(parents=True)
    write_json(run / "summary.json", {})
    if found is not None:
        write_json(run / "evaluation" / "paper.json", found)
    return run


@pytest.fixture
def two(tmp_path: Path) -> list[Path]:
    """Runs that differ in some of it."""
    other = outcome("dqn", near=False, skew=-0.02)
    other["preliminary"][0]["told"] |= {"-1.0": told(None, "yes"), "1.0": told("open", None)}
    other["prediction"][0]["cuts"]["contact"] = cut(3, -1, p=0.06)
    return [finish(tmp_path / "ppo0", outcome()), finish(tmp_path / "dqn0", other)]


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The experiments that would be done; each leaves its file."""
    found: list[list[str]] = []

    def run_command(command: list[str]) -> str:
        found.append(command[1:])
        write_json(Path(command[2].removeprefix("run=")) / "evaluation" / "paper.json", outcome())
        return ""

    monkeypatch.setattr(paper, "run_command", run_command)
    return found


def test_claims_are_counted_over_runs_and_agents(two: list[Path]):
    lines = paper_report.table([paper.read(run) for run in two])
    assert lines == [
        "| over one PPO and one DQN run | the paper | here |",
        "|---|---|---|",
        "| high-score episodes follow the instruction more | to the left yes, straight down yes; by eye | to a side: "
        "in 2 of 3 tests (the reverse in 0) among episodes with the same pad, in 1 of 3 tests (the reverse in 1) over "
        "all. Straight down: in 0 of 2 tests (the reverse in 2) among episodes with the same pad, in 0 of 2 tests "
        "(the reverse in 2) over all |",
        "| its clusters are skewed to the right | yes | in 1 of 2 vocabularies, mean expression +0.03 (-0.02 to "
        "+0.08); ours mean expression +0.00 (+0.00 to +0.00) |",
        "| small movements to a side are not named as such | one episode | in 30 %; with its clusters but without "
        "min-max 40 %; ours 10 % |",
        "| hearing it helps to predict where the lander comes down | 1 of 20 episodes better, 1 worse | to the end of "
        "the episode: with its words better in 2 of 2 cases, worse in 0; with ours better in 2 of 2 cases, worse in "
        "0. Mean error 4.0 % without words, 1.0 % expecting it straight down, 1.0 % with its words, 0.5 % with ours. "
        "To first contact: with its words better in 0 of 2 cases, worse in 1; with ours better in 1 of 2 cases, "
        "worse in 0. Mean error 4.0 % without words, 1.0 % expecting it straight down, 6.0 % with its words, 2.5 % "
        "with ours. |",
        "",
        "As good as the paper's agent, up to 8 points: A in 1 of 2 and B in 2 of 2 runs. In the other runs the "
        "nearest policy counts.",
    ]


def test_the_head_says_which_runs():
    def of(*agents: str) -> str:
        return paper_report.kinds([{"agent": agent} for agent in agents])

    assert of(*["ppo"] * 5, *["dqn"] * 5) == "five PPO and five DQN runs"
    assert of("dqn") == "one DQN run"
    assert of("ppo", "sac", "dqn", "ppo") == "two PPO, one SAC and one DQN run"
    assert of(*["ppo"] * 13) == "13 PPO runs"


def test_what_no_run_has_is_left_open(tmp_path: Path):
    none = outcome(wrong=None) | {"expressions": [], "prediction": []}
    text = "\n".join(paper_report.table([paper.read(finish(tmp_path / "ppo0", none))]))
    assert "| in 0 of 0 vocabularies, not known; ours not known |" in text
    assert "| no such movements |" in text
    assert "to the end of the episode: not known. To first contact: not known." in text


def test_the_page_is_untouched_elsewhere(two: list[Path], called: list[list[str]], tmp_path: Path):
    page, output = tmp_path / "out" / "PAPER.md", ["--output", str(tmp_path / "out")]
    page.parent.mkdir()
    page.write_text("above\n" + MARKS.format("old\n") + "below\n")
    lines = "\n".join(paper_report.table([paper.read(run) for run in two]))
    for report in ([], ["--report"]):
        paper.main([*map(str, two), *output, *report])
        assert page.read_text() == "above\n" + MARKS.format(f"\n{lines}\n\n") + "below\n"
    assert called == []
    runs = read_json(tmp_path / "out" / "paper.json")["runs"]
    assert [(run["run"], run["agent"]) for run in runs] == [("ppo0", "ppo"), ("dqn0", "dqn")]


def test_docs_has_a_place_for_the_table():
    before, _, rest = paper_report.PAGE.read_text().partition("<!-- paper: python -m benchmarks.paper -->")
    assert before.rstrip().endswith("it was.*")
    assert rest.partition("<!-- end of paper -->")[2].lstrip().startswith("What the paper leaves open there:")


def test_only_runs_that_lack_them_do_the_experiments(two: list[Path], called: list[list[str]], tmp_path: Path):
    """Those that never did them, and those that were trained since; a second time none."""
    later = (two[0] / "evaluation" / "paper.json").stat().st_mtime - 60
    os.utime(two[0] / "evaluation" / "paper.json", (later, later))
    runs = [*two, finish(tmp_path / "ppo1")]
    for _ in range(2):
        paper.main([*map(str, runs), "--quick", "--output", str(tmp_path / "out")])
    figures = ["task=figures", "viewer=off", *paper.FEW_FIGURES]
    assert called == [["explain.py", f"run={run}", *figures] for run in (runs[0], runs[2])]


def test_all_episodes_are_flown_by_default(called: list[list[str]], tmp_path: Path):
    run = finish(tmp_path / "ppo1")
    paper.main([str(run), "--output", str(tmp_path)])
    assert called == [["explain.py", f"run={run}", "task=figures", "viewer=off"]]


def test_a_report_of_a_run_without_experiments_is_refused(tmp_path: Path):
    run = finish(tmp_path / "ppo0")
    path = run / "evaluation" / "paper.json"
    allowed = rf"allowed is what explain\.py run={run} task=figures writes$"
    with pytest.raises(SystemExit, match=rf"^{path}: not there; {allowed}"):
        paper.main(["--report", str(run), "--output", str(tmp_path)])
    write_json(path, outcome())
    os.utime(path, (1, 1))
    with pytest.raises(SystemExit, match=rf"^{path}: older than the training; {allowed}"):
        paper.main(["--report", str(run), "--output", str(tmp_path)])
    assert not (tmp_path / "PAPER.md").exists()


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("agents", None, "TypeError: 'NoneType' object is not iterable"),
        ("protocol", {}, "KeyError: 'agent'"),
        (
            "preliminary",
            [{"agent": "A", "told": {"0.0": told("maybe", None)}}],
            "ValueError: holds=maybe, not one of yes",
        ),
        ("preliminary", [{"agent": "A", "told": []}], "AttributeError: 'list' object has no attribute 'items'"),
        ("prediction", [{"agent": "B", "cuts": {"end": cut(1, 1) | {"tests": []}}}], "StopIteration: "),
    ],
)
def test_a_damaged_file_is_refused(key: str, value: Any, why: str, tmp_path: Path):
    path = finish(tmp_path / "ppo0", outcome() | {key: value}) / "evaluation" / "paper.json"
    with pytest.raises(SystemExit) as refused:
        paper.read(tmp_path / "ppo0")
    assert str(refused.value).startswith(f"{path}: damaged ({why}")
    assert str(refused.value).endswith(f"task=figures writes; to have it made again: rm {path}")


def test_a_file_that_is_no_json_is_refused(tmp_path: Path):
    run = finish(tmp_path / "ppo0")
    (run / "evaluation" / "paper.json").write_text('{"agents": [')
    with pytest.raises(SystemExit, match=r"paper\.json: damaged \(JSONDecodeError: "):
        paper.read(run)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["RUN", "--quick"], "--quick: allowed with --output=FOLDER, its figures mean nothing"),
        (["RUN", "RUN"], "allowed is each run once"),
        (["RUN/evaluation"], "evaluation: allowed is the folder of a finished run (it has no summary.json)"),
        ([], "the following arguments are required: RUN"),
    ],
)
def test_other_requests_are_refused(
    arguments: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    run = finish(tmp_path / "ppo0")
    with pytest.raises(SystemExit):
        paper.main([one.replace("RUN", str(run)) for one in arguments])
    assert expected in capsys.readouterr().err
