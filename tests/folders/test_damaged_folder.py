"""Whatever is damaged in the folder of a run, opening it ends in one clear line, or well."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from damage import chance_of, damaged, damaged_json, damaged_value, refusal
from opening import WAYS, explained, log, resumed, viewed

from ibe_rl.ibe import ClusterMapping
from ibe_rl.storage.checkpoint import load
from ibe_rl.storage.log_columns import INDEX

COLUMNS = ("number", "state", "action", "reward", "instruction", "given")
OPENED = {
    ".hydra/config.yaml": ("explained",),
    ".hydra/overrides.yaml": ("viewed",),
    "checkpoints/policy_*.pt": ("explained",),
    "checkpoints/latest.pt": ("resumed",),
    "refreshes/*.json": ("explained",),
    "evaluation/calibration.json": ("explained",),
    "trajectories/log.json": ("log",),
    "trajectories/episodes.npy": ("log",),
    **{f"trajectories/{name}.npy": ("log", "resumed") for name in COLUMNS},
    "metrics.csv": ("tabled",),
    "recording.rrd": ("viewed",),
    "lesson.jsonl": ("lesson",),
}
"""Files of a run, and the ways in which each is opened."""


@pytest.fixture(scope="module")
def whole(trained: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with all that a run can have."""
    folder = Path(shutil.copytree(trained, tmp_path_factory.mktemp("more") / "run"))
    (folder / "evaluation").mkdir()
    names = '"names": ["agreement", "purity"], "mean": [0.5, 0.5], "scale": [1, 1]'
    frame = int(max(folder.glob("refreshes/*.json")).stem)
    (folder / "evaluation" / "calibration.json").write_text(
        f'{{"mapping_frame": {frame}, "horizon_steps": 20, '
        f'"calibration": {{{names}, "coefficients": [1, 1], "intercept": [0]}}}}'
    )
    line = '{"episode": 0, "instructions": [[0], [1]], "given": [0, 1], "by": ["nobody", "person"], "heard": [0, 1]}\n'
    (folder / "lesson.jsonl").write_text(line)
    return folder


def test_a_whole_run_is_opened_in_all_ways(whole: Path):
    for name, way in WAYS.items():
        assert refusal(lambda way=way: way(whole)) is None, name


def file_of(run: Path, pattern: str) -> Path:
    return max(run.glob(pattern))


@pytest.mark.parametrize(("pattern", "way"), [(name, way) for name, ways in OPENED.items() for way in ways])
def test_bytes_are_damaged(whole: Path, tmp_path: Path, pattern: str, way: str):
    damage_again_and_again(whole, tmp_path, pattern, way, rounds=8 if way == "resumed" else 25)


@pytest.mark.soak
@pytest.mark.parametrize(("pattern", "way"), [(name, way) for name, ways in OPENED.items() for way in ways])
def test_bytes_are_damaged_many_times(whole: Path, tmp_path: Path, pattern: str, way: str):
    damage_again_and_again(whole, tmp_path, pattern, way, rounds=100 if way == "resumed" else 1_000)


def damage_again_and_again(whole: Path, tmp_path: Path, pattern: str, way: str, rounds: int) -> None:
    run = Path(shutil.copytree(whole, tmp_path / "run"))
    path, refused = file_of(run, pattern), 0
    data = path.read_bytes()
    for seed in range(rounds):
        chance = chance_of(pattern, seed)
        as_text = path.suffix in (".json", ".jsonl") and seed % 2
        path.write_bytes(damaged_json(data.decode(), chance).encode() if as_text else damaged(data, chance))
        refused += refusal(lambda: WAYS[way](run)) is not None
    assert refused or way in ("viewed", "resumed")  # less is shown then; what is learnt from is not all looked at


