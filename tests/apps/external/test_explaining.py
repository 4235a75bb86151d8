"""An agent that was trained elsewhere plays, its words are learnt, and it explains itself: in Python and by command."""

import re
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pilots
import pytest
from processes import ROOT, call

import ibe_rl
from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.api.explained import ExplainedAgent, explain_agent, open_run
from ibe_rl.apps.external import explaining as own_agent
from ibe_rl.config.settings import InstructorConfig, ViewerConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.evaluation.runs import load_run
from ibe_rl.metrics.quality import phrase_accuracy, phrase_hits
from ibe_rl.metrics.verdict import WORST_FIRST
from ibe_rl.predict.ensemble import EnsembleConfig
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import read_json
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.reactions import ASKED_AT

QUICK = ["mapping.horizon_steps=20", "mapping.spans_steps=[10]", "predictor.futures=1", "viewer=off"]
JUDGED = [
    "evaluate.spoken_episodes=0",
    "evaluate.episodes=3",
    "evaluate.calibration_episodes=2",
    "evaluate.stride_steps=40",
    "evaluate.shuffles=1",
]
JUDGED += ["evaluate.resamples=20", "evaluate.horizons_steps=[20]", "predictor.processes=1"]


@pytest.fixture(scope="module")
def explained(tmp_path_factory: pytest.TempPathFactory) -> ExplainedAgent:
    folder = tmp_path_factory.mktemp("guests") / "pilot"
    settings = [*QUICK, *JUDGED]
    return explain_agent(
        pilots.pilot, "lander", episodes=24, agent_sees_instruction=False, run_dir=folder, settings=settings
    )


def test_agents_explained_in_the_same_second_have_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    now = datetime(2026, 11, 28, 10, 0, 0, tzinfo=UTC)
    monkeypatch.setattr("ibe_rl.api.explained.datetime", Mock(now=lambda: now))
    asked = {"episodes": 12, "agent_sees_instruction": False, "settings": [*QUICK, *JUDGED]}
    first, second = (explain_agent(pilots.pilot, "lander", **asked).run.folder for _ in range(2))
    assert first.parent == Path("runs")
    assert second == first.with_name(f"{first.name}_2")


def test_its_episodes_are_logged_with_what_the_rule_says_beside_it(explained: ExplainedAgent) -> None:
    log = TrajectoryLog.open(explained.run.folder / "trajectories")
    episodes = log.read(range(24))
    assert len(log.index) == len(episodes) == 24
    for episode in episodes:
        np.testing.assert_array_equal(episode.instructions, LANDER_TASK.rule(episode.states[:-1]))
        assert episode.given.all()
        assert [pilots.pilot(state) for state in episode.states[:20]] == episode.actions[:20].tolist()
    assert len({episode.states[0].tobytes() for episode in episodes}) == 24
    summary = read_json(explained.run.folder / "summary.json")
    assert (summary["agent"], summary["episodes"], summary["frames"]) == ("guest", 24, log.frames)
    assert summary["success_rate"] == np.mean([episode.success for episode in episodes])


def test_the_words_mean_what_the_instructor_means(explained: ExplainedAgent) -> None:
    left, right = (np.zeros((1, 9)) for _ in range(2))
    left[0, 0], right[0, 0] = -0.3, 0.3
    assert explained.run.mapping.express(left) < -0.5
    assert explained.run.mapping.express(right) > 0.5
    assert explained.run.mapping_frame == explained.run.policy_frame
    assert (explained.run.horizon_steps, list(explained.run.spans)) == (20, [10])


def test_an_agent_that_reads_no_instruction_does_not_react_to_one(explained: ExplainedAgent) -> None:
    reactions = explained.run.reactions
    assert reactions is not None
    count, *shape = reactions.up.shape
    assert shape == [1, 9]
    assert 1 <= count <= ASKED_AT
    assert not reactions.up.any()
    assert not reactions.down.any()


def test_an_agent_that_obeys_reacts_where_nothing_has_to_be_learnt_first(explained: ExplainedAgent) -> None:
    episodes = TrajectoryLog.open(explained.run.folder / "trajectories").read(range(3))
    config = explained.run.config
    reactions = own_agent._reactions(pilots.obedient, config, episodes, 20)
    assert reactions is not None
    assert (reactions.up[:, 0, 0] - reactions.down[:, 0, 0]).mean() > 0.01  # an engine to the right, or to the left
    again = own_agent._reactions(pilots.obedient, config, episodes, 20)
    assert again is not None
    np.testing.assert_array_equal(again.up, reactions.up)
    assert own_agent._reactions(pilots.obedient, replace(config, predictor=EnsembleConfig()), episodes, 20) is None


