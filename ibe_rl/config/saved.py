"""The config in a run folder: written as composed, read without running code that only the folder names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ibe_rl.config.error_line import one_line
from ibe_rl.config.hydra_setup import choice, choice_names, given_settings, settings_at_hand
from ibe_rl.config.kind_files import KindFiles
from ibe_rl.config.kinds import GROUPS, SEVERAL, with_settings
from ibe_rl.config.own_words import hand_on_words
from ibe_rl.config.settings import CODE_SETTINGS, EnvConfig
from ibe_rl.storage.run_folder import read_overrides, read_yaml, write_atomically
from ibe_rl.types import ConfigError


def save_config(values: Any, folder: Path, goes_on: bool = False) -> None:
    """Write the composed config and the overrides as hydra does; a run that ``goes_on`` appends its overrides."""
    known = ("resume", "resume_from", *(GROUPS if goes_on else ()))
    given = [one for one in given_settings() if one.partition("=")[0] not in known]
    before = read_overrides(folder / "overrides.yaml") if goes_on else []
    write_config(values, [*before, *given], folder)


def write_config(values: Any, overrides: Sequence[str], folder: Path) -> None:
    """Write a config and its overrides into the folder ``.hydra``."""
    contents = {"config": OmegaConf.structured(values), "overrides": OmegaConf.create(list(overrides))}
    for name, content in contents.items():
        write_atomically(folder / f"{name}.yaml", partial(_write, OmegaConf.to_yaml(content)))


def _write(text: str, stream: BinaryIO) -> None:
    stream.write(text.encode())


def load_config(path: Path, schema: type, env: EnvConfig | None = None, trusted: Iterable[str] = ()) -> Any:
    """Read a saved config: values only, no code of it is run.

    Args:
        path: of the file.
        schema: dataclass of the config.
        env: takes the place of the saved environment, whose code is then not run.
        trusted: kinds, as ``module:Class``, that may be run although no config file names them.

    Raises:
        ConfigError: if the file does not fit the schema, names code that no local config file names, or was saved by
            a script that gave its environment as an object.
    """
    try:
        saved = _renamed(read_yaml(path))
        if env is not None:
            saved["env"] = asdict(env)
        elif saved["env"].get("given"):
            raise ConfigError(
                f"{path}: its environment was given in Python ({saved['env'].get('id')}); allowed is to give it again: "
                "ibe_rl.open_run(FOLDER, env=...), ibe_rl.resume(FOLDER, env=...)"
            )
        _refuse_strange_code(saved, path, {*trusted}, check_env=env is None)
        typed = OmegaConf.merge(OmegaConf.structured(schema), saved | with_settings(saved))
        values: Any = OmegaConf.to_object(typed)
    except ConfigError:
        raise
    except (OmegaConfBaseException, AttributeError, KeyError, TypeError, OSError, ValueError) as error:
        reason = one_line(error)[:200]
        raise ConfigError(f"{path}: not the config of a run of this version of ibe_rl ({reason})") from None
    if env is not None:
        values.env = env
    hand_on_words(values)
    return values


def _renamed(saved: dict[str, Any]) -> dict[str, Any]:
    """Update what older versions saved.

    The package ``envs`` was called ``env``, no agent knew a mirror image, and extra reward was not judged after the
    end of an episode (for a short time it was less its mean instead).
    """
    task = saved["env"].get("task") or {}
    old = {name: value for name, value in task.items() if isinstance(value, str) and value.startswith("ibe_rl.env.")}
    saved["agent"].setdefault("mirror", False)
    obedience = saved.setdefault("obedience", {})
    obedience.pop("centred", None)
    obedience.setdefault("absorbing", False)
    task |= {name: f"ibe_rl.envs.{value.removeprefix('ibe_rl.env.')}" for name, value in old.items()}
    return saved


def _refuse_strange_code(saved: dict[str, Any], path: Path, known: set[str], check_env: bool) -> None:
    """Refuse code that no file in ``./configs`` or below a ``--config-dir`` names.

    Raises:
        ConfigError: naming the code and what is allowed.
    """
    named = {("env", code) for code in _code_of_env(saved["env"])} if check_env else set()
    for group in GROUPS:
        parts = saved.get(SEVERAL[group], {}).values() if group in SEVERAL else [saved.get(group, {})]
        named |= {(group, kind) for kind in map(_kind_of, parts) if ":" in kind and kind not in known}
    if not named:
        return
    with settings_at_hand():
        sources = GlobalHydra.instance().config_loader().get_sources()
        folders = [source for source in sources if isinstance(source, KindFiles)]
        trusted = {(group, kind) for group in GROUPS for folder in folders for kind in folder.kinds(group)}
        if codes := {code for group, code in named if group == "env"}:
            trusted |= {
                ("env", code) for code in _named_by_files(codes, read_overrides(path.with_name("overrides.yaml")))
            }
    strange = sorted(named - trusted)
    if strange:
        group = strange[0][0]
        names = ", ".join(code for of, code in strange if of == group)
        owner, python = ("environment", "env=") if group == "env" else (group, "trusted=")
        raise ConfigError(
            f"{path}: its {owner} runs code, {names}; allowed is what comes with ibe_rl or is named by a file in "
            f"./configs/{group} or below a --config-dir: put one there if you trust it (in Python: open_run({python}))"
        )


def _named_by_files(codes: set[str], overrides: Sequence[str]) -> set[str]:
    """Code that the config files of environments name, at least those of ``codes`` that any names.

    A file takes a fifth of a second to compose. So the one that the run was started with comes first, and the others
    only until all codes are found.
    """
    likely, found = {one.removeprefix("env=") for one in overrides}, set[str]()
    for name in sorted(choice_names("env"), key=lambda name: name not in likely):
        found |= _code_of_env(asdict(choice("env", name)))
        if codes <= found:
            break
    return found


def _kind_of(values: dict[str, Any]) -> str:
    return str(values.get("kind", ""))


def _code_of_env(env: dict[str, Any]) -> set[str]:
    """All code outside this package that an environment and its declared task would run."""
    task, env_id = env.get("task") or {}, str(env.get("id"))
    named = {str(task[name]) for name in CODE_SETTINGS if task.get(name)} | ({env_id} if ":" in env_id else set())
    return {one for one in named if not one.startswith("ibe_rl.envs.")}
