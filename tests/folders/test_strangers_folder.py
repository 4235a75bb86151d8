"""A folder from a stranger in which everything is a trap: opening it runs no code and writes nowhere else."""

from __future__ import annotations

import json
import os
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from damage import refusal
from opening import WAYS
from processes import call

from ibe_rl.view.viewer import open_recordings


class Trap:
    """Leaves a file behind if it is unpickled."""

    def __init__(self, sprung: Path):
        self.sprung = sprung

    def __reduce__(self) -> Any:
        return os.system, (f"touch {self.sprung}",)


Setter = Callable[[Path, Path], None]


def in_checkpoint(path: Path, sprung: Path) -> None:
    torch.save({**torch.load(path, weights_only=True), "trap": Trap(sprung)}, path)


def in_legacy_checkpoint(path: Path, sprung: Path) -> None:
    torch.save({"trap": Trap(sprung)}, path, _use_new_zipfile_serialization=False)


def in_bare_pickle(path: Path, sprung: Path) -> None:
    path.write_bytes(pickle.dumps({"trap": Trap(sprung)}))


def in_torchscript(path: Path, sprung: Path) -> None:
    """An archive that torch would take for a program."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("archive/constants.pkl", pickle.dumps(Trap(sprung)))
        archive.writestr("archive/data.pkl", pickle.dumps(Trap(sprung)))
        archive.writestr("archive/version", "3")


def packed(path: Path, _: Path) -> None:
    """A few bytes that stand for a gigabyte."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\0" * 1_000_000)
        archive.writestr("archive/version", "3")


def large_by_name(path: Path, _: Path) -> None:
    """A few bytes that ask for 40 GB."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02cbuiltins\nbytearray\nI40000000000\n\x85R.")
        archive.writestr("archive/version", "3")


def in_array(path: Path, sprung: Path) -> None:
    np.save(path, np.array([Trap(sprung)], dtype=object), allow_pickle=True)


def in_npz(path: Path, sprung: Path) -> None:
    with path.open("wb") as stream:
        np.savez(stream, delta=np.array([Trap(sprung)], dtype=object))


def as_yaml(path: Path, sprung: Path) -> None:
    path.write_text(f"!!python/object/apply:os.system ['touch {sprung}']\n")


CHECKPOINT = (in_checkpoint, in_legacy_checkpoint, in_bare_pickle, in_torchscript, packed, large_by_name)
ARRAY = (in_array, in_npz, in_bare_pickle)
TRAPS: dict[str, tuple[Setter, ...]] = {
    "checkpoints/*.pt": CHECKPOINT,
    "trajectories/*.npy": ARRAY,
    "refreshes/probe.npz": ARRAY,
    "refreshes/*.json": (in_bare_pickle,),
    ".hydra/*.yaml": (as_yaml, in_bare_pickle),
    "trajectories/log.json": (in_bare_pickle,),
    "metrics.csv": (in_bare_pickle,),
    "recording.rrd": (in_bare_pickle,),
}


@pytest.mark.filterwarnings("ignore:.*looks like a TorchScript archive")
@pytest.mark.parametrize(("pattern", "trap"), [(name, trap) for name, traps in TRAPS.items() for trap in traps])
def test_no_code_from_a_run_is_run(run: Path, tmp_path: Path, pattern: str, trap: Setter):
    sprung = tmp_path / "sprung"
    for path in list(run.glob(pattern)):
        trap(path, sprung)
    said = {name: refusal(lambda way=way: way(run)) for name, way in WAYS.items() if name != "lesson"}
    assert not sprung.exists()
    assert any(said.values()) or pattern == "refreshes/probe.npz"  # which nothing opens


def test_the_traps_are_real_ones(trained: Path, tmp_path: Path):
    sprung, path = tmp_path / "sprung", tmp_path / "file"
    openers: dict[Setter, Callable[[], Any]] = {
        in_legacy_checkpoint: lambda: torch.load(path, weights_only=False),
        in_bare_pickle: lambda: pickle.loads(path.read_bytes()),  # noqa: S301 - a trap that must go off
        in_array: lambda: np.load(path.with_suffix(".npy"), allow_pickle=True),
        in_npz: lambda: np.load(path, allow_pickle=True)["delta"],
        as_yaml: lambda: yaml.unsafe_load(path.read_text()),
    }
    for trap, opener in openers.items():
        trap(path.with_suffix(".npy") if trap is in_array else path, sprung)
        opener()
        assert sprung.exists(), trap
        sprung.unlink()
    checkpoint = tmp_path / "policy.pt"
    checkpoint.write_bytes(next(iter(trained.glob("checkpoints/policy_*.pt"))).read_bytes())
    in_checkpoint(checkpoint, sprung)
    torch.load(checkpoint, weights_only=False)
    assert sprung.exists()


def change_config(run: Path, *keys: str, value: Any) -> None:
    path = run / ".hydra/config.yaml"
    config = yaml.safe_load(path.read_text())
    place = config
    for key in keys[:-1]:
        place = place.setdefault(key, {})
    place[keys[-1]] = value
    path.write_text(yaml.safe_dump(config))


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("_target_",), "os.system"),
        (("agent", "_target_"), "os.system"),
        (("agent", "kind"), "trap:spring"),
        (("instructor", "kind"), "trap:spring"),
        (("mapping", "space"), "trap:spring"),
        (("env", "id"), "trap:Trap-v0"),
        (("env", "id"), "trap:ibe_rl/LunarLanderPads-v0"),
        (("env", "kwargs"), {"_target_": "trap.spring"}),
        (("env", "kwargs"), {"entry_point": "trap:spring"}),
        (("env", "kwargs"), {"pad": {"_target_": "trap.spring", "_args_": []}}),
    ],
)
def test_names_of_code_in_the_settings_are_not_followed(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keys: tuple[str, ...], value: Any
):
    sprung = tmp_path / "sprung"
    (tmp_path / "trap.py").write_text(f"open({str(sprung)!r}, 'w').close()\ndef spring(*_): pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    change_config(run, *keys, value=value)
    for name in ("explained", "resumed"):
        assert refusal(lambda name=name: WAYS[name](run)), name
    assert not sprung.exists()


def test_hydra_settings_in_the_folder_are_not_read(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Nor its overrides taken for settings of this run."""
    sprung = tmp_path / "sprung"
    (run / ".hydra/hydra.yaml").write_text(
        f"hydra: {{callbacks: {{x: {{_target_: os.system, command: 'touch {sprung}'}}}}}}"
    )
    (run / ".hydra/overrides.yaml").write_text(
        f"- hydra.callbacks.x._target_=os.system\n- viewer=off\n- run_dir={sprung}\n"
    )
    call("explain", f"run={run}", "viewer=off", "seed=1")
    assert "as predicted" in capsys.readouterr().out
    assert not sprung.exists()


