"""What the scripts refuse, in one line and before anything is lost."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import SMALL, call


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        yield int(holder.getsockname()[1])


BAD = {
    "misspelt": (["mapping.n_clustrs=4"], ["mapping.n_clustrs", "n_clusters"]),
    "unknown key": (["colour=red"], ["colour", "total_frames"]),
    "added key": (["+mapping.colour=red"], ["mapping.colour", "n_clusters"]),
    "other agent's key": (["agent=dqn", "agent.clip=0.1"], ["agent.clip", "epsilon_end"]),
    "unknown choice": (["agent=sarsa"], ["agent=sarsa", "dqn, ppo"]),
    "unknown mapping": (["mapping=magic"], ["mapping=magic", "paper"]),
    "not a number": (["mapping.horizon_steps=abc"], ["mapping.horizon_steps", "abc"]),
    "nothing on top": (["mapping.top_fraction=0"], ["mapping.top_fraction=0", "at most 1"]),
    "more than all": (["mapping.top_fraction=1.5"], ["mapping.top_fraction=1.5", "at most 1"]),
    "one cluster": (["mapping.n_clusters=1"], ["mapping.n_clusters=1", "at least 2"]),
    "no horizon": (["mapping.horizon_steps=0"], ["mapping.horizon_steps=0", "at least 1"]),
    "too long a horizon": (["mapping.horizon_steps=1001"], ["mapping.horizon_steps=1001", "at most 1000"]),
    "unknown dimension": (["mapping.dimensions=[height]"], ["mapping.dimensions=['height']", "angle"]),
    "words turn elsewhere": (
        ["mapping.dimensions=[angle]"],
        ["mapping.dimensions=['angle']", "it reads x, goal_x; allowed is [], or mapping=lasso"],
    ),
    "no newest frames": (["mapping.newest_frames=0"], ["mapping.newest_frames=0", "at least 1"]),
    "no span": (["mapping.spans_steps=[20,0]"], ["mapping.spans_steps=[20, 0]", "at least 1 and at most 1000"]),
    "movement without an axis": (
        ["mapping=paper", "mapping.normalisation=movement"],
        ["mapping.normalisation=movement", "minmax, sign"],
    ),
    "halving with memory": (["mapping.split=bisecting"], ["mapping.memory=0.5", "allowed is null"]),
    "a space that is none": (["mapping.space=outer"], ["mapping.space=outer", "network, rule"]),
    "memory without end": (["mapping.memory=1"], ["mapping.memory=1.0", "at most 0.99"]),
    "less than no memory": (["mapping.memory=-0.1"], ["mapping.memory=-0.1", "at least 0"]),
    "anything survives": (["mapping.survival_overlap=0"], ["mapping.survival_overlap=0", "above 0 and at most 1"]),
    "nothing survives": (["mapping.survival_overlap=1.1"], ["mapping.survival_overlap=1.1", "at most 1"]),
    "held backwards": (["mapping.hold_within=-0.1"], ["mapping.hold_within=-0.1", "at least 0 and at most 2"]),
    "held for ever": (["mapping.hold_within=2.5"], ["mapping.hold_within=2.5", "at most 2"]),
    "never stale": (["refresh_when_stale=1.5"], ["refresh_when_stale=1.5", "at least -1 and at most 1"]),
    "stale is no number": (["refresh_when_stale=often"], ["refresh_when_stale", "often"]),
    "a setting that is gone": (["mapping.warm_start=true"], ["mapping.warm_start", "memory"]),
    "unknown environment": (["env.id=Mars-v0"], ["env.id=Mars-v0", "ibe_rl/LunarLanderPads-v0"]),
    "other environment": (["env.id=CartPole-v1"], ["env.id=CartPole-v1", "'pad'"]),
    "wrong pad": (["env.kwargs.pad=middle"], ["env.kwargs", "middle", "center"]),
    "stale without a look": (
        ["refresh_every_frames=null", "refresh_when_stale=0.1"],
        ["refresh_when_stale=0.1", "allowed is null"],
    ),
    "surer than sure": (["min_confidence=1.1"], ["min_confidence=1.1", "at least 0 and at most 1"]),
    "no future": (["predictor.futures=0"], ["predictor.futures=0", "at least 1 and at most 100"]),
    "wrong viewer": (["viewer=tv"], ["viewer=tv", "file, live, off"]),
    "ahead of nothing": (["collect.ahead_batches=3"], ["collect.ahead_batches=3", "collect.overlap=false", "is 1, or"]),
    "blind to what is not there": (["agent.ignores=[goal]"], ["agent.ignores=goal:", "goal_x"]),
    "obeying nobody": (
        ["instructor=silent", "obedience.judge=oracle"],
        ["obedience.judge=oracle", "instructor=silent"],
    ),
    "taught in two places": (["instructor=human", "collect.processes=2"], ["collect.processes=2", "instructor=human"]),
    "taught by nobody": (["instructor=recorded", "instructor.recording=no_run"], ["recording=no_run", "lesson.jsonl"]),
    "no such port": (["viewer=live", "viewer.web_port=70000"], ["viewer.web_port=70000", "65535"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings_end_in_one_line_before_anything_is_made(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    overrides, expected = BAD[case]
    with pytest.raises(SystemExit) as stopped:
        call("train", f"run_dir={tmp_path / 'run'}", *overrides)
    message = str(stopped.value.code)
    assert message.startswith("error: ")
    assert "\n" not in message
    for part in expected:
        assert part in message
    assert not (tmp_path / "run").exists()
    assert capsys.readouterr().err == ""


def test_a_port_asked_for_by_number_and_taken_is_refused(taken_port: int, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=f"viewer.grpc_port={taken_port}: taken"):
        call("train", f"run_dir={tmp_path / 'run'}", "viewer=live", f"viewer.grpc_port={taken_port}")


def test_a_folder_that_holds_a_run_is_left_alone(run: Path) -> None:
    before = (run / "metrics.csv").read_bytes(), (run / ".hydra" / "config.yaml").read_bytes()
    with pytest.raises(SystemExit, match="holds a run already"):
        call("train", *SMALL, f"run_dir={run}", "viewer=off")
    assert before == ((run / "metrics.csv").read_bytes(), (run / ".hydra" / "config.yaml").read_bytes())


@pytest.mark.parametrize("extra", [[], ["-m", "seed=0,1"]])
def test_a_folder_that_cannot_be_written_is_refused(extra: list[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(SystemExit, match=r"error: run_dir=.*can be written to"):
        call("train", *extra, f"run_dir={tmp_path / 'file' / 'run'}", "viewer=off")


@pytest.mark.parametrize("setting", ["runs_at_once=2", "runs_on=there:1"])
def test_a_setting_of_sweeps_is_refused_for_one_run(setting: str, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=rf"error: .*{setting}.*: allowed only in a sweep \(-m\)"):
        call("train", setting, f"run_dir={tmp_path / 'run'}", "viewer=off")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["run=nowhere"], "run=nowhere: not a run folder"),
        (["context=middle"], "context=middle: allowed is one of left, center, right"),
        (["task=dance"], "task=dance: allowed is one of episode, evaluate, compare"),
        (["task=evaluate", "evaluate.episodes=1"], "evaluate.episodes=1: allowed is at least 2 and at most 10000"),
        (
            ["task=evaluate", "evaluate.horizons_steps=[20,0]"],
            r"evaluate.horizons_steps=\[20, 0\]: allowed is at least 1",
        ),
        (["task=evaluate", "evaluate.episods=2"], "evaluate.episods: no such setting; allowed are .*episodes"),
        (["task=compare", "compare.mappings=[magic]"], r"compare.mappings=\['magic'\]: allowed are .*paper"),
        (["pad=left"], "pad: no such setting; allowed are .*context"),
        (["min_confidence=-0.1"], "min_confidence=-0.1: allowed is at least 0 and at most 1"),
        (["predictor.futures=0"], "predictor.futures=0: allowed is at least 1 and at most 100"),
        (["task=evaluate", "+evaluate.futures=2"], "evaluate.futures=2: no such setting; allowed are .*episodes"),
        (["output=/dev/null/x.rrd"], "output=/dev/null/x.rrd: allowed is a file that can be written"),
    ],
)
def test_explain_refuses_in_one_line(run: Path, overrides: list[str], expected: str) -> None:
    given = overrides if overrides[0].startswith("run=") else [f"run={run}", *overrides]
    with pytest.raises(SystemExit, match=f"^error: {expected}"):
        call("explain", *given)


@pytest.mark.parametrize("task", ["evaluate", "compare", "predictors"])
def test_a_run_without_a_log_is_not_judged(task: str, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("trajectories"))
    with pytest.raises(SystemExit, match=r"^error: run=.*: it has no log \(trajectories/\) to learn other vocab"):
        call("explain", f"run={tmp_path / 'run'}", f"task={task}")
    assert not (tmp_path / "run" / "evaluation").exists()


@pytest.mark.parametrize("task", ["evaluate", "compare"])
def test_a_run_without_a_vocabulary_is_not_judged(task: str, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("*.json"))
    with pytest.raises(SystemExit, match=r"^error: run=.*: it has no vocabulary from before its policy"):
        call("explain", f"run={tmp_path / 'run'}", f"task={task}")
