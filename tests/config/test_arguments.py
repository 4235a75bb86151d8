"""Paths of any kind reach their settings as they are, free names may be new, and what is printed is read back."""

from __future__ import annotations

from pathlib import Path

import pytest

from ibe_rl.config.arguments import as_hydra_reads, named_path, path_setting, quoted
from ibe_rl.config.command_line import composed
from ibe_rl.types import ConfigError

PATHS = [
    "runs/a",
    "a b",
    "a,b",
    "a=b",
    "(x)",
    "f(1)",
    "é/ü",
    "it's",
    'a"b',
    "#a",
    "$a",
    "a~b",
    "-x",
    "%d",
    "[a]",
    "[a",
    "{b",
]
PATHS += ["007", "1e5", "true", "sw/3_agent.ignores=-v-_seed=1", "a\\", "a\nb", " a ", "a:b", "choice(a,b)", "\udce9"]
"""Of these hydra reads some as numbers, lists or sweeps, and refuses the others."""


@pytest.mark.parametrize("path", PATHS)
def test_a_path_is_read_as_it_is(path: str) -> None:
    assert composed("train", [f"run_dir={path}"]).run_dir == path
    keys = ("run", "agent", "output", "clip", "run_dir", "agent_vec_normalize")
    read = composed("explain", [f"{key}={path}" for key in keys])
    found = [read.run, read.agent_file, read.output, read.clip, read.run_dir, read.agent_vec_normalize]
    assert found == [path] * len(keys)


@pytest.mark.parametrize("path", [*PATHS, "'quoted'", "${env.id}", "\\${x}", "~"])
def test_what_is_printed_is_read_back_in_any_folder(path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    printed = path_setting("run", Path(path))
    monkeypatch.chdir("/")
    assert composed("explain", [printed]).run == str(tmp_path / path)


def test_quotes_and_other_settings_stay_what_they_are_for_hydra() -> None:
    assert composed("explain", ["run='a, b'"]).run == "a, b"
    assert composed("explain", ["run=null", "clip=null"]).run is None
    assert composed("train", ["run_dir=runs/${seed}_x"]).run_dir == "runs/0_x"
    assert composed("explain", ["sweep=a=b"]).sweep_dir == "a=b"


def test_the_home_folder_is_meant_unless_there_is_a_folder_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", "/home/müller")
    monkeypatch.chdir(tmp_path)
    assert named_path("~/r") == named_path("'~/r'") == "/home/müller/r"
    assert named_path("~nobody_of_that_name/r") == "~nobody_of_that_name/r"
    Path("~").mkdir()
    assert named_path("~") == "~"


def test_several_runs_are_separated_by_commas_unless_there_is_one_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert as_hydra_reads(["-m", "run=a,1e5", "seed=0,1"], "explain", []) == ["-m", "run=a,'1e5'", "seed=0,1"]
    assert as_hydra_reads(["-m", "run=choice(a,b)"], "explain", []) == ["-m", "run=choice(a,b)"]
    assert as_hydra_reads(["-m", "run_dir=a,b"], "train", []) == ["-m", "run_dir='a,b'"]
    Path("a,1e5").mkdir()
    assert as_hydra_reads(["-m", "run=a,1e5"], "explain", []) == ["-m", "run='a,1e5'"]


def test_free_names_may_be_new() -> None:
    given = ["env.kwargs.new_key=1", "env.kwargs.file=/data/a (1),b#", "env.kwargs.pad=left", "env.kwargs.deep.er=2"]
    kwargs = composed("train", given).env.kwargs
    assert (kwargs["new_key"], kwargs["file"], kwargs["pad"]) == (1, "/data/a (1),b#", "left")
    assert kwargs["deep"] == {"er": 2}
    assert composed("explain", given).guest_settings == [
        f"++{one}" for one in (given[0], *[quotedly(given[1])], *given[2:])
    ]


def quotedly(setting: str) -> str:
    key, _, value = setting.partition("=")
    return f"{key}={quoted(value)}"


def test_where_names_are_not_free_the_plus_is_named() -> None:
    with pytest.raises(ConfigError, match=r"loggers\.x: no such setting; allowed is .*\+loggers\.x=VALUE to add it"):
        composed("train", ["loggers.x.y=1"])


@pytest.mark.parametrize(
    ("setting", "refusal"),
    [
        ("agent=null", "GROUP=null, or a value without a name: allowed is GROUP=CHOICE, as agent=ppo, or NAME=VALUE"),
        ("=1", "GROUP=null, or a value without a name"),
        ("agent=", "agent=: allowed is one of dqn, ppo"),
        ("logger=[csv", r"logger=\[csv: allowed is one of csv, "),
        (
            "agent.gamma=0,9",
            "agent.gamma=0,9: several values; allowed is one, with a point in a number, or -m for a run",
        ),
    ],
)
def test_what_is_no_choice_or_no_one_value_is_refused_in_one_line(setting: str, refusal: str) -> None:
    with pytest.raises(ConfigError, match=f"^{refusal}"):
        composed("train", [setting])


def test_a_setting_below_null_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigError, match=r"a setting below one that is null, as env\.task\.name"):
        composed("train", ["env.task.name=x"])