def test_how_sure_it_is_is_calibrated_from_the_start(explained: ExplainedAgent) -> None:
    """On episodes that the words were not learnt from, and kept with them."""
    calibration = explained.run.calibration
    assert calibration is not None
    assert all(one.calibrated for one in explained.explain(seed=5).said)
    opened = open_run(explained.run.folder, pilots.pilot, QUICK).run
    assert opened.calibration is not None
    assert opened.calibration.to_dict() == calibration.to_dict()
    assert opened.mapping.to_dict() == explained.run.mapping.to_dict()


def test_where_nothing_is_exact_or_nothing_is_said_it_is_not(
    explained: ExplainedAgent, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_: Any) -> None:
        raise ConfigError("no exact copy")

    learnt = replace(explained.config, predictor=EnsembleConfig())
    assert own_agent.first_calibration(explained.run, learnt) is None
    silent = replace(explained.run, config=replace(explained.run.config, instructor=InstructorConfig("silent")))
    monkeypatch.setattr(own_agent, "CALIBRATION_EPISODES", 2)
    assert own_agent.first_calibration(silent, explained.config) is None
    monkeypatch.setattr(own_agent, "make_snapshot_env", refused)
    assert own_agent.first_calibration(explained.run, explained.config) is None


def test_a_horizon_that_nobody_set_is_found_reported_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["mapping.horizon_steps=null", "predictor.futures=1"]
    folder = tmp_path / "run"
    made = explain_agent(
        pilots.pilot, "lander", episodes=24, agent_sees_instruction=False, run_dir=folder, settings=settings
    )
    steps = made.run.horizon_steps
    assert 5 <= steps <= 100
    assert f"explains the next {steps} steps, as long as movements last here" in capsys.readouterr().out
    assert read_json(folder / "summary.json")["horizon_steps"] == steps
    opened = open_run(folder, pilots.pilot).run
    assert (opened.horizon_steps, opened.config.mapping.horizon_steps) == (steps, steps)
    assert list(opened.spans) == [n for n in (20,) if n < steps]


def test_it_explains_an_episode(explained: ExplainedAgent) -> None:
    found = explained.explain(seed=3, context="left")
    assert found.watched.episode.context == "left"
    assert len(found.said) == len(found.watched.episode)
    hits = phrase_hits(found.watched.episode, found.said, explained.run.mapping, LANDER_TASK.phrases)
    assert phrase_accuracy(hits) > 0.5
    text = str(found)
    assert text.count("\n") > 5
    assert re.search("^Lunar Lander with pads: left", text, re.MULTILINE)  # a verdict comes first
    closing = (
        r"\d+% of its explanations .*of the next 20 steps went as predicted; AUC of its words .*\. Agent: function"
    )
    assert re.search(closing, " ".join(text.split()))


def test_it_is_judged(explained: ExplainedAgent) -> None:
    quality = explained.evaluate()
    ours = next(row for row in quality["rows"] if row["explainer"] == "ibe:axis")
    assert quality["verdict"]["motion_auc"]["value"] == ours["motion_auc"]["value"]
    assert quality["verdict"]["level"] in WORST_FIRST
    assert ours["motion_auc"]["value"] > 0.7
    assert quality["changing_policy"] == []
    assert (explained.run.folder / "figures").is_dir()


