"""A study is read whole and checked before anything is served."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from own_study import QUESTIONS, SETTINGS, stimulus, write_study

from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.folder import PROTOCOL, hold_protocol, open_study
from ibe_rl.types import ConfigError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_study(tmp_path / "study")


def test_a_whole_study_opens(folder: Path) -> None:
    study = open_study(folder)
    assert study.texts["consent"] == "# Do you agree?"
    assert [one.text for one in study.questions["satisfaction"]] == ["I understood it.", "I liked it."]
    assert study.questions["satisfaction"][0].options == ("no", "a little", "yes")
    assert study.questions["demographics"][0].optional
    assert [one["truth"]["at"] for one in study.stimuli] == [0.0, 0.1, 0.2]
    assert study.orders == [("none",), ("ibe",)]


def test_whatever_a_person_sees_is_in_the_protocol(folder: Path) -> None:
    before = open_study(folder)
    assert {"study.yaml", "texts/en/consent.md", "texts/en/scales/satisfaction.yaml", "stimuli/000.json"} <= {
        *before.files
    }
    assert open_study(folder).protocol == before.protocol
    (folder / "texts/en/consent.md").write_text("# Do you agree to this?")
    assert open_study(folder).protocol != before.protocol


def test_answers_are_not_part_of_it(folder: Path) -> None:
    before = open_study(folder).protocol
    Answers(folder / FILE).close()
    assert open_study(folder).protocol == before


def test_a_study_that_has_begun_is_not_changed(folder: Path) -> None:
    answers = Answers(folder / FILE)
    hold_protocol(open_study(folder), answers)
    (folder / "texts/en/debriefing.md").write_text("# Before anybody came")
    study = open_study(folder)
    hold_protocol(study, answers)
    assert json.loads((folder / PROTOCOL).read_text())["protocol"] == study.protocol
    answers.begin(("ibe",), study.protocol, pilot=True)
    hold_protocol(study, answers)
    answers.begin(("ibe",), study.protocol, pilot=False)
    hold_protocol(study, answers)
    (folder / "stimuli/001.json").write_text((folder / "stimuli/002.json").read_text())
    (folder / "texts/en/new.md").write_text("")
    with pytest.raises(
        ConfigError, match=r"stimuli/001.json, texts/en/new.md changed after the first person had begun"
    ):
        hold_protocol(open_study(folder), answers)
    answers.close()


def test_mixed_each_person_has_two_blocks(tmp_path: Path) -> None:
    arms = {"arms": ["none", "paper", "ibe"], "design": "mixed", "trials": {"practice": 0, "each_arm": 2}}
    study = open_study(write_study(tmp_path / "study", episodes=4, **arms))
    assert sorted(study.orders) == [("ibe", "none"), ("none", "ibe"), ("none", "paper"), ("paper", "none")]
    with pytest.raises(ConfigError, match="a person sees 4 episodes, 3 are in stimuli/"):
        open_study(write_study(tmp_path / "few", episodes=3, **arms))


BROKEN = {
    "no settings": (lambda f: (f / "study.yaml").unlink(), "it has no study.yaml"),
    "no yaml": (lambda f: (f / "study.yaml").write_text("arms: [none"), "study.yaml: allowed is YAML"),
    "language": (
        lambda f: (f / "study.yaml").write_text("language: fr"),
        "language=fr: allowed is one of en",
    ),
    "no text": (lambda f: (f / "texts/en/consent.md").unlink(), "consent.md: allowed is a text in Markdown .No such"),
    "no utf-8": (lambda f: (f / "texts/en/consent.md").write_bytes(b"\xff"), "consent.md: .*it is no UTF-8"),
    "no words": (lambda f: (f / "texts/en/words.yaml").write_text("next: go"), "words.yaml: progress=None"),
    "lead": (
        lambda f: (f / "texts/en/attention.yaml").write_text(yaml.safe_dump({**QUESTIONS["attention"], "lead": 3})),
        "attention.yaml: lead=3: allowed is a text",
    ),
    "task": (
        lambda f: (f / "study.yaml").write_text(yaml.safe_dump({**SETTINGS, "trials": {"task": "which_agent"}})),
        "000.json: it has no two sides; allowed with trials.task=which_agent",
    ),
    "no scale": (lambda f: (f / "texts/en/scales/satisfaction.yaml").unlink(), "satisfaction.yaml"),
    "no json": (lambda f: (f / "stimuli/001.json").write_text("{"), "001.json: allowed is an episode"),
    "another json": (lambda f: (f / "stimuli/001.json").write_text("[1]"), "001.json: allowed is an episode"),
    "too few": (lambda f: (f / "stimuli/001.json").unlink(), "a person sees 3 episodes, 2 are in stimuli/"),
    "no explanations": (
        lambda f: (f / "stimuli/001.json").write_text(json.dumps({**stimulus(1), "explanations": {}})),
        "stimuli/001.json has no explanations of ibe",
    ),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_missing_or_broken_is_named(folder: Path, what: str) -> None:
    break_it, message = BROKEN[what]
    break_it(folder)
    with pytest.raises(ConfigError, match=message):
        open_study(folder)
