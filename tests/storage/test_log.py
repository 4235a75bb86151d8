"""The log joins what belongs together, keeps the newest whole, and opens without running code."""

import json
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.log_columns import INDEX
from ibe_rl.types import Array, Episode

CONTEXTS = ("even", "odd")
FILES = ("log.json", "episodes.npy", "state.npy", "action.npy", "reward.npy", "instruction.npy", "given.npy")
REFUSED = pytest.raises(ValueError, match="is not a readable log")


def context_of(state: Array) -> str:
    return CONTEXTS[int(state[0]) % 2]


def make_episode(number: int, steps: int) -> dict[str, Array]:
    """Steps of an episode whose every number says where it belongs."""
    random = np.random.default_rng(number)
    states = np.column_stack([np.full(steps + 1, number), np.arange(steps + 1)]).astype(np.float32)
    last = np.arange(steps) == steps - 1
    return {
        "state": states[:-1],
        "action": random.integers(0, 4, steps),
        "reward": random.normal(size=steps).astype(np.float32),
        "instruction": random.integers(-1, 2, (steps, 1)).astype(np.float32),
        "given": random.random(steps) < 0.5,
        "next_state": states[1:],
        "done": last,
        "terminated": last & (number % 3 > 0),
        "success": last & (number % 3 == 2),
        "episode": np.full(steps, number),
    }


def joined(parts: list[dict[str, Array]], together: Any) -> dict[str, Array]:
    return {name: together([part[name] for part in parts]) for name in parts[0]}


def experience(seed: int, rows: int, total: int, longest: int) -> tuple[dict[str, Array], list[dict[str, Array]]]:
    """Steps ``(rows, total, ...)`` and the episodes in them, unfinished ones too."""
    random, episodes, lines = np.random.default_rng(seed), [], []
    for _ in range(rows):
        line: list[dict[str, Array]] = []
        while sum(len(one["done"]) for one in line) < total:
            line.append(make_episode(len(episodes), int(random.integers(1, longest + 1))))
            episodes.append(line[-1])
        lines.append({name: column[:total] for name, column in joined(line, np.concatenate).items()})
    return joined(lines, np.stack), episodes


def fill(log: TrajectoryLog, steps: dict[str, Array], cuts: list[int]) -> list[list[int]]:
    """Add the steps batch by batch; returns the episodes that ended in each, in any order of rows."""
    ended = []
    for start, stop in pairwise(cuts):
        batch = {name: column[:, start:stop] for name, column in steps.items()}
        records = log.add(batch, context_of)
        done = batch["done"]
        ended.append([int(number) for row in range(len(done)) for number in batch["episode"][row][done[row]]])
        assert len(records) == len(ended[-1])
    return ended


def assert_same(read: Episode, made: dict[str, Array]) -> None:
    for name in ("action", "reward", "instruction", "given"):
        np.testing.assert_array_equal(getattr(read, name if name == "given" else name + "s"), made[name])
    np.testing.assert_array_equal(read.states, np.concatenate([made["state"], made["next_state"][-1:]]))
    assert (read.terminated, read.success) == (made["terminated"][-1], made["success"][-1])
    assert read.context == context_of(made["state"][0])


def assert_holds(log: TrajectoryLog, episodes: list[dict[str, Array]], numbers: list[int]) -> None:
    """Assert that exactly the episodes called ``numbers`` are in the log, in this order, whole."""
    read = log.read(range(len(log.index)))
    assert [int(one.states[0, 0]) for one in read] == numbers
    for record, name, one, number in zip(log.index, log.context_names, read, numbers, strict=True):
        assert_same(one, episodes[number])
        assert record["steps"] == len(one)
        assert record["total_reward"] == pytest.approx(one.total_reward, abs=1e-12)
        assert (record["terminated"], record["success"], name) == (one.terminated, one.success, one.context)


@pytest.mark.parametrize("seed", range(6))
def test_episodes_are_joined_however_the_batches_are_cut(seed: int, tmp_path: Path):
    steps, episodes = experience(seed, rows=3, total=120, longest=25)
    random = np.random.default_rng(seed)
    cuts = [0, *sorted(random.choice(np.arange(1, 120), size=12, replace=False).tolist()), 120]
    log = TrajectoryLog(tmp_path, 10_000, CONTEXTS)
    ended = [number for batch in fill(log, steps, cuts) for number in batch]
    assert len(ended) > 15
    assert_holds(log, episodes, ended)
    assert log.frames == 360
    assert log.episodes_ended == len(ended)


def test_an_episode_is_noted_at_the_frames_seen_when_it_ended(tmp_path: Path):
    steps, _ = experience(0, rows=2, total=60, longest=10)
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    ended = fill(log, steps, [0, 20, 60])
    assert log.index["frame"].tolist() == [40] * len(ended[0]) + [120] * len(ended[1])
    assert log.index.dtype == INDEX


