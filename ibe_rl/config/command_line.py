"""From a command line to a checked config, and from an error to one line."""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from threadpoolctl import threadpool_limits
from yaml import MarkedYAMLError

from ibe_rl.config.arguments import as_hydra_reads, path_setting, sorted_arguments
from ibe_rl.config.error_line import is_refusal, one_line
from ibe_rl.config.hydra_setup import given_settings, prepare_hydra, settings_at_hand
from ibe_rl.config.kind_files import resumed_choices
from ibe_rl.config.kinds import SEVERAL, check_config
from ibe_rl.config.local_files import CONFIGS, local_configs
from ibe_rl.config.manual import exit_with_page
from ibe_rl.runtime.import_string import imported_from_here
from ibe_rl.runtime.installation import pasted
from ibe_rl.runtime.printed import for_shell, prepare_output, visible
from ibe_rl.runtime.workers import LostWorkerError
from ibe_rl.storage.run_folder import CONFIG, NOT_IN_NAMES, read_yaml
from ibe_rl.types import ConfigError


def run_script(script: Callable[[Any], None], configs: Path, name: str) -> None:
    """Compose the config ``name``, check it and call ``script`` with it; print an expected error as one line.

    Args:
        script: takes the composed config as its dataclass.
        configs: folder of the hydra files.
        name: root config in it.
    """
    atexit.register(gc.freeze)  # looking for garbage in all that was imported took a second
    prepare_output()
    exit_with_page(sys.argv[1:], configs, name)
    prepare_hydra()
    sys.argv[1:] = as_hydra_reads(sys.argv[1:], name, resumed_choices(sys.argv[1:], configs))
    started = False
    refused: list[str] = []

    @hydra.main(version_base="1.3", config_path=str(configs), config_name=name)
    def main(composed: Any) -> None:
        nonlocal started
        try:
            values = _complete(_with_what_a_run_keeps(composed))
            check_config(values)
            started = True
            with threadpool_limits(1):  # more threads are slower when processes share the cores
                script(values)
        except (ConfigError, LostWorkerError, OmegaConfBaseException) as error:  # hydra would end the sweep
            refused.append(f"error: {visible(one_line(error))}")

    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        if (reason := _reason(error, started)) is None:
            raise
        refused = [f"error: {visible(reason)}"]
    if refused:
        sys.exit("\n".join(refused))


def _reason(error: Exception, started: bool) -> str | None:
    """An error that is expected before a script starts or, in a sweep, before its first run; None for any other."""
    expected = isinstance(error, HydraException | OmegaConfBaseException | ConfigError)
    if expected or (not started and is_refusal(error)):
        return one_line(error)
    if started or not isinstance(error, OSError):
        return None
    return f"run_dir={error.filename}: allowed is a folder that can be written to ({error.strerror})"


