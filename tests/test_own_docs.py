"""What docs/OWN_AGENT.md, docs/OWN_LOG.md and the Python of API.md and OWN_ENVIRONMENT.md show works as it stands."""

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pilots
import pytest
import torch
from gates import task
from processes import ROOT, call

from ibe_rl.api.explained import ExplainedAgent
from ibe_rl.apps import minari as minari_log
from ibe_rl.types import Episode

API = (ROOT / "docs" / "API.md").read_text().partition("<!-- From here on generated")[0]
AGENT, LOG, ENVIRONMENT = ((ROOT / "docs" / f"OWN_{name}.md").read_text() for name in ("AGENT", "LOG", "ENVIRONMENT"))
FEW = """viewer="off", total_frames=2_048, refresh_every_frames=2_048, eval_episodes=2,
    collect={"processes": 1, "envs_per_process": 8, "steps_per_batch": 128}, log={"capacity_frames": 10_000},
    mapping={"horizon_steps": 5, "spans_steps": []}"""
"""In place of ``viewer="off"``."""
QUICK = ["mapping.horizon_steps=20", "mapping.spans_steps=[10]", "predictor.futures=1", "viewer=off"]


def blocks(text: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def commands(text: str) -> list[list[str]]:
    """Indented lines, without what stands behind #."""
    return [shlex.split(line, comments=True) for line in re.findall(r"^    (python .*)$", text, re.MULTILINE)]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as a reader has it: a model of their own, nothing else; and all is smaller and quicker."""
    pilots.trained("PPO").save(tmp_path / "model.zip")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def quickly(code: str) -> str:
    """The same with few and short episodes."""
    quick = f"episodes=12, settings={QUICK}"
    return re.sub(r"(ibe_rl\.explain_agent\([^\n]*)\)\n", rf"\1, {quick})\n", code)


def test_the_lines_of_python_run(place: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    judged: list[ExplainedAgent] = []
    monkeypatch.setattr(ExplainedAgent, "evaluate", lambda self: judged.append(self))  # test_explaining.py judges it
    first, weights, function, answer = blocks(AGENT)
    names: dict[str, Any] = {}
    assert [line for line in first.splitlines() if line].index("print(explained.explain(seed=3))") == 2
    exec(quickly(first), names)  # noqa: S102 - our own page
    assert judged == [names["explained"]]
    assert (place / "runs" / "mine" / "refreshes").is_dir()
    assert "of the next 20 steps went as predicted" in capsys.readouterr().out
    torch.manual_seed(0)
    layers = [torch.nn.Linear(9, 64), torch.nn.Tanh(), torch.nn.Linear(64, 4)]
    torch.save(torch.nn.Sequential(*layers).state_dict(), place / "policy.pt")
    exec(quickly(weights), names)  # noqa: S102 - our own page
    assert names["explained"].run.config.agent.made_from == "function"
    exec(quickly(function), names)  # noqa: S102 - our own page
    assert names["explained"].run.config.agent.sees_instruction is False
    exec(answer, names)  # noqa: S102 - our own page
    assert names["model"].observation_space.shape == (11,)
    [log] = blocks(LOG)
    exec(log, names)  # noqa: S102 - our own page
    assert names["dataset"].total_episodes == 12
    assert (place / names["folder"] / "refreshes").is_dir()


def test_the_programs_that_train_run(place: Path, capsys: Any) -> None:
    train, _ = blocks(API)
    exec(re.sub("total_frames=[0-9_]+, ", "", train).replace('viewer="off"', FEW), {})  # noqa: S102 - our own page
    assert "vocabulary of frame 2,048" in " ".join(capsys.readouterr().out.split())
    own = blocks(ENVIRONMENT.partition("## In Python, without a file")[2])[0].replace("runs/mine", "runs/own")
    names = {"TASK": task(state_names=("x", "vx", "angle", "turning"), state_units=("", "", "", ""))}
    exec(own.replace('viewer="off"', FEW), names)  # noqa: S102 - our own page
    assert isinstance(names["explained"], ExplainedAgent)
    assert {path.name for path in (place / "runs").iterdir()} == {"mine", "own"}


def wandering(seed: int) -> Episode:
    """A point that is told to come to 0, and does on the whole."""
    random, x = np.random.default_rng(seed), [0.0]
    x[0] = random.uniform(-2, 2)
    for _ in range(40):
        x.append(0.93 * x[-1] + random.normal(0, 0.08))
    states = np.stack([x, random.normal(size=41)], axis=1)
    wanted = np.where(states[:-1, :1] > 0.2, -1.0, np.where(states[:-1, :1] < -0.2, 1.0, 0.0))
    rewards = -np.abs(states[1:, 0])
    return Episode(states, np.zeros(40, int), rewards, wanted, np.ones(40, bool), False, success=False, context="")


def test_the_vocabulary_is_one_on_plain_arrays() -> None:
    episodes = [wandering(seed) for seed in range(40)]
    names: dict[str, Any] = {
        "episodes": episodes,
        "delta_states": np.concatenate([one.states[5:] - one.states[:-5] for one in episodes]),
        "instructions": np.concatenate([one.instructions[:36, 0] for one in episodes]),
        "states": np.concatenate([one.states[:-1] for one in episodes]),
        "state_instructions": np.concatenate([one.instructions[:, 0] for one in episodes]),
        "new_delta_states": np.array([[-1.0, 0.0], [1.0, 0.0]]),
    }
    _, arrays = blocks(API)
    exec(arrays, names)  # noqa: S102 - our own page
    left, right = names["axis"].predict(names["new_delta_states"])
    assert left < 0 < right
    assert names["axis"].meanings_[0].known


def test_the_commands_run(place: Path, capsys: Any) -> None:
    first, again, judged = commands(AGENT)
    call("explain", *first[2:], "episodes=12", "run_dir=runs/NAME", *QUICK)
    call("explain", *again[2:], *QUICK[2:])
    assert judged[2:] == [*again[2:4], "task=evaluate"]
    export, imported, explained, of_parts, of_file = commands(LOG)
    for command in (of_parts, of_file):
        assert command[:4] == ["python", "-m", "ibe_rl.apps.minari", "import"]  # test_minari.py, test_arrays.py
    assert (export[:3], imported[:3]) == (["python", "-m", "ibe_rl.apps.minari"],) * 2
    assert minari_log.minari_command(export[3:]) == 0
    assert minari_log.minari_command([*imported[3:], *QUICK]) == 0
    assert (place / "runs" / "imported" / "refreshes").is_dir()
    assert explained[2:] == ["run=runs/imported", "agent=model.zip"]
    assert "mine/log-v0: 12 episodes" in capsys.readouterr().out


def test_the_files_they_link_to_are_there() -> None:
    for page in (AGENT, LOG):
        for name, section in re.findall(r"\]\((?!http)([^)#]*)#?([^)]*)\)", page):
            text = (ROOT / "docs" / name).read_text() if name else page
            headings = {
                re.sub(r"[^\w -]", "", line).lower().replace(" ", "-") for line in re.findall(r"^#+ (.*)", text, re.M)
            }
            assert not section or section in headings, (name, section)
