"""A vocabulary is learnt from the best episodes of a log made by hand, and comes back from its file."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, WORDS, better_half, obey, two_floors

from ibe_rl.ibe import ClusterTransition, Reactions
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.drift import VocabularyDrift
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary import fitting
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.refresh import Change, Refresh, load_refresh, save_refresh


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return two_floors(tmp_path / "log")


def test_the_vocabulary_says_what_was_done_when_it_was_instructed(log: TrajectoryLog):
    learnt = learn_vocabulary(log, better_half(), TASK, seed=0)
    windows = STEPS + 1 - 5
    assert learnt.mapping.mean_instructions[:, 0].tolist() == [-1, 0, 1]
    assert learnt.mapping.expressions[:, 0].tolist() == [-1, 0, 1]
    assert learnt.mapping.sizes.tolist() == [windows, 2 * windows, windows]
    assert learnt.mapping.express(np.array([[4.9, 0, 0], [-5.1, 0, 0], [0.1, 0, 0]]))[:, 0].tolist() == [1, -1, 0]


def test_it_says_what_it_stands_on(log: TrajectoryLog):
    learnt = learn_vocabulary(log, better_half(), TASK, seed=0)
    assert learnt.frame == log.frames == 8 * STEPS
    assert (learnt.episodes_logged, learnt.episodes_used) == (8, 4)
    assert learnt.episodes_by_context == {"lower": 4, "upper": 0}
    assert learnt.windows_by_context == {"lower": 32, "upper": 0}
    assert learnt.windows_by_instruction == {"-1": 8, "0": 16, "+1": 8}
    assert len(learnt.top) == len(learnt.others) == 32
    assert set(learnt.top.delta[:, 0].round()) == {-5, 0, 5}


def test_the_best_can_be_taken_within_each_context(log: TrajectoryLog):
    learnt = learn_vocabulary(log, better_half(top_within="context", n_clusters=2), TASK, seed=0)
    assert learnt.episodes_by_context == {"lower": 2, "upper": 2}
    assert learnt.windows_by_context == {"lower": 16, "upper": 16}
    assert learnt.windows_by_instruction == {"-1": 16, "0": 0, "+1": 16}


def test_clamped_windows_begin_at_every_step(log: TrajectoryLog):
    learnt = learn_vocabulary(log, better_half(window_end="clamp"), TASK, seed=0)
    assert learnt.windows_by_context == {"lower": 4 * STEPS, "upper": 0}
    assert len(learnt.others) == 4 * STEPS


def test_the_same_seed_learns_the_same(log: TrajectoryLog):
    many = better_half(n_clusters=6, top_fraction=1.0)
    one, other = (learn_vocabulary(log, many, TASK, seed=3).mapping for _ in range(2))
    assert len(one.sizes) == 6
    assert one.to_dict() == other.to_dict()


def test_the_best_and_the_others_are_of_those_that_count(log: TrajectoryLog):
    """The upper floor comes last, and worse than the lower one."""
    learnt = learn_vocabulary(log, better_half(newest_frames=60, n_clusters=2), TASK, seed=0)
    assert learnt.episodes_counted == 5
    assert learnt.episodes_by_context == {"lower": 1, "upper": 2}
    assert len(learnt.others) == 2 * (STEPS + 1 - 5)
    within = learn_vocabulary(log, better_half(newest_frames=60, n_clusters=2, top_within="context"), TASK, seed=0)
    assert within.episodes_by_context == {"lower": 1, "upper": 2}
    assert len(within.others) == 2 * (STEPS + 1 - 5)


def changed(last: Refresh, refresh: Refresh, taken: bool, staleness: float = 0.25) -> Refresh:
    """What ``VocabularyTracker`` makes of a refresh, in numbers that can be distinguished."""
    change = Change(
        last=last.mapping,
        since_frame=48,
        transition=ClusterTransition({0: 0.75, 2: 0.5}, (1,), (3,)),
        drift=VocabularyDrift(0.125, 0.5, 0.375),
        policy_drift=0.0625,
        last_scores={"motion_auc": 0.5, "motion_auc_disobeyed": float("nan")},
        staleness=staleness,
    )
    return replace(refresh, change=change, scores={"motion_auc": 0.75, "instruction_f1": float("nan")}, taken=taken)


def test_the_vocabulary_that_stands_is_the_last_one_that_was_taken(log: TrajectoryLog):
    first, second = (learn_vocabulary(log, better_half(n_clusters=k), TASK, seed=0) for k in (2, 3))
    assert first.standing is first.mapping
    assert changed(first, second, taken=True).standing is second.mapping
    assert changed(first, second, taken=False).standing is first.mapping


def test_a_change_is_written_down(log: TrajectoryLog, tmp_path: Path):
    refresh = learn_vocabulary(log, better_half(), TASK, seed=0)
    named = replace(refresh, mapping=replace(refresh.mapping, ids=np.array([0, 3, 2])))
    saved = json.loads(save_refresh(tmp_path, changed(refresh, named, taken=True), better_half(), TASK).read_text())
    assert saved["change"] == {
        "since_frame": 48,
        "transition": {
            "survived": [{"id": 0, "overlap": 0.75}, {"id": 2, "overlap": 0.5}],
            "vanished": [1],
            "emerged": [3],
        },
        "vocabulary_drift": {"phrase_changed": 0.125, "expression_moved": 0.5, "cluster_agreement": 0.375},
        "policy_drift": 0.0625,
        "scores_before": {"motion_auc": 0.5, "motion_auc_disobeyed": None},
        "staleness": 0.25,
    }
    assert saved["scores"] == {"motion_auc": 0.75, "instruction_f1": None}
    assert [cluster["id"] for cluster in saved["clusters"]] == saved["mapping"]["ids"] == [0, 3, 2]


def test_what_is_undefined_of_a_change_is_null(log: TrajectoryLog, tmp_path: Path):
    refresh = learn_vocabulary(log, better_half(), TASK, seed=0)
    unknown = changed(refresh, refresh, taken=True, staleness=float("nan"))
    assert json.loads(save_refresh(tmp_path, unknown, better_half(), TASK).read_text())["change"]["staleness"] is None


def test_the_first_vocabulary_changes_nothing(log: TrajectoryLog, tmp_path: Path):
    saved = json.loads(
        save_refresh(tmp_path, learn_vocabulary(log, better_half(), TASK, 0), better_half(), TASK).read_text()
    )
    assert saved["change"] is None
    assert saved["scores"] == {}


def test_evidence_is_written_down_with_what_is_remembered(log: TrajectoryLog, tmp_path: Path):
    last = learn_vocabulary(log, better_half(), TASK, seed=0).mapping
    again = learn_vocabulary(log, better_half(memory=0.5), TASK, 0, {5: last})
    saved = json.loads(save_refresh(tmp_path, again, better_half(), TASK).read_text())
    assert [cluster["size"] for cluster in saved["clusters"]] == [8, 16, 8]
    assert [cluster["evidence"] for cluster in saved["clusters"]] == saved["mapping"]["evidence"] == [12, 24, 12]


def test_a_saved_vocabulary_comes_back(log: TrajectoryLog, tmp_path: Path):
    learnt = learn_vocabulary(log, better_half(), TASK, seed=0)
    path = save_refresh(tmp_path, learnt, better_half(), TASK)
    assert path.name == f"{96:012d}.json"
    loaded = load_refresh(path)
    assert (loaded.horizon_steps, loaded.frame, loaded.spans, loaded.calibration) == (5, 96, {}, None)
    assert loaded.mapping.to_dict() == learnt.mapping.to_dict()


def test_the_calibration_comes_back_with_it(log: TrajectoryLog, tmp_path: Path):
    calibration = Calibration(("agreement", "purity"), *np.array([[0.5, 0.75], [0.25, 1], [2, -1]]), np.array([0.125]))
    learnt = learn_vocabulary(log, better_half(), TASK, seed=0)
    loaded = load_refresh(save_refresh(tmp_path, learnt, better_half(), TASK, calibration)).calibration
    assert loaded is not None
    assert loaded.to_dict() == calibration.to_dict()


def test_each_span_of_time_has_a_vocabulary_of_its_own(log: TrajectoryLog, tmp_path: Path):
    """Two and eight steps beside the five of the horizon, which is not learnt twice."""
    config = better_half(spans_steps=[8, 2, 5, 2])
    learnt = learn_vocabulary(log, config, TASK, seed=0)
    assert list(learnt.spans) == [2, 8]
    for steps, mapping in learnt.spans.items():
        expected = (STEPS + 1 - steps) * np.array([1, 2, 1])
        assert mapping.sizes.tolist() == expected.tolist()
        np.testing.assert_allclose(mapping.centre_changes()[:, 0], [-steps, 0, steps], atol=0.1)
        alone = learn_vocabulary(log, better_half(horizon_steps=steps), TASK, seed=0).mapping
        assert mapping.to_dict() == alone.to_dict()
    assert learnt.mapping.to_dict() == learn_vocabulary(log, better_half(), TASK, seed=0).mapping.to_dict()
    loaded = load_refresh(save_refresh(tmp_path, learnt, config, TASK))
    assert loaded.horizon_steps == 5
    assert loaded.mapping.to_dict() == learnt.mapping.to_dict()
    assert {n: each.to_dict() for n, each in loaded.spans.items()} == {n: m.to_dict() for n, m in learnt.spans.items()}


def test_a_span_longer_than_every_episode_is_left_out(log: TrajectoryLog):
    config = better_half(spans_steps=[2, STEPS + 1], window_end="drop")
    assert list(learn_vocabulary(log, config, TASK, seed=0).spans) == [2]


def test_each_span_remembers_its_own(log: TrajectoryLog):
    config = better_half(spans_steps=[2], memory=0.5)
    first = learn_vocabulary(log, config, TASK, seed=0)
    again = learn_vocabulary(log, config, TASK, 0, {5: first.mapping, **first.spans})
    assert again.mapping.evidence.tolist() == [12, 24, 12]
    assert again.spans[2].evidence.tolist() == [16.5, 33, 16.5]
    forgot = learn_vocabulary(log, config, TASK, 0, {5: first.mapping})
    assert forgot.spans[2].evidence.tolist() == [11, 22, 11]


def test_the_file_is_for_people_too(log: TrajectoryLog, tmp_path: Path):
    saved = json.loads(
        save_refresh(tmp_path, learn_vocabulary(log, better_half(), TASK, 0), better_half(), TASK).read_text()
    )
    assert [cluster["phrase"] for cluster in saved["clusters"]] == ["going down", "staying", "going up"]
    assert [cluster["id"] for cluster in saved["clusters"]] == [0, 1, 2]
    assert saved["clusters"][1] == {
        "id": 1, "size": 16, "mean_instruction": [0.0], "expression": [0.0], "phrase": "staying", "purity": 1.0,
        "evidence": 16.0,
    }  # fmt: skip
    assert saved["episodes"] == {"logged": 8, "counted": 8, "used": 4, "by_context": {"lower": 4, "upper": 0}}
    assert saved["windows"]["used"] == 32
    assert saved["windows"]["by_instruction"] == {"-1": 8, "0": 16, "+1": 8}
    assert saved["state_names"] == ["height", "speed", "floor"]


def damaged(saved: dict[str, Any]) -> dict[str, str]:
    mapping: dict[str, Any] = saved["mapping"]
    values: dict[str, Any] = {
        "list": [],
        "no mapping": {key: value for key, value in saved.items() if key != "mapping"},
        "mapping is a list": saved | {"mapping": []},
        "mapping lacks centres": saved | {"mapping": {k: v for k, v in mapping.items() if k != "centres"}},
        "words for numbers": saved | {"mapping": mapping | {"sizes": ["a", "b", "c"]}},
        "no space": saved | {"mapping": mapping | {"space": None}},
        "no spans": {key: value for key, value in saved.items() if key != "spans"},
        "a span without steps": saved | {"spans": [{"mapping": mapping}]},
        "a damaged span": saved | {"spans": [{"horizon_steps": 2, "mapping": {}}]},
        "no calibration": {key: value for key, value in saved.items() if key != "calibration"},
        "a damaged calibration": saved | {"calibration": {"names": ["agreement"]}},
        "other shapes": saved | {"mapping": mapping | {"sizes": [1]}},
        "flat centres": saved | {"mapping": mapping | {"centres": [1, 2, 3]}},
        "no frame": saved | {"frame": None},
        "reactions of nothing": saved | {"reactions": {}},
        "reactions are a list": saved | {"reactions": [1]},
        "reactions one way only": saved | {"reactions": {"up": [[[1]]]}},
        "reactions of other shapes": saved | {"reactions": {"up": [[[1]]], "down": [[[1, 2]]]}},
        "endless reactions": saved | {"reactions": {"up": [[[math.inf]]], "down": [[[1]]]}},
    }
    return {name: json.dumps(value) for name, value in values.items()} | {
        "empty": "",
        "cut short": json.dumps(saved)[:99],
    }


@pytest.mark.parametrize("how", [*damaged({"mapping": {}}), "missing", "not text"])
def test_a_damaged_file_is_refused(log: TrajectoryLog, tmp_path: Path, how: str):
    path = save_refresh(tmp_path, learn_vocabulary(log, better_half(), TASK, 0), better_half(), TASK)
    if how == "missing":
        path.unlink()
    elif how == "not text":
        path.write_bytes(b"\xff\xfe\x00")
    else:
        path.write_text(damaged(json.loads(path.read_text()))[how])
    with pytest.raises(ValueError, match=f"{path} is not a readable refresh"):
        load_refresh(path)


def test_instructions_of_several_numbers_are_counted_each():
    """By what the number is about and its value."""
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(0, 1), explained_band=(1, 1), explained_range=())
    counts = fitting._count_instructions(np.array([[1.0, 0], [1, -1], [0, -1]]), both)
    assert counts == {"height -1": 0, "height 0": 1, "height +1": 2, "speed -1": 2, "speed 0": 1, "speed +1": 0}


@pytest.mark.parametrize("damaged", [[{"motion_auc": 2}], [{"motion_auc": "high"}], [3], 3])
def test_scores_that_are_none_are_refused(log: TrajectoryLog, tmp_path: Path, damaged: object):
    path = save_refresh(tmp_path, learn_vocabulary(log, better_half(), TASK, 0), better_half(), TASK)
    assert load_refresh(path).scores_of_numbers == []  # this one was never scored
    saved = json.loads(path.read_text())
    path.write_text(json.dumps(saved | {"scores_of_numbers": damaged}))
    with pytest.raises(ValueError, match="is not a readable refresh"):
        load_refresh(path)


def test_undefined_scores_come_back_so(log: TrajectoryLog, tmp_path: Path):
    learnt = replace(learn_vocabulary(log, better_half(), TASK, 0), scores_of_numbers=[{"motion_auc": float("nan")}])
    [read] = load_refresh(save_refresh(tmp_path, learnt, better_half(), TASK)).scores_of_numbers
    assert np.isnan(read["motion_auc"])


def answers(up: float = 5.0) -> Reactions:
    """At twelve moments it goes up when told so and down when told so, more or less."""
    went = np.zeros((12, 1, 3))
    went[:, 0, 0] = up + np.linspace(-0.1, 0.1, 12)
    return Reactions(went, -went)


def test_reactions_come_back_from_the_file(log: TrajectoryLog, tmp_path: Path):
    learnt = learn_vocabulary(log, better_half(), TASK, 0, reactions=answers())
    assert learnt.reactions is not None
    path = save_refresh(tmp_path, learnt, better_half(), TASK)
    read = load_refresh(path).reactions
    assert read is not None
    np.testing.assert_array_equal(read.up, answers().up)
    np.testing.assert_array_equal(read.down, answers().down)
    unasked = learn_vocabulary(log, better_half(), TASK, 0)
    assert unasked.reactions is None
    assert load_refresh(save_refresh(tmp_path, unasked, better_half(), TASK)).reactions is None
    earlier = {key: value for key, value in json.loads(path.read_text()).items() if key != "reactions"}
    path.write_text(json.dumps(earlier))
    assert load_refresh(path).reactions is None


def test_reactions_are_evidence_of_what_the_words_mean(log: TrajectoryLog):
    for _ in range(4):
        obey(log)

    def influence(reactions: Reactions | None) -> list[int]:
        [meaning] = learn_vocabulary(log, better_half(meaning="tested"), TASK, 0, reactions=reactions).mapping.meanings
        return [one.sign for one in meaning.evidence if one.source == "influence"]

    assert influence(None) == []
    assert influence(answers(0.0)) == [0]
    [obeys], [opposes] = influence(answers()), influence(answers(-5.0))
    assert obeys == -opposes != 0
