"""All that the documents' tables need by one command: what it calls, what it leaves out, and one training for real."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from view_data import eventually

from benchmarks import documents, instruction, robustness, tutorial
from benchmarks.plan import ROOT
from ibe_rl.apps.sweep.jobs import Job

TEN = [f"{agent}{seed}" for agent in ("ppo", "dqn") for seed in range(5, 10)]


def finish(run: Path, **summary: object) -> Path:
    run.mkdir(parents=True, exist_ok=True)
    (run / "summary.json").write_text(json.dumps(summary))
    return run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Of ten finished runs, as far as anybody asks here."""
    for name in TEN:
        finish(tmp_path / "runs" / name)
    return tmp_path / "runs"


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands that would be called."""
    found: list[list[str]] = []
    monkeypatch.setattr(documents, "call", lambda *command: found.append([*command]))
    return found


def test_each_step_is_called_with_its_runs(
    folder: Path, called: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for module in (instruction, robustness, tutorial):
        name = module.RESULTS.name
        monkeypatch.setattr(module, "RESULTS", tmp_path / name)
        made = folder / name.removesuffix(".json") / name
        made.parent.mkdir()
        made.write_text(f"trained anew: {name}")
    documents.main(["--folder", str(folder)])
    ten, few = [str(folder / name) for name in TEN], [str(folder / f"ppo{seed}") for seed in range(5, 8)]
    flawed, taught, others = (["-m", f"benchmarks.{name}"] for name in ("robustness", "instruction", "tutorial"))
    assert called == [
        ["-m", "benchmarks.truth", *ten],
        ["-m", "benchmarks.why", *ten],
        [*flawed, "--missing", "--anew", "--runs", *few, "--output", str(folder / "robustness")],
        [*flawed, "--report"],
        ["-m", "benchmarks.words", "--missing", *few],
        [*taught, "--missing", "--output", str(folder / "instruction")],
        [*taught, "--report"],
        [*others, "--missing", "--output", str(folder / "tutorial")],
        [*others, "--report"],
        ["-m", "benchmarks.paper", *ten],
    ]
    for name in ("robustness.json", "instruction.json", "tutorial.json"):
        assert (tmp_path / name).read_text() == f"trained anew: {name}"


def test_a_tiny_one_writes_nothing_into_the_repository(folder: Path, called: list[list[str]], tmp_path: Path):
    """Words cannot be learnt from it."""
    documents.main(["--quick", "--output", str(tmp_path), "--agents", "ppo", "--seeds", "9"])
    run, output = str(folder / "ppo9"), ["--output", str(tmp_path)]
    few = ["--quick", "--corruptions", "1", "--episodes", "3"]
    tiny = ["--quick", "--seeds", "0", "--only", "the tutorial's"]
    assert called == [
        ["-m", "benchmarks.truth", run, *output, "--quick"],
        ["-m", "benchmarks.why", run, *output, "--quick"],
        ["-m", "benchmarks.robustness", "--missing", "--anew", "--runs", run, *output, *few],
        ["-m", "benchmarks.instruction", "--missing", *output, "--quick", "--seeds", "0"],
        ["-m", "benchmarks.tutorial", "--missing", *output, *tiny],
        ["-m", "benchmarks.paper", run, *output, "--quick"],
    ]
    called.clear()
    documents.main(["--only", "words", "--output", str(tmp_path)])
    few = [str(folder / f"ppo{seed}") for seed in range(5, 8)]
    assert called == [["-m", "benchmarks.words", "--missing", *few, *output]]


def test_steps_are_told_and_done_in_their_order(
    folder: Path, called: list[list[str]], capsys: pytest.CaptureFixture[str]
):
    documents.main(["--folder", str(folder), "--only", "paper", "truth"])
    assert [command[1] for command in called] == ["benchmarks.truth", "benchmarks.paper"]
    assert capsys.readouterr().out.splitlines() == [
        "truth: are the words true? docs/QUALITY.md",
        "paper: the paper's experiments, docs/PAPER.md",
    ]


@pytest.mark.parametrize(
    ("step", "name"), [("truth", "dqn8"), ("why", "dqn5"), ("robustness", "ppo7"), ("words", "ppo6"), ("paper", "dqn9")]
)
def test_runs_that_are_not_finished_are_refused(folder: Path, called: list[list[str]], step: str, name: str):
    finish(folder / name, stopped_early=True)
    with pytest.raises(SystemExit, match=rf"{name}: not a finished run; allowed is one .*\(--only train\)$"):
        documents.main(["--folder", str(folder), "--only", step])
    assert called == []


def test_a_command_that_fails_is_named():
    documents.call("-c", "pass")
    with pytest.raises(SystemExit, match=r"^-c 'raise SystemExit\(3\)' ended with 3; the same command goes on"):
        documents.call("-c", "raise SystemExit(3)")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--quick"], "--quick: allowed with --output=FOLDER, its figures mean nothing"),
        (["--at-once", "0"], "--at-once=0: allowed is at least 1"),
        (["--only", "tables"], "invalid choice: 'tables'"),
    ],
)
def test_other_requests_are_refused(arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        documents.main(arguments)
    assert expected in capsys.readouterr().err


def test_a_training_is_begun_or_resumed(tmp_path: Path):
    job = Job("ppo3", tmp_path / "ppo3", ("agent=ppo", "seed=3"), 1)
    train = [sys.executable, str(ROOT / "train.py")]
    assert documents.training(job, False) == [*train, "agent=ppo", "seed=3", f"run_dir={job.folder}", "viewer=off"]
    assert documents.training(job, True) == [*train, f"resume={job.folder}", "viewer=off"]


FINISHES = "import sys; open(sys.argv[1] + '/summary.json', 'w').write('{}')"


@pytest.mark.slow
def test_only_what_is_not_finished_is_trained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    started: list[tuple[str, tuple[str, ...], bool]] = []

    def training(job: Job, goes_on: bool) -> list[str]:
        started.append((job.name, job.overrides, goes_on))
        return [sys.executable, "-c", FINISHES, str(job.folder)]

    monkeypatch.setattr(documents, "training", training)
    finish(tmp_path / "ppo0")
    (tmp_path / "dqn1" / "checkpoints").mkdir(parents=True)
    (tmp_path / "dqn1" / "checkpoints" / "latest.pt").touch()
    asked = ["--folder", str(tmp_path), "--only", "train", "--seeds", "0", "1"]
    for _ in range(2):
        documents.main(asked)
    in_one = ("collect.processes=1", "collect.envs_per_process=128")
    assert started == [
        ("ppo1", ("agent=ppo", "seed=1", *in_one), False),
        ("dqn0", ("agent=dqn", "seed=0"), False),
        ("dqn1", ("agent=dqn", "seed=1"), True),
    ]


@pytest.mark.slow
def test_a_training_that_fails_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(documents, "training", lambda *_: [sys.executable, "-c", "raise SystemExit('no room')"])
    with pytest.raises(SystemExit, match=r"^failed: ppo0: no room\n  what it printed: .*output.log$"):
        documents.main(["--folder", str(tmp_path), "--agents", "ppo", "--seeds", "0"])


@pytest.mark.slow
def test_a_killed_training_is_taken_up_and_then_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    run = tmp_path / "runs" / "dqn1"
    job = Job(run.name, run, ("agent=dqn", "seed=1", *documents.QUICK["dqn"]), 1)
    with subprocess.Popen(documents.training(job, False), stdout=subprocess.DEVNULL) as process:
        assert eventually(lambda: (run / "metrics.csv").exists() or process.poll() is not None, 120)
        process.kill()
    assert not (run / "summary.json").exists()
    asked = ["--quick", "--output", str(tmp_path), "--only", "train", "--agents", "dqn", "--seeds", "1"]
    documents.main(asked)
    summary = json.loads((run / "summary.json").read_text())
    assert (summary["agent"], summary["seed"]) == ("dqn", 1)
    assert summary["frames"] >= 6000
    assert "resuming at " in (run / "output.log").read_text()
    capsys.readouterr()
    documents.main(asked)
    assert "dqn1: finished earlier, left as it is" in capsys.readouterr().out
    assert json.loads((run / "summary.json").read_text()) == summary