def test_the_folder_alone_says_that_its_agent_is_missing(
    explained: ExplainedAgent, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = explained.run.folder
    with pytest.raises(ConfigError, match=r"agent=null with run=.*trained elsewhere \(function\); allowed is its file"):
        load_run(folder)
    call("explain", f"run={folder}", "agent=pilots:pilot", "seed=3", "context=left", *QUICK[2:])
    printed = capsys.readouterr().out
    opened = open_run(folder, pilots.pilot, QUICK)
    assert str(opened.explain(3, "left")) == printed


def test_a_model_file_is_explained_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pilots.trained("DQN").save(tmp_path / "model.zip")
    own = [f"run_dir={tmp_path / 'run'}", "episodes=10", "random_actions=0.3", "env.kwargs.pad=left"]
    call("explain", f"agent={tmp_path / 'model.zip'}", "env=lander", f"clip={tmp_path / 'x.gif'}", *own, *QUICK)
    assert "Lunar Lander with pads: left" in capsys.readouterr().out
    assert (tmp_path / "x.gif").read_bytes().startswith(b"GIF89a")
    config = load_run(tmp_path / "run", lambda _: pilots.sideways).config
    assert config.env.kwargs["pad"] == "left"
    assert config.agent == ExternalPolicyConfig(made_from=str(tmp_path / "model.zip"))
    assert config.viewer == ViewerConfig(mode="off")
    assert config.mapping.newest_frames is None


def refusal(*arguments: str) -> str:
    with pytest.raises(SystemExit) as ended:
        call("explain", *arguments)
    return str(ended.value)


def test_an_environment_whose_file_sets_what_a_training_needs(tmp_path: Path) -> None:
    """``env=reacher`` brings a horizon, which counts, and the length of a training, which says nothing here."""
    made = explain_agent(pilots.reach, "reacher", episodes=12, agent_sees_instruction=False, run_dir=tmp_path / "arm")
    assert (made.run.horizon_steps, list(made.run.spans)) == (10, [5])
    assert made.run.config.env.id == "Reacher-v5"
    assert all(len(one.expression) == 2 for one in made.explain(seed=1).said)
    call("explain", f"run={tmp_path / 'arm'}", "agent=pilots:reach", "agent_sees_instruction=false", "viewer=off")


def test_settings_that_nothing_would_read_are_refused(explained: ExplainedAgent) -> None:
    folder = f"run={explained.run.folder}"
    assert "env= with run=" in refusal(folder, "agent=pilots:pilot", "env=lander")
    assert "episodes= with run=" in refusal(folder, "agent=pilots:pilot", "episodes=9", "mapping=paper")
    assert "random_actions= without agent=" in refusal(folder, "random_actions=0.1")
    assert "agent_sees_instruction= without agent=" in refusal(folder, "agent_sees_instruction=true")
    for task in ("figures", "predictors"):
        assert f"task={task} with agent=: allowed is episode" in refusal(folder, "agent=pilots:pilot", f"task={task}")
    assert "that run has an agent of its own" in refusal(f"run={ROOT / 'demo'}", "agent=pilots:pilot")
    assert "agent_sees_instruction=true: the" not in refusal(folder, "agent=pilots:nothing")
    assert "sweep=" in refusal("sweep=x", "agent=pilots:pilot")
    assert "agent=null with run=" in refusal(folder)


def test_what_cannot_work_is_refused_before_a_folder_is_made(tmp_path: Path) -> None:
    def refused(message: str, agent: Any = pilots.sideways, **changes: Any) -> None:
        asked = {"agent_sees_instruction": False, "run_dir": tmp_path / "run", "episodes": 4} | changes
        with pytest.raises(ConfigError, match=message):
            explain_agent(agent, **asked)
        assert not (tmp_path / "run").exists()

    refused("agent_sees_instruction=null", agent_sees_instruction=None)
    refused("fails on an observation of 11 numbers", pilots.module(), agent_sees_instruction=True)
    refused("episodes=1: allowed is at least 2", episodes=1)
    refused("random_actions=2: allowed is at least 0 and at most 1", random_actions=2)
    unread = ["mapping.dimensions=[angular_velocity]"]
    refused(r"rule does not depend on them, it reads x, goal_x; allowed is \[\], or mapping=lasso", settings=unread)
    refused("env=nothing: allowed is one of .*cart_pole, .*, an id that is registered with gymnasium", env="nothing")
    refused(
        "mapping.horizon_steps=5000: allowed is at least 1 and at most 1000", settings=["mapping.horizon_steps=5000"]
    )
    refused("mapping.steps: no such setting", settings=["mapping.steps=1"])
    refused("agent=nothing: allowed is a .zip", "nothing")


def test_episodes_that_teach_nothing_leave_nothing(tmp_path: Path, explained: ExplainedAgent) -> None:
    short = ["mapping.horizon_steps=1000", "mapping.window_end=drop"]
    with pytest.raises(ConfigError, match="episodes=2: no vocabulary can be learnt from them"):
        explain_agent(
            pilots.sideways, agent_sees_instruction=False, run_dir=tmp_path / "run", episodes=2, settings=short
        )
    assert [*tmp_path.iterdir()] == []  # and the same folder can be asked for again
    with pytest.raises(ConfigError, match="holds a run already"):
        explain_agent(pilots.sideways, agent_sees_instruction=False, run_dir=explained.run.folder, episodes=2)
    with pytest.raises(ConfigError, match="context=up: allowed is one of left, center, right"):
        explained.explain(context="up")


def test_importing_the_package_brings_no_torch_until_it_is_needed() -> None:
    code = "import sys, ibe_rl; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    assert ibe_rl.explain_agent is explain_agent
    assert ibe_rl.open_run is open_run
    for name, now in {"study": explain_agent, "open_study": open_run, "Study": ExplainedAgent}.items():
        with pytest.warns(DeprecationWarning, match=f"ibe_rl.{name} is called ibe_rl.{now.__name__} now"):
            assert getattr(ibe_rl, name) is now
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = ibe_rl.nothing
