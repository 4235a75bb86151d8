"""The names of runs, as hydra starts them."""

import sys
from pathlib import Path
from typing import Any

import pytest

from ibe_rl.config.arguments import quoted
from ibe_rl.config.command_line import output_folder, run_name, run_script

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
