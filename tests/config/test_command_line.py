"""The names of runs, as hydra starts them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ibe_rl.config.arguments import quoted
from ibe_rl.config.command_line import command_on, composed, output_folder, run_name, run_script
from ibe_rl.runtime.import_string import import_from_here
from ibe_rl.runtime.printed import for_shell
from ibe_rl.types import ConfigError

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"


def names(monkeypatch: pytest.MonkeyPatch, *arguments: str, argv_is_known: bool = True) -> list[str]:
    """What the runs that a command line starts are called."""
    found: list[str] = []

    def script(cfg: Any) -> None:
        if not argv_is_known:
            monkeypatch.setattr(sys, "argv", ["a worker of another launcher"])
        found.append(run_name(output_folder(cfg.run_dir)))

    monkeypatch.setattr(sys, "argv", ["train.py", *arguments, "hydra/launcher=basic"])
    run_script(script, CONFIGS, "train")
    return found


def test_a_single_run_is_named_after_its_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert names(monkeypatch, f"run_dir={tmp_path / 'mine'}", "seed=3") == ["mine"]


@pytest.mark.parametrize(
    ("swept", "expected"),
    [
        (["seed=0,1"], ["seed=0", "seed=1"]),
        (["agent=ppo,dqn", "seed=range(2)"], [f"agent={a}, seed={s}" for a in ("ppo", "dqn") for s in (0, 1)]),
        (["agent.hidden=[16],[8,8]"], ["agent.hidden=[16]", "agent.hidden=[8,8]"]),
    ],
)
def test_a_run_of_a_sweep_is_named_after_what_differs(
    swept: list[str], expected: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fixed = ["mapping.n_clusters=4", "viewer=off", f"run_dir={tmp_path}"]
    assert names(monkeypatch, "-m", *swept, *fixed) == expected


def test_settings_may_stand_on_both_sides_of_an_option(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (place := tmp_path / "a=b").mkdir()
    given = ["seed=0,1", "-m", "agent=dqn", "--config-dir", str(place), "viewer=off", f"run_dir={tmp_path}"]
    assert names(monkeypatch, *given) == ["seed=0", "seed=1"]


def test_a_sweep_in_a_config_file_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "sweep").mkdir()
    lines = ["# @package _global_", "hydra:", "  sweeper:", "    params:", "      seed: 4,5"]
    (tmp_path / "sweep" / "mine.yaml").write_text("\n".join(lines))
    given = ["-m", "--config-dir", str(tmp_path), "sweep=mine", "agent=ppo,dqn", f"run_dir={tmp_path}"]
    assert set(names(monkeypatch, *given)) == {f"seed={s}, agent={a}" for s in (4, 5) for a in ("ppo", "dqn")}


def test_where_the_swept_are_not_known_all_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = ["-m", "seed=0,1", "mapping.n_clusters=4", "viewer=off", f"run_dir={tmp_path}"]
    found = names(monkeypatch, *given, argv_is_known=False)
    assert found == ["seed=0, mapping.n_clusters=4", "seed=1, mapping.n_clusters=4"]


def test_a_sweep_of_one_run_has_a_name_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert names(monkeypatch, "-m", f"run_dir={tmp_path}") == ["0_"]


def test_a_run_of_the_parallel_launcher_is_named_after_what_it_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    name = "agent.hidden=[8,8], env.kwargs.pad='left'"
    assert names(monkeypatch, f"run_dir={tmp_path}", f"hydra.job.name={quoted(name)}") == [name]


@pytest.mark.parametrize("text", ["plain", "a, b", "it's", "[1,2]", "a=b", "ends in \\", "{x: y}", " "])
def test_a_quoted_text_comes_back_as_it_was(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert names(monkeypatch, f"run_dir={quoted(f'runs/{text}')}") == [Path(f"runs/{text}").name]


def test_a_printed_command_finds_the_modules_and_config_files_of_the_folder_it_came_from(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    here = tmp_path / "it's here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "path", [*sys.path])
    alone = command_on(Path("a b"), "explain", "run")
    assert alone.endswith(f" {for_shell(f'run={here}/a b')}")
    assert not alone.startswith("cd ")
    (here / "module_of_the_working_directory.py").touch()
    import_from_here("module_of_the_working_directory")
    assert command_on(Path("a b"), "explain", "run") == f"cd {for_shell(str(here))} && {alone}"
    del sys.modules["module_of_the_working_directory"]
    assert command_on(Path("a b"), "explain", "run") == alone
    (here / "configs").mkdir()
    assert command_on(Path("a b"), "explain", "run") == f"cd {for_shell(str(here))} && {alone}"


def test_a_printed_command_names_the_config_files_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "my files").mkdir()
    monkeypatch.chdir(tmp_path)
    found: list[str] = []
    monkeypatch.setattr(sys, "argv", ["train.py", "--config-dir", "my files", f"run_dir={tmp_path}"])
    run_script(lambda _: found.append(command_on(tmp_path, "train", "resume")), CONFIGS, "train")
    assert shlex.split(found[0])[-2:] == [f"--config-dir={tmp_path}/my files", f"resume={tmp_path}"]


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ("a: b: c", r"error: .*mine\.yaml, line 1, column 5: mapping values are not allowed here; allowed is YAML"),
        ("a: [", r"error: .*mine\.yaml, line 1, column \d: .*; allowed is YAML"),
    ],
)
def test_a_config_file_that_is_no_yaml_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str, refusal: str
) -> None:
    (tmp_path / "env").mkdir()
    (tmp_path / "env" / "mine.yaml").write_text(text)
    with pytest.raises(SystemExit) as ended:
        names(monkeypatch, "--config-dir", str(tmp_path), "env=mine", f"run_dir={tmp_path}")
    assert re.fullmatch(refusal, str(ended.value))


@pytest.mark.parametrize(("kind", "key"), [("habits", "instructor.run"), ("recorded", "instructor.recording")])
def test_a_setting_without_a_default_is_asked_for_by_name(monkeypatch: pytest.MonkeyPatch, kind: str, key: str) -> None:
    refusal = f"error: {key}: not given; allowed is {key}=VALUE, it has no default"
    with pytest.raises(SystemExit, match=refusal):
        names(monkeypatch, f"instructor={kind}")
    with pytest.raises(ConfigError, match=refusal.removeprefix("error: ")):
        composed("train", [f"instructor={kind}"])


def test_what_is_refused_is_printed_without_control_characters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["train.py", "agent=\x1b[31m[x]"])
    with pytest.raises(SystemExit) as ended:
        run_script(lambda _: None, CONFIGS, "train")
    assert "\x1b" not in str(ended.value)


def test_only_errors_before_the_start_are_explained(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(_: Any) -> None:
        raise AssertionError("Unexpected type of something else")

    monkeypatch.setattr(sys, "argv", ["train.py", f"run_dir={tmp_path}"])
    with pytest.raises(AssertionError, match="Unexpected type of something else"):
        run_script(broken, CONFIGS, "train")


def test_the_end_of_a_script_looks_for_no_garbage(tmp_path: Path) -> None:
    script = """
import atexit, gc
left_alone = lambda: gc.get_freeze_count() > 10_000
atexit.register(lambda: print("in the end", left_alone()))
from ibe_rl.config.command_line import run_script
from ibe_rl.config.local_files import CONFIGS
run_script(lambda cfg: print("seed", cfg.seed, left_alone()), CONFIGS, "train")
"""
    done = subprocess.run(
        [sys.executable, "-c", script, "seed=3"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["seed 3 False", "in the end True"]