@pytest.mark.parametrize("name", ["metrics.csv", "checkpoints/latest.pt.partial", ".hydra/lock", "explanations"])
def test_links_to_other_places_are_refused(run: Path, tmp_path: Path, name: str):
    outside = tmp_path / "precious"
    outside.write_text("precious")
    (run / name).unlink(missing_ok=True)
    (run / name).symlink_to(outside)
    for script, key in (("explain", "run"), ("train", "resume")):
        with pytest.raises(SystemExit, match=re.escape(f"error: {run / name}: a link to another place")):
            call(script, f"{key}={run}")
    with pytest.raises(SystemExit):
        open_recordings([str(run)])
    assert outside.read_text() == "precious"


def test_a_pipe_is_refused_and_not_waited_for(run: Path):
    os.mkfifo(run / "viewer.log")
    said = refusal(lambda: WAYS["explained"](run))
    assert said is not None
    assert "viewer.log: neither a file nor a folder" in said


@pytest.mark.parametrize("script", ["explain", "train"])
def test_the_scripts_say_it_in_one_line(run: Path, tmp_path: Path, script: str):
    sprung = tmp_path / "sprung"
    for path in list(run.glob("checkpoints/*.pt")):
        in_checkpoint(path, sprung)
    with pytest.raises(SystemExit, match=r"^error: .*not a readable checkpoint") as ended:
        call(script, f"{'run' if script == 'explain' else 'resume'}={run}")
    assert "\n" not in str(ended.value.code)
    assert not sprung.exists()


def test_text_from_a_folder_is_no_markup(run: Path):
    """What a stranger calls a setting is not taken for a command to the terminal."""
    (run / ".hydra/overrides.yaml").write_text(json.dumps(["seed=\u001b[31mred", "agent=[bold]x"]))
    assert refusal(lambda: WAYS["viewed"](run)) is None
