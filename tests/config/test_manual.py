"""The pages of --help: short, of the settings as they are declared, without names that nobody types."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from ibe_rl.config.declared import DeclaredSetting, declared
from ibe_rl.config.kinds import GROUPS, settings_of
from ibe_rl.config.limits import setting, typed_names
from ibe_rl.config.local_files import CONFIGS
from ibe_rl.config.manual import MATTER, ROOTS, exit_with_page, first_comment, page_asked_for
from ibe_rl.config.settings import EnvConfig, ExplainConfig, ListenerConfig, MetricConfig, ViewerConfig
from ibe_rl.types import ConfigError

INTERNAL = ("_schema", "agent_file", "sweep_dir", "guest_settings", "hydra", "Hydra", "Config", "???")
CHOICES = sorted(path for path in CONFIGS.glob("*/*.yaml"))


@dataclass
class Small:
    """Of a test."""

    kind: str = "small"
    size: int | None = setting(3, low=1)  # of it; None: any
    # in the line above,
    # and the last line of a comment counts
    way: str = setting("up", choices=("up", "down"))
    shares: list[float] = field(default_factory=lambda: [0.5])
    needed: bool = setting("???")  # must be said
    file_of_it: str | None = field(default=None, metadata={"typed": "file"})  # typed so
    inner: dict[str, int] = field(default_factory=dict, metadata={"typed": None})  # nobody types it


def test_a_setting_is_told_as_it_is_declared() -> None:
    assert declared(Small) == [
        DeclaredSetting("size", "3", "integer or null, at least 1", "of it; null: any"),
        DeclaredSetting("way", "up", "one of up, down", "and the last line of a comment counts"),
        DeclaredSetting("shares", "[0.5]", "list of number", ""),
        DeclaredSetting("needed", None, "true or false", "must be said"),
        DeclaredSetting("file", "null", "text or null", "typed so"),
    ]
    assert typed_names(Small)["file"] == "file_of_it"


@pytest.mark.parametrize("script", ROOTS)
def test_the_overview_fits_on_a_screen_and_names_what_can_be_typed(script: str) -> None:
    page = page_asked_for(["--help"], CONFIGS, script)
    assert page
    lines = page.splitlines()
    assert len(lines) <= 45
    assert max(map(len, lines)) <= 105
    assert not [word for word in INTERNAL if word in page]
    assert all(f"  {key}=" in page for key in MATTER[script])


@pytest.mark.parametrize("path", CHOICES, ids=lambda path: f"{path.parent.name}={path.stem}")
def test_every_choice_has_one_line_which_its_page_shows(path: Path) -> None:
    if path.parent.name == "hydra":
        return
    assert 8 <= len(first_comment(path)) <= 70
    assert first_comment(path) in (page_asked_for([f"--help={path.parent.name}"], CONFIGS, "train") or "")


def test_every_setting_has_a_meaning() -> None:
    kinds = {settings_of(path.parent.name, path.stem) for path in CHOICES if path.parent.name in ("agent", "predictor")}
    kinds |= {settings_of("instructor", path.stem) for path in CHOICES if path.parent.name == "instructor"}
    schemas = {*ROOTS.values(), *GROUPS.values(), EnvConfig, ViewerConfig, *kinds} - {ListenerConfig, MetricConfig}
    assert [(schema.__name__, one.key) for schema in schemas for one in declared(schema) if not one.meaning] == []


def test_a_group_has_its_choices_what_they_set_and_every_setting() -> None:
    page = page_asked_for(["agent=dqn", "--help", "mapping"], CONFIGS, "train") or ""
    assert "  * axis  " in page
    assert "space=rule, power=0.3333" in page
    assert "  top_fraction              default 0.25; number, above 0 and at most 1\n" in page
    agents = page_asked_for(["-h", "agent"], CONFIGS, "train") or ""
    assert "with agent=dqn also: Deep Q-learning" in agents
    assert agents.count("gamma  ") == 1
    assert "run_dir                   default runs/DATE_TIME; text" in (
        page_asked_for(["-h", "settings"], CONFIGS, "train") or ""
    )


def test_choices_below_a_folder_of_one_s_own_are_listed(tmp_path: Path) -> None:
    (tmp_path / "metric").mkdir()
    (tmp_path / "metric" / "mine.yaml").write_text("# Counts words. And more.\nkind: module:Words\n")
    page = page_asked_for(["--help", "--config-dir", str(tmp_path)], CONFIGS, "train") or ""
    assert "  metric        mine              Counts words\n" in page


def test_only_help_is_answered_and_an_unknown_page_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert page_asked_for(["seed=1"], CONFIGS, "train") is None
    exit_with_page(["seed=1"], CONFIGS, "train")
    with pytest.raises(ConfigError, match=r"^--help mappin: allowed is one of agent, .*; did you mean mapping\?$"):
        page_asked_for(["--help", "mappin"], CONFIGS, "train")
    with pytest.raises(SystemExit, match="error: --help mappin"):
        exit_with_page(["--help=mappin"], CONFIGS, "train")
    with pytest.raises(SystemExit, match="0"):
        exit_with_page(["--help", "evaluate"], CONFIGS, "explain")
    assert "calibration_episodes" in capsys.readouterr().out


def test_the_names_that_are_typed_lead_to_their_fields() -> None:
    names = typed_names(ExplainConfig)
    assert (names["agent"], names["sweep"]) == ("agent_file", "sweep_dir")
    assert "guest_settings" not in names.values()
