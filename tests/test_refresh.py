"""A vocabulary is learnt from the best episodes of a log made by hand, and comes back from its file."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, add

from ibe_rl import refresh as module
from ibe_rl.config import MappingConfig
from ibe_rl.data import ConfigError
from ibe_rl.ibe import PaperMapping, TooLittleDataError, Transition
from ibe_rl.log import TrajectoryLog
from ibe_rl.metrics import VocabularyDrift
from ibe_rl.refresh import Change, Refresh, check_mapping, learn_vocabulary, load_mapping, save_refresh


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    """Four good episodes below, worse ones above: told up, down, still, still."""
    made = TrajectoryLog(tmp_path / "log", 1_000, TASK.contexts)
    for floor, base in ((0, 100.0), (1, 50.0)):
        for rank, told in enumerate((1.0, -1.0, 0.0, 0.0)):
            add(made, base - rank, told, floor)
    return made


def config(**changes: Any) -> MappingConfig:
    settings = {"horizon_steps": 5, "n_clusters": 3, "top_fraction": 0.5, "window_end": "drop"}
    return MappingConfig(**(settings | changes))


def test_the_vocabulary_says_what_was_done_when_it_was_told(log: TrajectoryLog):
    learnt = learn_vocabulary(log, config(), TASK, seed=0)
    windows = STEPS + 1 - 5
    assert learnt.mapping.mean_instructions[:, 0].tolist() == [-1, 0, 1]
    assert learnt.mapping.expressions[:, 0].tolist() == [-1, 0, 1]
    assert learnt.mapping.sizes.tolist() == [windows, 2 * windows, windows]
    assert learnt.mapping.express(np.array([[4.9, 0, 0], [-5.1, 0, 0], [0.1, 0, 0]]))[:, 0].tolist() == [1, -1, 0]


def test_it_says_what_it_stands_on(log: TrajectoryLog):
    learnt = learn_vocabulary(log, config(), TASK, seed=0)
    assert learnt.frame == log.frames == 8 * STEPS
    assert (learnt.episodes_logged, learnt.episodes_used) == (8, 4)
    assert learnt.episodes_by_context == {"lower": 4, "upper": 0}
    assert learnt.windows_by_context == {"lower": 32, "upper": 0}
    assert learnt.windows_by_instruction == {"-1": 8, "0": 16, "+1": 8}
    assert len(learnt.top) == len(learnt.others) == 32
    assert set(learnt.top.delta[:, 0].round()) == {-5, 0, 5}


def test_the_best_can_be_taken_within_each_context(log: TrajectoryLog):
    learnt = learn_vocabulary(log, config(top_within="context", n_clusters=2), TASK, seed=0)
    assert learnt.episodes_by_context == {"lower": 2, "upper": 2}
    assert learnt.windows_by_context == {"lower": 16, "upper": 16}
    assert learnt.windows_by_instruction == {"-1": 16, "0": 0, "+1": 16}


def test_clamped_windows_begin_at_every_step(log: TrajectoryLog):
    learnt = learn_vocabulary(log, config(window_end="clamp"), TASK, seed=0)
    assert learnt.windows_by_context == {"lower": 4 * STEPS, "upper": 0}
    assert len(learnt.others) == 4 * STEPS


def test_windows_without_an_instruction_are_not_learnt_from(log: TrajectoryLog):
    add(log, 1000, 1.0, given=False)  # the best of all
    learnt = learn_vocabulary(log, config(), TASK, seed=0)
    assert (learnt.episodes_logged, learnt.episodes_used) == (9, 5)
    assert len(learnt.top) == 32
    assert learnt.top.given.all()
    assert learnt.windows_by_instruction == {"-1": 8, "0": 16, "+1": 8}


def test_the_others_are_a_sample_for_comparison(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "OTHER_EPISODES", 2)
    assert len(learn_vocabulary(log, config(), TASK, seed=0).others) == 16
    assert len(learn_vocabulary(log, config(top_fraction=1.0), TASK, seed=0).others) == 0


def test_the_dimensions_of_the_config_are_clustered_on(log: TrajectoryLog):
    mapping = learn_vocabulary(log, config(dimensions=["height"]), TASK, seed=0).mapping
    assert (mapping.weight > 0).tolist() == [True, False, False]


@pytest.mark.parametrize(("how", "expressions"), [("minmax", [-1, 1]), ("sign", [0, 1])])
def test_the_normalisation_is_the_configs(tmp_path: Path, how: str, expressions: list[float]):
    upwards = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    add(upwards, 1, 1.0)
    add(upwards, 1, 0.0)
    learnt = learn_vocabulary(upwards, config(normalisation=how, n_clusters=2, top_fraction=1.0), TASK, seed=0)
    assert learnt.mapping.expressions[:, 0].tolist() == expressions


def test_the_same_seed_learns_the_same(log: TrajectoryLog):
    many = config(n_clusters=6, top_fraction=1.0)
    one, other = (learn_vocabulary(log, many, TASK, seed=3).mapping for _ in range(2))
    assert len(one.sizes) == 6
    assert one.to_dict() == other.to_dict()


def test_a_refresh_starts_where_the_last_one_ended(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    last = learn_vocabulary(log, config(), TASK, seed=0).mapping
    starts = []
    monkeypatch.setattr(module, "PaperMapping", lambda **settings: starts.append(settings) or PaperMapping(**settings))
    again = learn_vocabulary(log, config(memory=0.0), TASK, 0, last).mapping
    learn_vocabulary(log, config(memory=0.5), TASK, 0, last)
    learn_vocabulary(log, config(memory=None), TASK, 0, last)
    learn_vocabulary(log, config(), TASK, 0)
    assert [settings["last"] for settings in starts] == [last, last, None, None]
    assert [settings["memory"] for settings in starts] == [0, 0.5, 0, config().memory]
    for name in last.__dataclass_fields__:
        np.testing.assert_allclose(getattr(again, name), getattr(last, name), atol=1e-12)


@pytest.mark.parametrize(
    ("newest_frames", "counted"), [(None, 8), (96, 8), (85, 8), (84, 7), (48, 4), (37, 4), (36, 3), (25, 3)]
)
def test_only_what_ended_in_the_newest_frames_counts(log: TrajectoryLog, newest_frames: int | None, counted: int):
    """Eight episodes of twelve frames ended at frame 12, 24, ... 96; the newest 84 frames are 13 to 96."""
    learnt = learn_vocabulary(log, config(newest_frames=newest_frames, n_clusters=2), TASK, seed=0)
    assert (learnt.episodes_logged, learnt.episodes_counted) == (8, counted)
    assert learnt.episodes_used == np.ceil(counted / 2)


def test_the_best_and_the_others_are_of_those_that_count(log: TrajectoryLog):
    """The upper floor was flown last, and worse than the lower one."""
    learnt = learn_vocabulary(log, config(newest_frames=60, n_clusters=2), TASK, seed=0)
    assert learnt.episodes_counted == 5
    assert learnt.episodes_by_context == {"lower": 1, "upper": 2}
    assert len(learnt.others) == 2 * (STEPS + 1 - 5)
    within = learn_vocabulary(log, config(newest_frames=60, n_clusters=2, top_within="context"), TASK, seed=0)
    assert within.episodes_by_context == {"lower": 1, "upper": 2}
    assert len(within.others) == 2 * (STEPS + 1 - 5)


def test_if_nothing_ended_lately_nothing_is_learnt(log: TrajectoryLog):
    log.frames += 100  # an episode that is still flown
    with pytest.raises(TooLittleDataError, match="no episode has ended in the newest 100 frames"):
        learn_vocabulary(log, config(newest_frames=100), TASK, seed=0)
    assert learn_vocabulary(log, config(newest_frames=101, n_clusters=2), TASK, seed=0).episodes_counted == 1


def changed(last: Refresh, refresh: Refresh, taken: bool, staleness: float = 0.25) -> Refresh:
    """What ``Development`` makes of a refresh, in numbers that can be told apart."""
    change = Change(
        last=last.mapping,
        since_frame=48,
        transition=Transition({0: 0.75, 2: 0.5}, (1,), (3,)),
        drift=VocabularyDrift(0.125, 0.5, 0.375),
        policy_drift=0.0625,
        last_scores={"motion_auc": 0.5, "motion_auc_disobeyed": float("nan")},
        staleness=staleness,
    )
    return replace(refresh, change=change, scores={"motion_auc": 0.75, "instruction_f1": float("nan")}, taken=taken)


def test_the_vocabulary_that_stands_is_the_last_one_that_was_taken(log: TrajectoryLog):
    first, second = (learn_vocabulary(log, config(n_clusters=k), TASK, seed=0) for k in (2, 3))
    assert first.standing is first.mapping
    assert changed(first, second, taken=True).standing is second.mapping
    assert changed(first, second, taken=False).standing is first.mapping


def test_a_change_is_written_down(log: TrajectoryLog, tmp_path: Path):
    refresh = learn_vocabulary(log, config(), TASK, seed=0)
    named = replace(refresh, mapping=replace(refresh.mapping, ids=np.array([0, 3, 2])))
    saved = json.loads(save_refresh(tmp_path, changed(refresh, named, taken=True), config(), TASK).read_text())
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


def test_what_cannot_be_told_of_a_change_is_null(log: TrajectoryLog, tmp_path: Path):
    refresh = learn_vocabulary(log, config(), TASK, seed=0)
    unknown = changed(refresh, refresh, taken=True, staleness=float("nan"))
    assert json.loads(save_refresh(tmp_path, unknown, config(), TASK).read_text())["change"]["staleness"] is None


def test_the_first_vocabulary_changes_nothing(log: TrajectoryLog, tmp_path: Path):
    saved = json.loads(save_refresh(tmp_path, learn_vocabulary(log, config(), TASK, 0), config(), TASK).read_text())
    assert saved["change"] is None
    assert saved["scores"] == {}


def test_evidence_is_written_down_with_what_is_remembered(log: TrajectoryLog, tmp_path: Path):
    last = learn_vocabulary(log, config(), TASK, seed=0).mapping
    again = learn_vocabulary(log, config(memory=0.5), TASK, 0, last)
    saved = json.loads(save_refresh(tmp_path, again, config(), TASK).read_text())
    assert [cluster["size"] for cluster in saved["clusters"]] == [8, 16, 8]
    assert [cluster["evidence"] for cluster in saved["clusters"]] == saved["mapping"]["evidence"] == [12, 24, 12]


def test_without_an_episode_nothing_is_learnt(tmp_path: Path):
    empty = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        learn_vocabulary(empty, config(), TASK, seed=0)


def test_too_short_episodes_are_too_little(log: TrajectoryLog):
    with pytest.raises(
        TooLittleDataError, match=r"the best 4 of 8 episodes have no window of 20 .*the longest has 12 steps"
    ):
        learn_vocabulary(log, config(horizon_steps=20), TASK, seed=0)


def test_silence_is_too_little(tmp_path: Path):
    silent = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    for told in (1.0, -1.0, 0.0):
        add(silent, 1, told, given=False)
    with pytest.raises(TooLittleDataError, match="have no window of 5 steps with an instruction"):
        learn_vocabulary(silent, config(), TASK, seed=0)


def test_more_clusters_than_windows_are_too_little(log: TrajectoryLog):
    with pytest.raises(TooLittleDataError, match="32 distinct windows for n_clusters=40"):
        learn_vocabulary(log, config(n_clusters=40), TASK, seed=0)


def test_a_horizon_longer_than_any_episode_is_refused():
    check_mapping(config(horizon_steps=100), TASK)
    with pytest.raises(ConfigError, match=r"mapping\.horizon_steps=101: allowed is at most 100"):
        check_mapping(config(horizon_steps=101), TASK)


def test_an_unknown_dimension_is_refused():
    check_mapping(config(dimensions=["height", "floor"]), TASK)
    with pytest.raises(
        ConfigError, match=r"mapping\.dimensions=\['height', 'colour'\]: allowed are height, speed, floor"
    ):
        check_mapping(config(dimensions=["height", "colour"]), TASK)


def test_a_saved_vocabulary_comes_back(log: TrajectoryLog, tmp_path: Path):
    learnt = learn_vocabulary(log, config(), TASK, seed=0)
    path = save_refresh(tmp_path, learnt, config(), TASK)
    assert path.name == f"{96:012d}.json"
    mapping, horizon, frame = load_mapping(path)
    assert (horizon, frame) == (5, 96)
    for name in mapping.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(mapping, name), getattr(learnt.mapping, name))


def test_the_file_is_for_people_too(log: TrajectoryLog, tmp_path: Path):
    saved = json.loads(save_refresh(tmp_path, learn_vocabulary(log, config(), TASK, 0), config(), TASK).read_text())
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
        "words for numbers": saved | {"mapping": mapping | {"mean": ["a", "b", "c"]}},
        "other shapes": saved | {"mapping": mapping | {"sizes": [1]}},
        "flat centres": saved | {"mapping": mapping | {"centres": [1, 2, 3]}},
        "no frame": saved | {"frame": None},
    }
    return {name: json.dumps(value) for name, value in values.items()} | {
        "empty": "",
        "cut short": json.dumps(saved)[:99],
    }


@pytest.mark.parametrize("how", [*damaged({"mapping": {}}), "missing", "not text"])
def test_a_damaged_file_is_refused(log: TrajectoryLog, tmp_path: Path, how: str):
    path = save_refresh(tmp_path, learn_vocabulary(log, config(), TASK, 0), config(), TASK)
    if how == "missing":
        path.unlink()
    elif how == "not text":
        path.write_bytes(b"\xff\xfe\x00")
    else:
        path.write_text(damaged(json.loads(path.read_text()))[how])
    with pytest.raises(ValueError, match=f"{path} is not a readable refresh"):
        load_mapping(path)


def test_instructions_of_several_numbers_are_counted_each():
    """By the place of the number and its value."""
    counts = module._count_instructions(np.array([[1.0, 0], [1, -1], [0, -1]]), TASK)
    assert counts == {"0: -1": 0, "0: 0": 1, "0: +1": 2, "1: -1": 2, "1: 0": 1, "1: +1": 0}


def test_the_same_seed_draws_the_same_others(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "OTHER_EPISODES", 1)
    drawn = [learn_vocabulary(log, config(), TASK, seed).others.delta for seed in (0, 0, *range(1, 6))]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert any((drawn[0] != other).any() for other in drawn[2:])