def composed(name: str, overrides: Sequence[str]) -> Any:
    """Compose and check a config as ``train.py`` or ``explain.py`` does.

    Args:
        name: "train" or "explain".
        overrides: settings as on the command line.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    try:
        with settings_at_hand():
            arguments = as_hydra_reads(overrides, name, resumed_choices(overrides, CONFIGS))
            values = _complete(hydra.compose(name, arguments))
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(one_line(error)) from None
    except (AssertionError, ValueError, MarkedYAMLError) as error:
        if not is_refusal(error):
            raise
        raise ConfigError(one_line(error)) from None
    check_config(values)
    return values


def _complete(composed: Any) -> Any:
    """The settings as dataclasses; refuses those without a default that were not given."""
    if absent := sorted(OmegaConf.missing_keys(composed)):
        raise ConfigError(f"{absent[0]}: not given; allowed is {absent[0]}=VALUE, it has no default")
    return OmegaConf.to_object(composed)


def named_settings() -> set[str]:
    """The settings named on the command line, and what they are part of: ``predictor.futures`` and ``predictor``."""
    keys = given_keys()
    return keys | {key.partition(".")[0] for key in keys}


def given_keys() -> set[str]:
    """The keys of the command line as they stand there: ``predictor.futures`` does not name ``predictor``."""
    return {one.key_or_group for one in OverridesParser.create().parse_overrides(given_settings())}


def command_on(folder: Path, script: str, key: str) -> str:
    """A command for any shell in any folder, with the config files and modules that this program has.

    Args:
        folder: of a run or a sweep.
        script: "train" or "explain".
        key: the setting of the script that names the folder.
    """
    sources = HydraConfig.get().runtime.config_sources if HydraConfig.initialized() else ()
    own = [f"--config-dir={one.path}" for one in sources if one.provider == "command-line"]
    here = local_configs() is not None or imported_from_here()
    return (f"cd {for_shell(str(Path.cwd()))} && " if here else "") + pasted(script, *own, path_setting(key, folder))


def is_sweep() -> bool:
    """True inside a hydra multirun."""
    return HydraConfig.initialized() and bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def has_default_name() -> bool:
    """Whether the folder of this run is called after the second in which it began, as others may be."""
    asked = named_settings()
    return HydraConfig.initialized() and not is_sweep() and not asked & {"run_dir", "resume"}


def output_folder(run_dir: str) -> Path:
    """The folder of this run: ``run_dir``, or in a sweep hydra's subfolder of it.

    Raises:
        ConfigError: if ``run_dir`` is empty, as after ``run_dir=$NOT_SET``.
    """
    if not run_dir:
        raise ConfigError("run_dir=: allowed is the name of a folder, or a dot for this one")
    return Path(HydraConfig.get().runtime.output_dir if is_sweep() else run_dir)


def run_name(folder: Path) -> str:
    """Name this run after its folder, or in a sweep after the settings that vary, as ``seed=1``."""
    if not HydraConfig.initialized():
        return folder.name
    if any(
        one.startswith("hydra.job.name=") for one in HydraConfig.get().overrides.hydra
    ):  # set by ibe_rl.apps.sweep.launch
        return str(HydraConfig.get().job.name)
    if not is_sweep():
        return folder.name
    given = OverridesParser.create().parse_overrides(given_settings())
    swept = _swept()
    varied = [one for one in given if (one.key_or_group in swept if swept else one.key_or_group not in NOT_IN_NAMES)]
    return ", ".join(str(one.input_line).lstrip("+") for one in varied) or folder.name


def _swept() -> set[str]:
    """The settings that a sweep varies; none if the command line is another process's or does not parse."""
    params = HydraConfig.get().sweeper.get("params") or {}
    given = [*(f"{key}={values}" for key, values in params.items()), *sorted_arguments(sys.argv[1:])[1]]
    try:
        return {one.key_or_group for one in OverridesParser.create().parse_overrides(given) if one.is_sweep_override()}
    except OverrideParseException:
        return set()


def _with_what_a_run_keeps(composed: Any) -> Any:
    """Fill settings without a default from the saved config of the run to resume."""
    if not composed.get("resume"):
        return composed
    try:
        saved = OmegaConf.create(read_yaml(Path(composed.resume) / CONFIG))
    except (OSError, ValueError):
        return composed  # resuming the run reports the error
    for key in OmegaConf.missing_keys(composed):
        if OmegaConf.select(saved, key) is not None:
            OmegaConf.update(composed, key, OmegaConf.select(saved, key))
    return composed


def changed(saved: Any, fixed: Sequence[str], changes: Sequence[str] | None = None) -> Any:
    """Apply the settings named beside ``resume`` to a saved config.

    Args:
        saved: from ``load_config``.
        fixed: settings that a run keeps, including those below them.
        changes: the settings to change; None: those on the command line.

    Raises:
        ConfigError: naming a setting that the run keeps.
    """
    config = OmegaConf.structured(saved)
    given = OverridesParser.create().parse_overrides(given_settings() if changes is None else list(changes))
    with settings_at_hand():
        groups = {one.key_or_group: one.input_line for one in given if _is_group(one.key_or_group)}
        composed_groups = hydra.compose("train", [*groups.values()]) if groups else {}
    for one in given:
        key = one.key_or_group
        chosen = composed_groups if key in groups else {}
        if key in ("resume", "resume_from") or _is_of_kind(chosen.get(key), getattr(saved, key, None)):
            continue
        if any(f"{key}.".startswith(f"{kept}.") or f"{kept}.".startswith(f"{key}.") for kept in fixed):
            raise ConfigError(f"{one.input_line} with resume: a run keeps its {', '.join(fixed)}; allowed is all else")
        if key in SEVERAL:
            had = config[SEVERAL[key]]  # with their settings
            config[SEVERAL[key]] = {name: had.get(name, new) for name, new in chosen[SEVERAL[key]].items()}
        elif key in chosen:
            OmegaConf.update(config, key, chosen[key], merge=False)
        else:
            OmegaConf.update(config, key, one.value())
    return OmegaConf.to_object(config)


def _is_group(key: str) -> bool:
    return "." not in key and GlobalHydra.instance().config_loader().get_group_options(key) != []


def _is_of_kind(chosen: Any, kept: Any) -> bool:
    """Whether the choice has the kind of the run."""
    return chosen is not None and "kind" in chosen and chosen.kind == getattr(kept, "kind", None)
