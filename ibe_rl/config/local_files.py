"""Where config files are: in ``configs`` of the working directory, with the package, and below ``--config-dir``."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from ibe_rl.runtime.installation import shipped
from ibe_rl.storage.run_folder import CONFIG

CONFIGS = shipped("configs")
"""The config files that come with the package."""


def local_configs() -> Path | None:
    """``configs`` of the working directory; None without one, where it is the package's own, or among runs.

    Who opens a stranger's run from inside its folder, or that of its sweep, would otherwise run the code it names.
    """
    here = Path.cwd()
    folder = here / "configs"
    if not folder.is_dir() or folder.samefile(CONFIGS) or _is_among_runs(here):
        return None
    return folder


def _is_among_runs(folder: Path) -> bool:
    """Whether it is a run folder, lies in one, or is the folder of a sweep as ``hydra.sweep.subdir`` names its runs."""
    return any((above / CONFIG).exists() for above in (folder, *folder.parents)) or any(
        folder.glob(f"[0-9]*_*/{CONFIG}")
    )


def ignored_configs() -> str:
    """The line that tells that ``configs`` of the working directory is not used; empty where nothing is ignored."""
    here = Path.cwd()
    if not (here / "configs").is_dir() or not _is_among_runs(here):
        return ""
    return "note: ./configs is not used, as it lies among runs; --config-dir configs uses it, if you trust it\n"


def config_folders(configs: Path, arguments: Sequence[str]) -> list[Path]:
    """All folders with config files, the ones that win first.

    Args:
        configs: of the script.
        arguments: of the command line.
    """
    local = local_configs()
    return [*([] if local is None else [local]), configs, *own_folders(arguments)]


def own_folders(arguments: Sequence[str]) -> list[Path]:
    """The folders that ``--config-dir`` names."""
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--config-dir", "-cd", action="append", default=[], type=Path)
    found: list[Path] = parser.parse_known_args(list(arguments))[0].config_dir
    return found
