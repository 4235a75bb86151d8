"""A small run whose instructor says words: trained, explained, judged, resumed, exported."""

import json
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.apps.datasets.instruction_source import values_of_words
from ibe_rl.evaluation.runs import load_run
from ibe_rl.storage.run_folder import WORD_LIST, read_json
from ibe_rl.task.words import Words
from ibe_rl.vocabulary.words import words_of

OWN = ["links", "上", "rechts"]
DESIGNED = ("falling", "straight", "slightly")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "words"
    told = f"instructor.words=[{','.join(OWN)}]"
    call("train", *SMALL, told, "instructor.max_words=4", f"run_dir={folder}", "viewer=file", "total_frames=4000")
    return folder


def test_it_speaks_in_these_words_only(run: Path, capsys: pytest.CaptureFixture[str]):
    call("explain", f"run={run}", "viewer=off", "min_confidence=0", "predictor.futures=1")
    told = capsys.readouterr().out
    assert any(word in told for word in OWN)
    assert not any(word in told for word in DESIGNED)
    opened = load_run(run)
    assert opened.mapping.expressions.shape[1] == 4
    assert not opened.mapping.expressions[:, 3].any()  # there is no fourth word yet


def test_the_folder_holds_the_words(run: Path):
    words = words_of(run, 4)
    assert words is not None
    assert words.names == tuple(OWN)
    newest = read_json(max((run / "refreshes").glob("*.json")))
    assert [one["word"] for one in newest["words"]] == OWN
    assert set(newest["windows"]["by_instruction"]) == set(OWN)
    assert {one["kind"] for one in newest["word_notices"]} <= {"same", "nothing", "changed"}
    phrases = {cluster["phrase"] for cluster in newest["clusters"]}
    assert not any(word in phrase for phrase in phrases for word in DESIGNED)


def test_it_is_judged_by_where_its_words_lead(run: Path):
    few = [
        "evaluate.spoken_episodes=1",
        "evaluate.episodes=3",
        "evaluate.calibration_episodes=3",
        "evaluate.shuffles=1",
        "evaluate.resamples=20",
    ]
    once = ["evaluate.changing_episodes=0", "evaluate.horizons_steps=[20]", "predictor.futures=1"]
    call("explain", f"run={run}", "task=evaluate", *few, *once)
    quality = json.loads((run / "evaluation" / "quality.json").read_text())
    rows = {row["explainer"]: row for row in quality["rows"]}
    assert 0 <= rows["ibe:axis"]["word_f1"]["value"] <= 1
    assert rows["baseline:constant"]["word_f1"] is None
    header = (run / "evaluation" / "moments.csv").read_text().splitlines()[0]
    assert "m*_links,m*_上,m*_rechts" in header


def test_a_renamed_word_is_spoken_by_its_new_name_when_the_run_goes_on(run: Path):
    named = json.loads((run / WORD_LIST).read_text())
    named[0] |= {"word": "west", "renamed_from": ["links"]}
    (run / WORD_LIST).write_text(json.dumps([*named, {"word": "neu", "added_at_frame": 4096, "renamed_from": []}]))
    call("train", f"resume={run}", "total_frames=6000", "viewer=off")
    newest = read_json(max((run / "refreshes").glob("*.json")))
    assert [one["word"] for one in newest["words"]] == ["west", "上", "rechts", "neu"]
    assert any(one["text"] == "'neu' means nothing to me yet: not heard yet" for one in newest["word_notices"])


def test_the_papers_experiments_are_refused_in_a_line(run: Path):
    with pytest.raises(SystemExit, match="the instructions of Lunar Lander with pads are words"):
        call("explain", f"run={run}", "task=figures")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["instructor.words=[a,b]"], "the rule of Lunar Lander with pads cannot say them"),
        (["instructor.words=[a,A,b]"], "word 'A': it is there already"),
        (["instructor.words=[a,b,'']"], "it is empty"),
        (["instructor.max_words=3"], "allowed beside instructor.words"),
        (["instructor.max_words=13"], "at most 12"),
        (["env.words=[a,b,c]"], "allowed is instructor.words"),
        (["instructor.words=[a,b,c]", "obedience.judge=mapping"], "with an instructor's words: allowed is none"),
    ],
)
def test_words_that_cannot_work_are_refused_before_anything_is_made(tmp_path: Path, arguments: list[str], reason: str):
    with pytest.raises(SystemExit, match=reason):
        call("train", *SMALL, *arguments, f"run_dir={tmp_path / 'run'}", "viewer=off")
    assert not (tmp_path / "run").exists()


def test_an_imported_log_is_read_in_these_words(run: Path):
    task = load_run(run).task
    assert isinstance(task.phrases, Words)
    assert values_of_words(task)["上"] == (0, 1, 0, 0)
    np.testing.assert_array_equal(task.rule(np.zeros((1, 9)))[0], [0, 1, 0, 0])
