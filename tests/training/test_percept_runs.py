"""Trainings where the agent does not perceive the state; taken up again they go on number for number."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import METRICS, REFRESHES, MetricsTable, read_rows

WALKER = """
id: walker:Walker-v0
kwargs: {obs: tuple}
task:
  name: Walker
  state: walker:place_and_speed
  rule: walker:to_middle
  state_names: [x, v]
  explained: [x]
  explained_band: [0.1]
  phrases:
    - {zero: staying, negative: "going {degree}left", positive: "going {degree}right"}
"""
RUN = [
    *("--config-dir", "mine", *SMALL, "env=walker", "viewer=off", "total_frames=3000", "collect.steps_per_batch=40"),
    *("mapping.horizon_steps=5", "mapping.spans_steps=[3]", "checkpoint_every_frames=700", "env.kwargs.obs=image"),
]
AGENTS = {
    "mixed": ["agent=ppo", "agent.minibatch_size=64", "agent.standardise_observations=true"],
    "image": ["agent=ppo", "agent.minibatch_size=128", "agent.epochs=1", "agent.standardise_rewards=true"],
    "tuple": ["agent=ppo", "agent.minibatch_size=64", "predictor=ensemble", "predictor.updates=5"],
}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mine/env").mkdir(parents=True)
    (tmp_path / "mine/env/walker.yaml").write_text(WALKER)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def rows(folder: str) -> list[dict[str, str]]:
    table = read_rows(Path(folder) / METRICS)
    return [{name: value for name, value in row.items() if not name.startswith("time/")} for row in table]


def interrupted(monkeypatch: pytest.MonkeyPatch, *settings: str) -> None:
    """A training that ends with an error in the middle of its episodes, after its last checkpoint."""
    write = MetricsTable.write

    def fail(table: MetricsTable, row: Any) -> None:
        if row["frames"] > 2300:
            raise OSError("no space")
        write(table, row)

    with monkeypatch.context() as patch:
        patch.setattr(MetricsTable, "write", fail)
        with pytest.raises(BaseException, match="no space"):
            call("train", *settings)


@pytest.mark.slow
@pytest.mark.parametrize("obs", AGENTS)
def test_a_run_taken_up_is_the_uninterrupted_one(obs: str, monkeypatch: pytest.MonkeyPatch):
    settings = [*RUN, f"env.kwargs.obs={obs}", *AGENTS[obs]]
    call("train", *settings, "run_dir=whole")
    interrupted(monkeypatch, *settings, "run_dir=run")
    call("train", "--config-dir", "mine", "resume=run")
    assert rows("run") == rows("whole")
    assert float(rows("whole")[-1]["ibe/policy_drift"]) >= 0
    logs = [TrajectoryLog.open(Path(name) / "trajectories") for name in ("whole", "run")]
    for one, other in zip(*(log.read(range(len(log.index)), percepts=True) for log in logs), strict=True):
        assert one.percepts is not None
        assert other.percepts is not None
        np.testing.assert_array_equal(one.percepts, other.percepts)
    for path in sorted(Path("whole", REFRESHES).glob("*.json")):
        assert path.read_text() == Path("run", REFRESHES, path.name).read_text()
    summary = json.loads(Path("run/summary.json").read_text())
    assert (
        summary["standardised"] == {"mixed": ["observations"], "image": ["observations", "rewards"], "tuple": []}[obs]
    )
    call("explain", "--config-dir", "mine", "run=run", "viewer=off")


@pytest.mark.parametrize(
    ("settings", "refusal"),
    [
        (["agent.ignores=[x]"], r"agent\.ignores=\['x'\] with env\.task\.state: allowed is \[\]"),
        (["predictor=ensemble"], r"predictor=ensemble: the agent perceives an image"),
        (
            ["log.capacity_frames=60000000"],
            r"log\.capacity_frames=60000000: .* 144 numbers it takes 9 GB; allowed is at",
        ),
        (
            ["collect.steps_per_batch=100000", "collect.envs_per_process=64"],
            r"collect\.steps_per_batch=100000: .* 7 GB",
        ),
        (["agent=dqn", "agent.buffer_frames=40000000"], r"agent\.buffer_frames=40000000: .* 12 GB"),
    ],
)
def test_what_images_do_not_allow_is_refused(
    settings: list[str], refusal: str, place: Path, capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit) as ended:
        call("train", *RUN, *settings, "run_dir=run")
    assert re.search(refusal, f"{ended.value} {capsys.readouterr().err}")
    assert not (place / "run").exists()
