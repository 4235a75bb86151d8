"""From a command line to a checked config, and from an error to one line."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from hydra.types import RunMode
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from threadpoolctl import threadpool_limits

from ibe_rl.config import settings as schemas
from ibe_rl.config.arguments import KINDS, as_hydra_reads
from ibe_rl.config.limits import check
from ibe_rl.config.store import register
from ibe_rl.config.task import code_of
from ibe_rl.runtime.workers import LostWorkerError
from ibe_rl.storage.run_folder import NOT_IN_NAMES, read_overrides, read_yaml, write_atomically
from ibe_rl.types import ConfigError

CONFIGS = Path(__file__).parents[2] / "configs"


def run_script(script: Callable[[Any], None], configs: Path, name: str) -> None:
    """Compose the config ``name``, check it and call ``script`` with it; print an expected error as one line.

    Args:
        script: takes the composed config as its dataclass.
        configs: the folder of the hydra files.
        name: the root config in it.
    """
    os.environ["HYDRA_FULL_ERROR"] = "1"  # hydra prints and exits itself otherwise
    register()
    sys.argv = as_hydra_reads(sys.argv, name, configs)
    started = False
    refused: list[str] = []

    @hydra.main(version_base="1.3", config_path=str(configs), config_name=name)
    def main(composed: Any) -> None:
        nonlocal started
        try:
            values = OmegaConf.to_object(composed)
            check(values)
            started = True
            with threadpool_limits(1):  # one thread a process: more lose when processes share the cores
                script(values)
        except (
            ConfigError,
            LostWorkerError,
            OmegaConfBaseException,
        ) as error:  # kept from hydra, which adds lines; a sweep goes on
            refused.append(f"error: {one_line(error)}")

    try:
        main()
    except (HydraException, OmegaConfBaseException, ConfigError) as error:  # of a sweep, before its first run
        sys.exit(f"error: {one_line(error)}")
    except OSError as error:
        if started:
            raise
        sys.exit(f"error: run_dir={error.filename}: allowed is a folder that can be written to ({error.strerror})")
    except KeyboardInterrupt:
        sys.exit(130)
    if refused:
        sys.exit("\n".join(refused))


def choices(group: str) -> dict[str, Any]:
    """All choices of a group of ``configs/``, as ``train.py`` would compose each; only inside ``run_script``."""
    names = GlobalHydra.instance().config_loader().get_group_options(group)
    files = [name for name in names if "schema" not in name]
    return {name: OmegaConf.to_object(hydra.compose("train", [f"{group}={name}"])[group]) for name in files}


@contextmanager
def settings_at_hand() -> Iterator[None]:
    """Let hydra find the files of ``configs/``, also where no script runs."""
    if GlobalHydra.instance().is_initialized():
        yield
        return
    register()
    with hydra.initialize_config_dir(str(CONFIGS), version_base="1.3"):
        yield


def composed(name: str, overrides: Sequence[str]) -> Any:
    """What ``train.py`` or ``explain.py`` with these settings would compose and check.

    Args:
        name: "train" or "explain".
        overrides: settings as on the command line.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    try:
        with settings_at_hand():
            values = OmegaConf.to_object(hydra.compose(name, as_hydra_reads(overrides, name, CONFIGS)))
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(one_line(error)) from None
    check(values)
    return values


def named_settings() -> set[str]:
    """The settings that were named on the command line, those within others by the others' names."""
    given = OverridesParser.create().parse_overrides(list(HydraConfig.get().overrides.task))
    return {one.key_or_group.partition(".")[0] for one in given}


def installed(program: str) -> str:
    """A program that came with this Python, as one would type it from here."""
    return os.path.relpath(Path(sys.executable).parent / program)


def own_configs() -> str:
    """The option that names a folder of one's own configs, as it has to be given again, with a space; or nothing."""
    sources = HydraConfig.get().runtime.config_sources if HydraConfig.initialized() else ()
    return "".join(f"--config-dir {one.path} " for one in sources if one.provider == "command-line")


def is_sweep() -> bool:
    """True while one of several runs of a hydra multirun is under way."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def output_folder(run_dir: str) -> Path:
    """The folder of this run: ``run_dir``, or in a sweep the one that hydra makes in it."""
    return Path(HydraConfig.get().runtime.output_dir if is_sweep() else run_dir)


def run_name(folder: Path) -> str:
    """Name this run: after its folder, or in a sweep after the settings that differ in it, as ``seed=1``."""
    if any(
        one.startswith("hydra.job.name=") for one in HydraConfig.get().overrides.hydra
    ):  # by ibe_rl.apps.sweep.launch
        return str(HydraConfig.get().job.name)
    if not is_sweep():
        return folder.name
    given = OverridesParser.create().parse_overrides(list(HydraConfig.get().overrides.task))
    swept = _swept()
    told = [one for one in given if (one.key_or_group in swept if swept else one.key_or_group not in NOT_IN_NAMES)]
    return ", ".join(str(one.input_line).lstrip("+") for one in told) or folder.name


def _swept() -> set[str]:
    """The settings that a sweep varies; none where the command line is another process's or is not understood."""
    params = HydraConfig.get().sweeper.get("params") or {}
    given = [f"{key}={values}" for key, values in params.items()] + [one for one in sys.argv[1:] if "=" in one]
    try:
        return {one.key_or_group for one in OverridesParser.create().parse_overrides(given) if one.is_sweep_override()}
    except OverrideParseException:
        return set()