@pytest.mark.parametrize("seed", range(20))
def test_settings_are_of_another_kind(run: Path, seed: int):
    path, chance = run / ".hydra/config.yaml", chance_of(seed)
    path.write_text(yaml.safe_dump(damaged_value(yaml.safe_load(path.read_text()), chance)))
    refusal(lambda: explained(run))


@pytest.mark.parametrize("seed", range(30))
def test_a_state_is_of_another_kind(run: Path, seed: int):
    path, chance = run / "checkpoints/latest.pt", chance_of(seed)
    torch.save(damaged_value(torch.load(path, weights_only=True), chance), path)
    refusal(lambda: resumed(run))


def test_every_part_of_a_state_is_missed(run: Path):
    path = run / "checkpoints/latest.pt"
    state = torch.load(path, weights_only=True)
    for name in state:
        torch.save({key: value for key, value in state.items() if key != name}, path)
        said = refusal(lambda: resumed(run))
        assert said is not None, name
        assert "of this version of ibe_rl" in said


@pytest.mark.parametrize("name", INDEX.names or ())
@pytest.mark.parametrize("value", [-(2**63), -1, 10**12, 2**63 - 1])
def test_the_index_of_the_log_says_otherwise(run: Path, name: str, value: int):
    path = run / "trajectories/episodes.npy"
    index = np.load(path)
    index[name][len(index) // 2] = value
    np.save(path, index)
    said = refusal(lambda: log(run))
    assert said is None or "is not a readable log" in said
    if name in ("start", "context"):
        assert said is not None
        assert "rows or contexts that are not there" in said


Change = Callable[[Any], Any]
OTHERS: dict[str, Change] = {
    "other numbers": lambda array: array.astype(complex),
    "words": lambda array: array.astype("S3"),
    "fewer rows": lambda array: array[:50],
    "no rows": lambda array: array[:0],
    "one more dimension": lambda array: array[..., None],
    "one number": lambda array: np.array(array.flat[0]),
}


@pytest.mark.parametrize("name", COLUMNS)
@pytest.mark.parametrize("other", OTHERS)
def test_a_column_of_the_log_is_of_another_kind(run: Path, name: str, other: str):
    path = run / f"trajectories/{name}.npy"
    np.save(path, OTHERS[other](np.load(path)))
    said = refusal(lambda: log(run))
    if (name, other) == ("action", "one more dimension"):
        return  # so are those of other environments
    assert said is not None
    assert "is not a readable log" in said


def head(path: Path, shape: tuple[int, ...]) -> None:
    """Declare more than there is."""
    with path.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": shape})
        stream.write(b"\0" * 1_000)


@pytest.mark.parametrize("name", ["state", "episodes"])
@pytest.mark.parametrize("rows", [10**4, 10**9, 10**12, 10**18, -1])
@pytest.mark.parametrize("way", [log, resumed])
def test_an_array_declares_more_than_there_is(run: Path, name: str, rows: int, way: Change):
    path = run / f"trajectories/{name}.npy"
    head(path, (rows, 9))
    size = path.stat().st_size
    said = refusal(lambda: way(run))
    assert name == "episodes" or (said is not None and "is not a readable array" in said)
    assert path.stat().st_size == size  # and it has not been filled up


def declare_more(path: Path) -> None:
    """Let the first tensor's memory be 250 MB long by its name, with sums that are right."""
    with zipfile.ZipFile(path) as archive:
        parts = {one.filename: archive.read(one) for one in archive.infolist()}
    [name] = [name for name in parts if name.endswith("data.pkl")]
    small = re.search(rb"X\x03\x00\x00\x00cpuq.K(.)t", parts[name], re.DOTALL) or pytest.fail("torch has changed")
    at = small.start(1) - 1
    parts[name] = parts[name][:at] + b"J" + (10**9 // 16).to_bytes(4, "little") + parts[name][at + 2 :]
    with zipfile.ZipFile(path, "w") as archive:
        for one, data in parts.items():
            archive.writestr(one, data)


def test_a_checkpoint_declares_more_than_there_is(run: Path):
    """A sum that is right, and a size that is not: torch alone would read on behind the end of the memory."""
    path = file_of(run, "checkpoints/policy_*.pt")
    weights = {name: value.clone() for name, value in torch.load(path, weights_only=True).items()}
    torch.save(weights, path)
    declare_more(path)
    for value in load(path).values():
        assert value.untyped_storage().nbytes() <= path.stat().st_size
    refusal(lambda: explained(run))


@pytest.mark.parametrize("hidden", [[10**9], [10**12, 10**12], [0], [-3], [16, 16], []])
def test_settings_of_a_network_that_it_has_no_weights_for(run: Path, hidden: list[int]):
    path = run / ".hydra/config.yaml"
    config = yaml.safe_load(path.read_text())
    config["agent"]["hidden"] = hidden
    path.write_text(yaml.safe_dump(config))
    said = refusal(lambda: explained(run))
    assert said is not None
    assert "not a policy of this run" in said


def test_aliases_that_stand_for_more_than_is_written(run: Path):
    bomb = ["a: &a0 [x, x, x, x, x, x, x, x, x]"] + [
        f"b{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)
    ]
    for name in ("config", "overrides"):
        (run / f".hydra/{name}.yaml").write_text("\n".join(bomb) + "\n")
    said = refusal(lambda: explained(run))
    assert said is not None
    assert "an alias (*) in it" in said
    assert refusal(lambda: viewed(run)) is None


@pytest.mark.parametrize("name", ["refreshes", "log"])
def test_json_without_an_end_of_brackets(run: Path, name: str):
    path = run / "trajectories/log.json" if name == "log" else file_of(run, "refreshes/*.json")
    path.write_text("[" * 100_000)
    said = refusal(lambda: log(run))
    assert said is not None
    assert "nested too deeply" in said


def test_yaml_without_an_end_of_brackets(run: Path):
    (run / ".hydra/config.yaml").write_text("[" * 5_000)
    (run / ".hydra/overrides.yaml").write_text("[" * 5_000)
    assert refusal(lambda: explained(run)) is not None
    assert refusal(lambda: viewed(run)) is None


@pytest.mark.parametrize("key", ["centres", "sizes", "ids", "purities"])
def test_numbers_of_a_vocabulary_that_are_none(key: str, whole: Path):
    saved = json.loads(file_of(whole, "refreshes/*.json").read_text())["mapping"]
    bad = np.array(saved[key], float)
    bad.flat[0] = np.nan
    with pytest.raises(ValueError, match="not all of its numbers are finite"):
        ClusterMapping.from_dict(saved | {key: bad.tolist()})
    saved["space"]["mean"][0] = float("inf")
    with pytest.raises(ValueError, match="not all of its numbers are finite"):
        ClusterMapping.from_dict(saved)


@pytest.mark.parametrize("steps", [0, -5, 10**12])
def test_a_vocabulary_of_an_endless_span(run: Path, steps: int):
    path = file_of(run, "refreshes/*.json")
    saved = json.loads(path.read_text())
    for change in ({"horizon_steps": steps}, {"spans": [saved["spans"][0] | {"horizon_steps": steps}]}):
        path.write_text(json.dumps(saved | change))
        said = refusal(lambda: explained(run))
        assert said is not None
        assert f"its vocabulary is for {steps} steps; allowed are 1 to" in said


def test_a_vocabulary_of_more_numbers_than_the_task_has(run: Path):
    path = file_of(run, "refreshes/*.json")
    saved = json.loads(path.read_text())
    twice = {name: [2 * row for row in saved["mapping"][name]] for name in ("expressions", "mean_instructions")}
    path.write_text(json.dumps(saved | {"mapping": saved["mapping"] | twice | {"meanings": [], "membership": "hard"}}))
    said = refusal(lambda: explained(run))
    assert said is not None
    assert "its vocabulary is for 2 numbers in an instruction" in said
