"""A study is made whole from a run, or not at all; its texts and settings say what it is."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
import yaml
from lifts import ride
from processes import ROOT

from ibe_rl.apps.study import flights, preparing
from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.make import arms_each, commented, make, nested, write_study_files
from ibe_rl.apps.study.questions import read_questions
from ibe_rl.apps.study.settings import StudySettings, read_settings
from ibe_rl.apps.study.shipped_texts import to_fill_in
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.runtime.operating_system import lock_file
from ibe_rl.types import ConfigError

DEMO = str(ROOT / "demo")
SCALES = ("satisfaction", "trust", "tlx", "sus")
BRIEF: dict[str, Any] = {"flights": 4, "trials.practice": 1, "trials.each_arm": 1}


def test_what_is_made_opens_and_says_from_what(made: Path) -> None:
    study = open_study(made)
    assert study.settings.arms == ["none", "paper", "ibe", "placebic", "true_future"]
    assert (study.settings.seed, study.settings.trials.each_arm, len(study.stimuli)) == (3, 4, 6)
    about = json.loads((made / "made.json").read_text())
    assert about["run"] == "demo"
    assert (about["task"], about["until"], about["stimuli"], about["horizon_steps"]) == ("landing", "contact", 6, 60)
    assert not made.with_name("study.partial").exists()


def test_texts_name_what_is_asked_of_people(made: Path) -> None:
    study = open_study(made)
    assert "You watch short clips: 1 for practice and 4 that count." in study.texts["information"]
    assert not (made / "texts/en/parts.yaml").exists()
    assert "lab@example.org" in study.texts["debriefing"]
    assert "in the end, when it has come down" in " ".join(study.texts["instructions"].split())
    assert study.words["ask_landing"] == "Where will it be in the end?"
    assert not [name for name, text in study.texts.items() if "$" in text]
    assert to_fill_in(made) == ["texts/en/information.md"]
    assert all(question.right is not None for question in study.questions["comprehension"])


@pytest.mark.parametrize("task", ["landing", "next_words", "what_if", "which_agent"])
def test_each_task_has_its_own_instructions(task: str, tmp_path: Path) -> None:
    settings = read_settings({"trials": {"task": task}}, "make")
    (tmp_path / "stimuli").mkdir()
    write_study_files(tmp_path, settings, [], {"until": "lot", "ahead_s": 1.24})
    texts = tmp_path / "texts/en"
    assert {path.stem for path in texts.glob("*.md")} == {"consent", "debriefing", "information", "instructions"}
    told, asked = (texts / "instructions.md").read_text(), yaml.safe_load((texts / "comprehension.yaml").read_text())
    assert "12" in told
    assert len(read_questions(asked, "comprehension.yaml")) == 3
    if task == "landing":
        assert "1.2 seconds after the clip" in told
        assert "1.2 seconds later" in (texts / "words.yaml").read_text()


def test_every_scale_says_where_it_is_from_and_on_what_terms(made: Path) -> None:
    for name in SCALES:
        path = made / f"texts/en/scales/{name}.yaml"
        values = yaml.safe_load(path.read_text())
        assert len(values["source"]) > 50
        assert values["terms"]
        assert len(read_questions(values, str(path))) >= 6
    assert {path.stem for path in (made / "texts/en/scales").iterdir()} == {*SCALES}


def test_study_yaml_says_what_everything_means_and_reads_back() -> None:
    given = {"arms": ["none", "paper", "ibe"], "trials": {"task": "next_words", "transfer": 4}, "hypotheses": ["H: 1"]}
    settings = read_settings(given, "here")
    text = commented(settings)
    assert read_settings(yaml.safe_load(text), "there") == settings
    assert "# who answers questions of participants" in text
    assert "  # one of landing, next_words, what_if, which_agent" in text


def test_a_person_needs_a_quarter_of_an_hour_at_most(tmp_path: Path) -> None:
    (tmp_path / "stimuli").mkdir()
    write_study_files(tmp_path, StudySettings(), [], {"until": None, "ahead_s": 1.0})
    assert "It takes about 10 minutes" in (tmp_path / "texts/en/information.md").read_text()


def test_how_many_arms_a_person_goes_through() -> None:
    designs = ("between", "within", "mixed")
    found = [arms_each(StudySettings(arms=["none", "paper", "ibe"], design=design)) for design in designs]
    assert found == [1, 3, 2]


def test_settings_of_groups() -> None:
    assert nested({"quota": 3, "trials.each_arm": 2, "trials.transfer": 1}) == {
        "quota": 3,
        "trials": {"each_arm": 2, "transfer": 1},
    }
    with pytest.raises(ConfigError, match=r"trials\.each_arm=2: trials has a value of its own"):
        nested({"trials": 1, "trials.each_arm": 2})


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "stimuli": ({"stimuli": 2}, "stimuli=2: allowed is 0, or 14 to 1000"),
    "frames": ({"frames": 1}, "frames=1: allowed is 2 to 1000"),
    "flights": ({"flights": 1}, "flights=1: allowed is 2 to 5000"),
    "pace": ({"pace": 0.0}, "pace=0.0: allowed is 0.01 to 10"),
    "seed": ({"seed": 1000}, "seed=1000: allowed is 0 to 999"),
    "trials": ({"trials.each_arm": 500, "trials.transfer": 500}, "a person sees 1002 episodes; allowed are 1 to 999"),
    "study": ({"quotas": 3}, "make: quotas=3: no such setting.*did you mean quota"),
    "other": ({"other": "there"}, "other=there with trials.task=landing: allowed is null"),
    "until": (
        {"until": "end", "trials.task": "which_agent"},
        "until=end with trials.task=which_agent: allowed is null",
    ),
    "a run": ({"run": "nowhere"}, "run=nowhere: not a run folder"),
    "until what": ({"until": "ende", **BRIEF}, "until=ende: allowed is one of contact, end, lot; did you mean end"),
    "no earlier one": ({"trials.task": "which_agent", **BRIEF}, "it kept no earlier policy with a vocabulary"),
    "equally good": ({"trials.task": "which_agent", "other": DEMO, **BRIEF}, "both agents are equally good"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_made_is_refused_and_leaves_nothing(what: str, tmp_path: Path) -> None:
    settings, message = REFUSED[what]
    with pytest.raises(ConfigError, match=message):
        make(**{"run": DEMO, "out": str(tmp_path / "study"), **settings})
    assert not [*tmp_path.iterdir()]


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "study").mkdir()
    with pytest.raises(ConfigError, match="study: it is there already; allowed is a new folder"):
        make(DEMO, str(tmp_path / "study"))


def test_a_place_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=r"out=.*study: allowed is a folder that can be written to .Not a directory"):
        make(DEMO, str(tmp_path / "file" / "study"))


def test_another_program_may_be_making_it(tmp_path: Path) -> None:
    partial = tmp_path / "study.partial"
    partial.mkdir()
    with (partial / "lock").open("w") as lock:
        assert lock_file(lock)
        with pytest.raises(ConfigError, match="another program is making it"):
            make(DEMO, str(tmp_path / "study"))
    assert partial.exists()


def test_what_a_killed_program_left_is_no_hindrance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: Path
) -> None:
    (tmp_path / "study.partial" / "stimuli").mkdir(parents=True)
    (tmp_path / "study.partial" / "stimuli" / "099.json").write_text("{}")
    shown = [json.loads(path.read_text()) for path in sorted((made / "stimuli").glob("*.json"))]
    monkeypatch.setattr(preparing, "stimuli_from", lambda plan: (shown[: plan.count], {"until": "end", "ahead_s": 1.0}))
    folder = make(DEMO, str(tmp_path / "study"), **BRIEF)
    assert len([*(folder / "stimuli").iterdir()]) == 3
    assert [*tmp_path.iterdir()] == [folder]


@pytest.mark.slow
def test_an_arm_that_cannot_be_learnt_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def too_little(*_: Any, **__: Any) -> None:
        raise TooLittleDataError("few")

    monkeypatch.setattr(flights, "fit_mapping", too_little)
    with pytest.raises(
        ConfigError, match="this agent's flights teach no vocabulary for paper; allowed are more flights"
    ):
        make(DEMO, str(tmp_path / "study"), arms=["none", "paper"], **{"test.arms": ["paper", "none"]}, **BRIEF)


def test_the_demo_is_found_wherever_one_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert preparing.opened("demo").run.folder == ROOT / "demo"


@pytest.fixture
def two_policies(tmp_path: Path) -> Path:
    """The demo's run with an earlier policy, which never does anything."""
    folder = tmp_path / "run"
    shutil.copytree(DEMO, folder)
    [policy], [refresh] = (folder / "checkpoints").iterdir(), (folder / "refreshes").iterdir()
    weights = {name: torch.zeros_like(value) for name, value in torch.load(policy, weights_only=True).items()}
    torch.save(weights, folder / "checkpoints" / "policy_000000001000.pt")
    shutil.copy(refresh, folder / "refreshes" / "000000001000.json")
    return folder


