"""A page shows what belongs to it, and nothing that gives its answer away."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from own_study import write_study

from ibe_rl.apps.study.content import about, content_of, feedback_on
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.schedule import Page, pages_of

TRIAL = Page("trial/1/1", "trial", "ibe", "ibe", 1)
PRACTICE = Page("trial/practice/1", "trial", "practice", "ibe", 0)


def opened(tmp_path: Path, **settings: Any) -> Study:
    return open_study(write_study(tmp_path / "study", **settings))


def trials(**more: Any) -> dict[str, Any]:
    return {"practice": 1, "each_arm": 2, **more}


def test_what_all_pages_need(tmp_path: Path) -> None:
    told = about(opened(tmp_path, title="A study", contact="who@example.org"))
    assert {name: told[name] for name in ("title", "contact", "language", "recruiter")} == {
        "title": "A study",
        "contact": "who@example.org",
        "language": "en",
        "recruiter": "codes",
    }
    assert told["words"]["next"] == "next"


@pytest.mark.parametrize("task", ["landing", "next_words", "what_if", "which_agent"])
@pytest.mark.parametrize("arm", ["none", "ibe"])
def test_a_trial_shows_its_arm_and_no_truth(tmp_path: Path, task: str, arm: str) -> None:
    study = opened(tmp_path, trials=trials(task=task))
    shown = content_of(study, Page("trial", "trial", arm, arm, 1))
    assert len(shown["recordings"]) == (2 if task == "which_agent" else 1)
    for one in shown["recordings"]:
        assert one.keys() - {"told"} == {"size", "frame_ms", "background", "frames", "said"}
        assert one.get("told") == ("to the left" if task == "what_if" else None)
        assert one["said"] == (None if arm == "none" else {"expressions": [0.5, 1.0], "phrases": ["right", "right"]})
    text = json.dumps(shown)
    for secret in ("truth", "later", "observers", "seed", "context", "success", "straight" if arm == "ibe" else "left"):
        assert f'"{secret}"' not in text or (task in ("next_words", "what_if") and secret in ("left", "straight"))


@pytest.mark.parametrize(
    ("task", "options"),
    [
        ("landing", []),
        ("next_words", [["left", "straight", "right"]]),
        ("what_if", [["left", "straight", "right"]]),
        ("which_agent", [["first", "second"]]),
    ],
)
def test_the_options_of_a_trial(tmp_path: Path, task: str, options: list[list[str]]) -> None:
    shown = content_of(opened(tmp_path, trials=trials(task=task)), TRIAL)
    assert [one["options"] for one in shown["questions"]] == options
    assert (shown["task"], shown["confidence"]) == (task, True)


def test_texts_are_markdown_without_html_and_pictures_of_others(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    (folder / "texts/en/information.md").write_text("# What it is\n<script>1</script> ![x](https://example.org/x.png)")
    html = content_of(open_study(folder), Page("consent", "consent"))["html"]
    assert html.startswith("<h1>What it is</h1>")
    assert html.endswith("<h1>Do you agree?</h1>\n")
    assert "<script" not in html
    assert "<img" not in html


def test_questions_come_with_their_lead_and_without_what_is_right(tmp_path: Path) -> None:
    study = opened(tmp_path)
    scale = content_of(study, Page("scale/satisfaction", "scale", "satisfaction"))
    assert scale["lead"] == "How much do you agree?"
    assert scale["questions"][0] == {
        "text": "I understood it.",
        "options": ["no", "a little", "yes"],
        "optional": False,
    }
    assert (
        content_of(study, Page("comprehension", "comprehension"))["questions"][0].keys() == scale["questions"][0].keys()
    )


def test_the_example_is_an_episode_that_nobody_is_asked_about(tmp_path: Path) -> None:
    study = open_study(write_study(tmp_path / "study", episodes=4))
    pages = pages_of(study.settings, ("ibe",), len(study.stimuli), 1)
    example = next(one for one in pages if one.kind == "instructions")
    assert content_of(study, example)["recordings"][0]["frames"] == study.stimuli[3]["frames"]
    assert 3 not in {one.episode for one in pages if one.kind == "trial"}
    assert "recordings" not in content_of(study, Page("instructions", "instructions"))


@pytest.mark.parametrize(
    ("when", "page", "shown"),
    [
        ("always", TRIAL, True),
        ("always", PRACTICE, True),
        ("practice", TRIAL, False),
        ("practice", PRACTICE, True),
        ("never", PRACTICE, False),
        ("always", Page("comment", "comment"), False),
    ],
)
def test_when_feedback_is_given(tmp_path: Path, when: str, page: Page, shown: bool) -> None:
    assert (feedback_on(opened(tmp_path, trials=trials(feedback=when)), page) is not None) == shown


@pytest.mark.parametrize(
    ("task", "truth", "frames"),
    [("landing", {"at": 0.0}, 2), ("next_words", {"choice": 0}, 2), ("which_agent", {"choice": 0}, 0)],
)
def test_feedback_is_what_happened(tmp_path: Path, task: str, truth: dict[str, Any], frames: int) -> None:
    given = feedback_on(opened(tmp_path, trials=trials(task=task)), PRACTICE)
    assert given is not None
    assert len(given.pop("frames")) == frames
    assert given == truth