def save_config(values: Any, folder: Path, goes_on: bool = False) -> None:
    """Write the composed config and the overrides the way hydra does; of a run that ``goes_on`` behind those before."""
    known = ("resume", "resume_from", *(KINDS if goes_on else ()))
    given = [one for one in HydraConfig.get().overrides.task if one.partition("=")[0] not in known]
    before = read_overrides(folder / "overrides.yaml") if goes_on else []
    write_config(values, [*before, *given], folder)


def write_config(values: Any, overrides: Sequence[str], folder: Path) -> None:
    """Write a config, and the settings that it was composed with, into the folder ``.hydra``."""
    contents = {"config": OmegaConf.structured(values), "overrides": OmegaConf.create(list(overrides))}
    for name, content in contents.items():
        write_atomically(folder / f"{name}.yaml", partial(_write, OmegaConf.to_yaml(content)))


def _write(text: str, stream: BinaryIO) -> None:
    stream.write(text.encode())


def load_config(path: Path, schema: type) -> Any:
    """Read a saved config back; values only, nothing in it is run.

    Raises:
        ConfigError: if the file does not fit the schema, or names code that no file of one's own names.
    """
    try:
        saved = OmegaConf.create(read_yaml(path))
        agents = {"ppo": schemas.PPOConfig, "dqn": schemas.DQNConfig, "guest": schemas.ExternalPolicyConfig}
        agent = agents[saved.agent.kind]
        instructor = schemas.INSTRUCTORS.get(saved.instructor.kind, schemas.InstructorConfig)
        predictor = schemas.PREDICTORS.get(saved.predictor.get("kind"), schemas.PredictorConfig)
        chosen = schema(agent=agent(), instructor=instructor(), predictor=predictor())
        typed = OmegaConf.merge(OmegaConf.structured(chosen), saved)
        values: Any = OmegaConf.to_object(typed)
    except (OmegaConfBaseException, AttributeError, KeyError, TypeError, OSError, ValueError) as error:
        reason = one_line(error)[:200]
        raise ConfigError(f"{path}: not the config of a run of this version of ibe_rl ({reason})") from None
    _refuse_strange_code(values.env, path)
    return values


def _refuse_strange_code(env: schemas.EnvConfig, path: Path) -> None:
    """Refuse an environment of a saved config that names code which no file in ``configs/env`` names."""
    named = code_of(env.id, env.task)
    if named:
        with settings_at_hand():
            named -= set().union(*(code_of(known.id, known.task) for known in choices("env").values()))
    if named:
        raise ConfigError(
            f"{path}: its environment runs code, {', '.join(sorted(named))}; allowed is what comes with ibe_rl or is "
            "named by a file in configs/env or below a --config-dir: put one there if you trust it"
        )


def changed(saved: Any, fixed: Sequence[str]) -> Any:
    """A saved config with what was named on the command line beside ``resume``; only inside ``run_script``.

    Args:
        saved: of the run, from ``load_config``.
        fixed: settings that a run keeps, those below them included.

    Raises:
        ConfigError: naming a setting that the run keeps.
    """
    config = OmegaConf.structured(saved)
    for one in OverridesParser.create().parse_overrides(list(HydraConfig.get().overrides.task)):
        key, group = one.key_or_group, "." not in one.key_or_group and isinstance(one.value(), str)
        if key in ("resume", "resume_from") or (key in KINDS and one.value() == getattr(saved, key).kind):
            continue
        if any(f"{key}.".startswith(f"{kept}.") or f"{kept}.".startswith(f"{key}.") for kept in fixed):
            raise ConfigError(f"{one.input_line} with resume: a run keeps its {', '.join(fixed)}; allowed is all else")
        if group and OmegaConf.is_config(OmegaConf.select(config, key)):
            OmegaConf.update(config, key, hydra.compose("train", [f"{key}={one.value()}"])[key], merge=False)
        else:
            OmegaConf.update(config, key, one.value())
    return OmegaConf.to_object(config)


def one_line(error: BaseException) -> str:
    """Say what was wrong in one line: the key, the value and what is allowed."""
    if isinstance(error, MissingConfigException):
        return _unknown_choice(str(error))
    cause = error.__cause__ or error
    text = str(cause)
    unknown = re.search(r"Key '(\w+)' not in '(\w+)'", text)
    if unknown:
        return _unknown_key(unknown[1], unknown[2], getattr(cause, "full_key", None))
    key = getattr(cause, "full_key", None)
    first = text.strip().splitlines()[0] if text.strip() else type(error).__name__
    if isinstance(error, OverrideParseException):
        return f"{error.override}: {first}"
    return f"{key}: {first}" if key else first


def _unknown_key(key: str, owner: str, full_key: str | None) -> str:
    fields = getattr(getattr(schemas, owner, None), "__dataclass_fields__", {})
    return f"{full_key or key}: no such setting; allowed are {', '.join(fields)}"


def _unknown_choice(text: str) -> str:
    wanted = re.search(r"Could not find '([\w/]+)/([\w.-]+)'", text) or re.search(r"'([\w/]+)/([\w.-]+)'", text)
    options = [line.strip() for line in text.splitlines() if line.startswith("\t")]
    allowed = ", ".join(sorted(option for option in options if "schema" not in option and "/" not in option))
    return f"{wanted[1]}={wanted[2]}: allowed is one of {allowed}" if wanted else text.splitlines()[0]
