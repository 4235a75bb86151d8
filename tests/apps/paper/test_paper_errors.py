"""What the paper's experiments cannot be done with ends in one clear error."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import gymnasium
import pytest
from few import FEW
from processes import call

from ibe_rl.apps.paper import experiments
from ibe_rl.apps.paper.agents import PaperAgent
from ibe_rl.apps.paper.report_context import ReportContext, as_ibe, check_report, hidden_goal_env
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import ExplainConfig, MappingConfig, PredictorConfig, TrainConfig, ViewerConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.giving import given_env
from ibe_rl.envs.lander import LunarLanderPads
from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.evaluation.runs import load_run
from ibe_rl.ibe import IBEConfig
from ibe_rl.storage.run_folder import CONFIG
from ibe_rl.types import ConfigError, Episode

HIDDEN = {"flat": True, "flags": False}


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("figures.episodes=9", "at least 10 and at most 10000"),
        ("figures.episodes=10001", "at least 10 and at most 10000"),
        ("figures.checked_episodes=1", "at least 2"),
        ("figures.prediction_episodes=1", "at least 2"),
        ("figures.clusterings=0", "at least 1"),
        ("figures.shuffles=0", "at least 1"),
        ("figures.resamples=19", "at least 20"),
        ("figures.seed=1000", "at least 0 and at most 999"),
    ],
)
def test_settings_out_of_their_limits_are_refused(trained: Path, setting: str, expected: str) -> None:
    with pytest.raises(SystemExit, match=f"^error: {setting}: allowed is .*{expected}[^\n]*$"):
        call("explain", f"run={trained}", *FEW, setting)
    assert not (trained / "figures").exists()


@pytest.mark.parametrize(
    ("lacks", "expected"),
    [("policy_*.pt", "it has no policy yet"), ("0*.json", "it has no vocabulary from before its policy")],
)
def test_a_run_that_lacks_something_is_refused(trained: Path, lacks: str, expected: str, tmp_path: Path) -> None:
    shutil.copytree(trained, tmp_path / "run", ignore=shutil.ignore_patterns(lacks))
    with pytest.raises(SystemExit, match=f"^error: run=.*: {expected}[^\n]*$"):
        call("explain", f"run={tmp_path / 'run'}", *FEW)
    assert not (tmp_path / "run" / "figures").exists()


def test_a_folder_that_cannot_be_written_is_refused(trained: Path, tmp_path: Path) -> None:
    shutil.copytree(trained, tmp_path / "run")
    (tmp_path / "run" / "figures").write_text("not a folder")
    with pytest.raises(SystemExit, match=r"^error: run=.*: allowed is a folder that can be written to [^\n]*$"):
        call("explain", f"run={tmp_path / 'run'}", *FEW)


@pytest.fixture
def opened(trained: Path) -> ReportContext:
    """The run with its settings, as the script has them."""
    settings = ExplainConfig(predictor=PredictorConfig(), viewer=ViewerConfig())
    settings.figures.shuffles = settings.figures.clusterings = 1
    made = ReportContext(load_run(trained), settings)
    own = load_config(trained / CONFIG, TrainConfig).mapping
    made.__dict__["mappings"] = {"paper": IBEConfig(kind="paper"), "default": own}  # which only the script reads
    return made


@pytest.fixture
def agent(opened: ReportContext) -> PaperAgent:
    return PaperAgent("C", None, 9216, opened.run.policy, opened.runner.run(opened.run.policy, range(4)))


def test_an_instruction_of_two_numbers_is_refused(opened: ReportContext) -> None:
    both = replace(opened.run, task=LANDER_SPEED_TASK)
    with pytest.raises(ConfigError, match=r"^task=figures: an instruction of .* has 2 numbers; allowed is one number"):
        ReportContext(both, opened.cfg)


@pytest.mark.parametrize("lacks", ["motion", "first_contact", "scene_path"])
def test_an_environment_that_does_not_declare_enough_is_refused(opened: ReportContext, lacks: str) -> None:
    poorer = replace(opened.run, task=replace(opened.task, **{lacks: None}))
    with pytest.raises(ConfigError, match=f"task=figures: .* does not declare {lacks}; allowed is one that does"):
        ReportContext(poorer, opened.cfg)


def test_episodes_that_teach_no_vocabulary_end_in_one_clear_error(opened: ReportContext, agent: PaperAgent) -> None:
    long = agent.episodes[0]
    short = Episode(
        long.states[:3], long.actions[:2], long.rewards[:2], long.instructions[:2], long.given[:2], True, False, "left"
    )
    with pytest.raises(ConfigError, match=r"figures.episodes=200: agent C's give no vocabulary .*allowed are more"):
        experiments.teach(opened, replace(agent, episodes=[short]))


def test_an_agent_that_never_comes_down_cannot_be_predicted(
    opened: ReportContext, agent: PaperAgent, monkeypatch: pytest.MonkeyPatch
) -> None:
    [taught] = experiments.teach(opened, agent)
    monkeypatch.setattr(experiments, "pick_episodes", lambda *_: [])
    with pytest.raises(ConfigError, match=r"^run=.*: agent C hardly ever comes down after at least 40 steps; allowed"):
        experiments.foretell(opened, agent, taught, agent.episodes)


def test_an_agent_that_never_goes_to_a_side_cannot_be_predicted(opened: ReportContext, agent: PaperAgent) -> None:
    still = ReportContext(replace(opened.run, task=replace(opened.task, explained_band=(9.0,))), opened.cfg)
    with pytest.raises(ConfigError, match=r"^run=.*: agent C never goes to a side within 20 steps; allowed is a run"):
        experiments.typical(still, agent, agent.episodes)


def test_shuffled_instructions_that_teach_nothing_end_in_one_clear_error(
    opened: ReportContext, agent: PaperAgent, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiments, "fit_shuffled", lambda *_: [])
    with pytest.raises(ConfigError, match=r"^figures.shuffles=1: none of them gave a vocabulary; allowed are more"):
        experiments.learn_shuffled(opened, agent)


@pytest.mark.parametrize("setting", ["refresh_every_frames=null", "instructor=silent"])
def test_a_report_that_could_not_be_made_is_refused_before_the_training(setting: str, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=f"^error: report=true with {setting}: allowed is a training that learns"):
        call("train", f"run_dir={tmp_path / 'run'}", "viewer=off", "report=true", setting)
    assert not (tmp_path / "run").exists()


def test_a_mapping_without_the_papers_settings_is_refused() -> None:
    own = IBEConfig(kind="mine:Own")
    assert as_ibe(own) is own
    with pytest.raises(ConfigError, match=r"^task=figures with mapping\.kind=mine:Own: it has no normalisation and "):
        as_ibe(MappingConfig(kind="mine:Own"))


def test_a_given_environment_whose_goal_cannot_be_hidden_is_refused() -> None:
    def made() -> gymnasium.Env:
        return gymnasium.make("ibe_rl/LunarLanderPads-v0")

    assert hidden_goal_env(given_env(lambda **kwargs: LunarLanderPads(**kwargs)), LANDER_TASK).kwargs == HIDDEN
    assert hidden_goal_env(given_env(made), replace(LANDER_TASK, hidden_goal={})).kwargs == {}
    with pytest.raises(ConfigError, match=r"^task=figures: env=.*flat.*; allowed is a function that takes flat=True, "):
        hidden_goal_env(given_env(made), LANDER_TASK)


def test_an_environment_without_a_report_is_refused_before_the_training(opened: ReportContext) -> None:
    poorer, config = replace(opened.task, motion=None), load_config(opened.run.folder / CONFIG, TrainConfig)
    check_report(config, poorer)  # which asks for none
    with pytest.raises(ConfigError, match="does not declare motion"):
        check_report(replace(config, report=True), poorer)
