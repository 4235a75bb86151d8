"""What docs/OWN_AGENT.md and docs/OWN_LOG.md show works as it stands there."""

import re
import shlex
from pathlib import Path
from typing import Any

import pilots
import pytest
import torch
from processes import ROOT, call

from ibe_rl.api.explained import ExplainedAgent
from ibe_rl.apps import minari as minari_log

AGENT, LOG = ((ROOT / "docs" / f"OWN_{name}.md").read_text() for name in ("AGENT", "LOG"))
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
    three, more, weights, function, answer = blocks(AGENT)
    names: dict[str, Any] = {}
    assert len([line for line in three.splitlines() if line]) == 3
    exec(quickly(three), names)  # noqa: S102 - our own page
    exec(more, names)  # noqa: S102 - our own page
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