@pytest.mark.slow
def test_an_agent_is_compared_with_itself_as_it_was(two_policies: Path, tmp_path: Path) -> None:
    study = make(str(two_policies), str(tmp_path / "study"), **BRIEF, **{"trials.task": "which_agent"})
    about = json.loads((study / "made.json").read_text())
    assert (about["policy_frame"], about["other"]["policy_frame"]) == (2_007_040, 1000)
    assert about["success"] > about["other"]["success"]
    assert len(open_study(study).stimuli) == 3


def test_agents_of_different_environments_are_not_compared() -> None:
    lift, boat = (SimpleNamespace(task=SimpleNamespace(name=name, state_names=("x",))) for name in ("lift", "boat"))
    with pytest.raises(ConfigError, match="other=there: it is of boat; allowed is a run of lift"):
        flights.check_same_task(lift, boat, "there")  # type: ignore[arg-type]
    flights.check_same_task(lift, lift, "there")  # type: ignore[arg-type]


def test_an_agent_that_never_moves_is_expected_to_stay() -> None:
    run: Any = SimpleNamespace(horizon_steps=2, task=SimpleNamespace(explained=(0,), explained_band=(0.5,)))
    assert flights.FlownAgent(run, [ride([1.0] * 5).episode], None).observer.typical == 0.0
    assert flights.FlownAgent(run, [ride([0, 1, 2, 3, 4]).episode], None).observer.typical == pytest.approx(1.75)
    assert flights.FlownAgent(run, [ride([0, 1, 2]).episode], None).skill == (1.0, 2.0)
