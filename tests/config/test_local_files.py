"""Config files of the working directory are found before the package's own, but not among runs."""

from __future__ import annotations

from pathlib import Path

import pytest
from omegaconf import OmegaConf
from processes import ROOT

from ibe_rl.config import saved
from ibe_rl.config.command_line import composed
from ibe_rl.config.hydra_setup import choice
from ibe_rl.config.local_files import CONFIGS, config_folders, ignored_configs, local_configs
from ibe_rl.config.saved import load_config, write_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.storage.run_folder import CONFIG
from ibe_rl.types import ConfigError

CODE = "# Mine.\nkind: kind_that_is_not_there:Loud\n"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to stand in, with a kind of vocabulary in its ``configs``."""
    folder = tmp_path / "place"
    (folder / "configs" / "mapping").mkdir(parents=True)
    (folder / "configs" / "mapping" / "mine.yaml").write_text("kind: mine\nn_clusters: 3\n")
    monkeypatch.chdir(folder)
    return folder


def test_they_are_found_over_the_package_s_own(place: Path) -> None:
    assert composed("train", ["mapping=mine"]).mapping.n_clusters == 3
    (place / "configs" / "mapping" / "axis.yaml").write_text("kind: axis\nn_clusters: 5\n")
    (place / "configs" / "train.yaml").write_text("of: another program\n")
    assert composed("train", []).mapping.n_clusters == 5
    assert composed("train", ["mapping=paper"]).mapping.n_clusters == 8
    assert config_folders(CONFIGS, ["--config-dir", "more"]) == [place / "configs", CONFIGS, Path("more")]
    with pytest.raises(ConfigError, match=r"^mapping=mien: allowed is one of axis, .*mine, .*; did you mean mine\?$"):
        composed("train", ["mapping=mien"])


def test_those_of_the_repository_are_the_package_s_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(ROOT)
    assert (local_configs(), ignored_configs()) == (None, "")
    monkeypatch.chdir(tmp_path)
    assert (local_configs(), ignored_configs()) == (None, "")


@pytest.mark.parametrize("config", [CONFIG, f"../{CONFIG}", f"0_seed=0/{CONFIG}"], ids=["run", "in a run", "sweep"])
def test_among_runs_they_are_not_used(config: str, place: Path) -> None:
    (place / config).parent.mkdir(parents=True)
    (place / config).write_text("")
    assert local_configs() is None
    assert ignored_configs().startswith("note: ./configs is not used, as it lies among runs")
    with pytest.raises(ConfigError, match=r"^mapping=mine: allowed is one of"):
        composed("train", ["mapping=mine"])


def test_they_vouch_for_the_code_of_a_run_and_a_run_does_not_vouch_for_its_own(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    strange = place / "runs" / "strange"
    cfg = OmegaConf.create(OmegaConf.to_container(OmegaConf.structured(composed("train", []))))
    cfg.mapping.kind = "kind_that_is_not_there:Loud"
    (strange / ".hydra").mkdir(parents=True)
    (strange / CONFIG).write_text(OmegaConf.to_yaml(cfg))
    with pytest.raises(ConfigError, match=r"runs code, kind_that_is_not_there:Loud; allowed is .* ./configs"):
        load_config(strange / CONFIG, TrainConfig)
    (strange / "configs" / "mapping").mkdir(parents=True)
    (strange / "configs" / "mapping" / "mine.yaml").write_text(CODE)
    monkeypatch.chdir(strange)
    with pytest.raises(ConfigError, match=r"its mapping runs code"):
        load_config(strange / CONFIG, TrainConfig)
    monkeypatch.chdir(place)
    (place / "configs" / "mapping" / "mine.yaml").write_text(CODE)
    with pytest.raises(ConfigError, match=r"kind_that_is_not_there.*cannot be imported|No module named"):
        load_config(strange / CONFIG, TrainConfig)  # trusted, so it is looked for


def test_the_files_of_other_environments_are_not_composed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".hydra").mkdir()
    write_config(composed("train", ["env=highway"]), ["seed=1", "env=highway"], tmp_path / ".hydra")
    chosen: list[str] = []
    monkeypatch.setattr(saved, "choice", lambda group, name: [chosen.append(name), choice(group, name)][1])
    assert load_config(tmp_path / CONFIG, TrainConfig).env.id == "highway_env:highway-fast-v0"
    assert chosen == ["highway"]
    (tmp_path / ".hydra" / "overrides.yaml").unlink()
    assert load_config(tmp_path / CONFIG, TrainConfig).env.id == "highway_env:highway-fast-v0"
    assert "highway" in chosen[1:]