def test_what_is_not_whole_is_not_there(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    steps = joined([make_episode(1, 30)], np.stack)
    assert len(log.add({name: column[:, :29] for name, column in steps.items()}, context_of)) == 0
    assert (log.frames, log.episodes_ended, len(log.index), log.read([])) == (29, 0, 0, [])
    assert len(log.add({name: column[:, 29:] for name, column in steps.items()}, context_of)) == 1
    assert len(log.read([0])[0]) == 30


def test_the_batch_may_be_used_again(tmp_path: Path):
    """A collector fills the same memory with the next batch."""
    log, made = TrajectoryLog(tmp_path, 1_000, CONTEXTS), make_episode(1, 20)
    memory = {name: column[None, :10].copy() for name, column in made.items()}
    for start in (0, 10):
        for name, column in made.items():
            memory[name][:] = column[None, start : start + 10]
        log.add(memory, context_of)
    assert_same(log.read([0])[0], made)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("capacity", [31, 60, 200])
def test_the_oldest_make_room_and_what_stays_is_whole(seed: int, capacity: int, tmp_path: Path):
    longest, total = 30, 150
    steps, episodes = experience(seed, rows=4, total=total, longest=longest)
    log, all_ended = TrajectoryLog(tmp_path, capacity, CONTEXTS), []
    cuts = [0, *np.cumsum(np.random.default_rng(seed).integers(1, 20, 30)).tolist()]
    cuts = [cut for cut in cuts if cut < total] + [total]
    for start, stop in pairwise(cuts):
        all_ended += fill(log, steps, [start, stop])[0]
        kept = len(log.index)
        assert_holds(log, episodes, all_ended[len(all_ended) - kept :])
        rows = int(log.index["steps"].sum()) + kept
        assert rows <= capacity
        if kept < len(all_ended):  # no more room is made than needed
            assert rows > capacity - 2 * (longest + 1)
    assert log.episodes_ended == len(all_ended) > len(log.index) > 0


def test_what_was_read_stays_when_its_place_is_taken(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 25, CONTEXTS)
    log.add(joined([make_episode(1, 20)], np.stack), context_of)
    [first] = log.read([0])
    log.add(joined([make_episode(2, 20)], np.stack), context_of)
    assert_same(first, make_episode(1, 20))
    assert len(log.index) == 1


def test_a_log_opened_while_it_grows_shows_no_damaged_episode(tmp_path: Path):
    """Also that of a run which was killed between two flushes."""
    steps, episodes = experience(5, rows=4, total=150, longest=30)
    log = TrajectoryLog(tmp_path, 200, CONTEXTS)
    fill(log, steps, [0, 60])
    log.flush()
    fill(log, steps, [60, 90])
    opened = TrajectoryLog.open(tmp_path)
    for one in opened.read(range(len(opened.index))):
        assert_same(one, episodes[int(one.states[0, 0])])


def test_a_row_that_does_not_go_on_is_a_mistake(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    steps = joined([make_episode(1, 30), make_episode(2, 30)], np.stack)
    log.add({name: column[:, :10] for name, column in steps.items()}, context_of)
    backwards = {name: np.stack([column[0, 10:], column[1, :9:-1]]) for name, column in steps.items()}
    with pytest.raises(ValueError, match="row 1 does not go on where it stopped"):
        log.add(backwards, context_of)


@pytest.mark.parametrize("seed", range(4))
def test_a_log_that_is_taken_up_goes_on_as_if_nothing_had_been(seed: int, tmp_path: Path):
    """Also where it had gone on after its state was taken, and in the folder that it had gone on in."""
    steps, episodes = experience(seed, rows=3, total=200, longest=25)
    whole, log = (TrajectoryLog(tmp_path / name, 300, CONTEXTS) for name in ("whole", "log"))
    ended = [number for batch in fill(whole, steps, [0, 90, 120, 200]) for number in batch]
    fill(log, steps, [0, 90])
    state = deepcopy(log.state_dict())
    fill(log, steps, [90, 120])
    again = TrajectoryLog(tmp_path / "log", 300, CONTEXTS)
    again.load_state_dict(state)
    assert again.frames == 270
    fill(again, steps, [90, 120, 200])
    assert_holds(again, episodes, ended[-len(again.index) :])
    for log in (whole, again):
        log.flush()
    np.testing.assert_array_equal(again.index, whole.index)
    assert (again.frames, again.episodes_ended) == (whole.frames, whole.episodes_ended)
    for mine, other in zip(again.partial_episodes(), whole.partial_episodes(), strict=True):
        assert mine.ended == other.ended
        np.testing.assert_array_equal(mine.actions, other.actions)
        np.testing.assert_array_equal(mine.state, other.state)


def test_a_state_whose_rows_do_not_fit_is_refused(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    log.add({name: column[None, :10] for name, column in make_episode(1, 30).items()}, context_of)
    state = log.state_dict() | {"open_steps": [11]}
    with pytest.raises(ValueError, match="its rows are 11 steps long"):
        TrajectoryLog(tmp_path, 1_000, CONTEXTS).load_state_dict(state)


def test_where_each_row_stands(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    line, ended = joined([make_episode(1, 5), make_episode(2, 20)], np.concatenate), make_episode(3, 10)
    log.add({name: np.stack([line[name][:10], ended[name]]) for name in line}, context_of)
    first, second = log.partial_episodes()
    assert (first.ended, second.ended) == (1, 1)
    np.testing.assert_array_equal(first.actions, line["action"][5:10])
    np.testing.assert_array_equal(first.state, [2, 5])
    assert (len(second.actions), second.state) == (0, None)


def test_an_episode_that_could_not_be_taken_up_counts_as_played_and_is_not_kept(tmp_path: Path):
    log = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    log.add({name: column[None, :10] for name, column in make_episode(1, 30).items()}, context_of)
    again = TrajectoryLog(tmp_path, 1_000, CONTEXTS)
    again.load_state_dict(log.state_dict())
    other = make_episode(2, 20)
    again.add({name: column[None] for name, column in other.items()}, context_of)
    assert_same(again.read([0])[0], other)
    assert (len(again.index), again.partial_episodes()[0].ended) == (1, 2)


def test_a_state_without_some_of_its_files_is_refused(saved: TrajectoryLog):
    (saved.folder / "state.npy").unlink()
    with REFUSED:
        TrajectoryLog(saved.folder, 200, CONTEXTS).load_state_dict(saved.state_dict())


def test_a_state_without_any_of_its_files_goes_on_empty(saved: TrajectoryLog, tmp_path: Path):
    """They were moved out of the way because they are damaged."""
    log = TrajectoryLog(tmp_path / "other", 200, CONTEXTS)
    log.load_state_dict(saved.state_dict())
    assert (len(log.index), log.frames, log.episodes_ended) == (0, saved.frames, saved.episodes_ended)


@pytest.fixture
def saved(tmp_path: Path) -> TrajectoryLog:
    steps, _ = experience(3, rows=3, total=150, longest=20)
    log = TrajectoryLog(tmp_path / "log", 200, CONTEXTS)
    fill(log, steps, [0, 70, 150])
    log.flush()
    return log


def test_an_opened_log_is_the_one_that_was_flushed(saved: TrajectoryLog):
    opened = TrajectoryLog.open(saved.folder)
    assert len(opened.index) > 5
    np.testing.assert_array_equal(opened.index, saved.index)
    assert opened.context_names.tolist() == saved.context_names.tolist()
    for name in ("frames", "episodes_ended", "capacity_frames", "contexts"):
        assert getattr(opened, name) == getattr(saved, name)
    for one, other in zip(opened.read(range(len(opened.index))), saved.read(range(len(saved.index))), strict=True):
        for name in ("states", "actions", "rewards", "instructions", "given"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert (one.terminated, one.success, one.context) == (other.terminated, other.success, other.context)


def test_a_log_without_an_episode_opens_empty(tmp_path: Path):
    TrajectoryLog(tmp_path, 100, CONTEXTS).flush()
    assert len(TrajectoryLog.open(tmp_path).index) == 0


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_refused(saved: TrajectoryLog, name: str):
    (saved.folder / name).unlink()
    with REFUSED:
        TrajectoryLog.open(saved.folder)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("keep", [0, 4, 60, -1])
def test_a_file_cut_short_is_refused(saved: TrajectoryLog, name: str, keep: int):
    path = saved.folder / name
    path.write_bytes(path.read_bytes()[:keep] if keep >= 0 else path.read_bytes()[:-30])
    with REFUSED:
        TrajectoryLog.open(saved.folder)


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_something_else_is_refused(saved: TrajectoryLog, name: str):
    (saved.folder / name).write_bytes(b"\x80\x04 this is not it " * 20)
    with REFUSED:
        TrajectoryLog.open(saved.folder)


@pytest.mark.parametrize("about", [[], {}, {"contexts": None}, {"capacity_frames": "many"}])
def test_another_json_is_refused(saved: TrajectoryLog, about: Any):
    path = saved.folder / "log.json"
    whole = json.loads(path.read_text())
    path.write_text(json.dumps(whole | about if about else about))
    with REFUSED:
        TrajectoryLog.open(saved.folder)


class Trap:
    """Would leave a file behind if it were unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".npy")])
def test_no_code_from_a_log_runs(saved: TrajectoryLog, name: str, tmp_path: Path):
    sprung = tmp_path / "sprung"
    np.save(saved.folder / name, np.array([Trap(sprung)], dtype=object), allow_pickle=True)
    with REFUSED:
        TrajectoryLog.open(saved.folder)
    assert not sprung.exists()


def test_a_folder_that_is_not_there_is_not_made(tmp_path: Path):
    with REFUSED:
        TrajectoryLog.open(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()
