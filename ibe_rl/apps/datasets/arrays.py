"""Data sets that are a few long arrays in one file, as D4RL's: observations, actions, rewards, terminals, timeouts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.apps.datasets.recorded import RawEpisode
from ibe_rl.types import Array, ConfigError

SUFFIXES = (".npz", ".hdf5", ".h5")
NAMES = {
    "observations": ("observations", "obs"),
    "actions": ("actions",),
    "rewards": ("rewards",),
    "terminations": ("terminals", "terminations", "dones"),
    "truncations": ("timeouts", "truncations"),
    "next": ("next_observations", "next_obs"),
}
"""Ours to theirs; all else with as many rows is an info."""
NEEDED = ("observations", "actions", "rewards")
CLOSE = 1e-5


@dataclass(frozen=True)
class Arrays:
    """Arrays of ``N`` rows, whole episodes in order.

    Attributes:
        where: the data set, for messages.
        columns: by our names.
        infos: all others with ``N`` rows.
    """

    where: str
    columns: Mapping[str, Array]
    infos: Mapping[str, Array]

    @classmethod
    def read(cls, path: Path) -> Arrays:
        """Read a file; no code in it is run.

        Raises:
            ConfigError: if it cannot be read, or an array is missing or has another number of rows.
        """
        where, found = f"dataset={path}", _arrays(path)
        columns = {ours: found.pop(name) for ours, names in NAMES.items() for name in names if name in found}
        if missing := [name for name in NEEDED if name not in columns]:
            raise ConfigError(
                f"{where}: it has no {', '.join(missing)}; allowed are arrays called {', '.join(NEEDED)}, terminals "
                "and, if there are any, timeouts and next_observations"
            )
        rows = len(columns["rewards"])
        for name, column in columns.items():
            if len(column) != rows:
                raise ConfigError(f"{where}: {name} has {len(column)} rows and rewards has {rows}; allowed is the same")
        infos = {
            name.removeprefix("infos/"): column for name, column in found.items() if np.shape(column)[:1] == (rows,)
        }
        return cls(where, columns, infos)

    @property
    def cuts(self) -> Array:
        """Where episodes begin, and the end of the last one.

        Raises:
            ConfigError: if no row says that an episode ends.
        """
        ends = np.flatnonzero(self._flags("terminations") | self._flags("truncations")) + 1
        rows = len(self.columns["rewards"])
        if not len(ends):
            raise ConfigError(
                f"{self.where}: terminals and timeouts never say that an episode ends; allowed is an end of each"
            )
        return np.unique([0, *ends, rows])

    def _flags(self, name: str) -> Array:
        found = self.columns.get(name)
        flags = np.zeros(len(self.columns["rewards"]), bool) if found is None else np.asarray(found).reshape(-1)
        if flags.dtype.kind not in "biuf" or len(flags) != len(self.columns["rewards"]):
            raise ConfigError(f"{self.where}: {name} are of type {flags.dtype}; allowed is one bool a row")
        return flags.astype(bool)

    def episodes(self) -> Iterator[RawEpisode]:
        """The episodes; without ``next_observations`` each lacks its last action, as nobody knows where it led."""
        cuts = self.cuts
        for number, (start, stop) in enumerate(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)):
            where = f"{self.where}, episode {number}"
            if "next" in self.columns:
                yield self._whole(where, start, stop)
            elif stop - start > 1:
                yield self._without_its_last_action(where, start, stop)

    def _whole(self, where: str, start: int, stop: int) -> RawEpisode:
        states, after = self.columns["observations"][start:stop], self.columns["next"][start:stop]
        if states.shape != after.shape or not np.allclose(after[:-1], states[1:], atol=CLOSE, equal_nan=True):
            raise ConfigError(
                f"{where}: next_observations are not the observations of the next rows; allowed are whole episodes in "
                "order, not single steps in any order"
            )
        return self._recorded(where, start, stop, np.concatenate([states, after[-1:]]), stop)

    def _without_its_last_action(self, where: str, start: int, stop: int) -> RawEpisode:
        shorter = self._recorded(where, start, stop - 1, self.columns["observations"][start:stop], stop)
        rewards = np.array(shorter.rewards)
        rewards[-1:] += self.columns["rewards"][stop - 1]  # the return stays
        shorter.terminations[-1], shorter.truncations[-1] = (
            self._flags(name)[stop - 1] for name in ("terminations", "truncations")
        )
        return replace(shorter, rewards=rewards)

    def _recorded(self, where: str, start: int, stop: int, observations: Array, last: int) -> RawEpisode:
        return RawEpisode(
            where,
            observations,
            self.columns["actions"][start:stop],
            self.columns["rewards"][start:stop],
            terminations=self._flags("terminations")[start:stop],
            truncations=self._flags("truncations")[start:stop],
            infos={name: column[start:last] for name, column in self.infos.items()},
        )


def _arrays(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise ConfigError(f"dataset={path}: no such file")
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as file:
                return dict(file)
        h5py = import_module("h5py")
        found: dict[str, Any] = {}
        with h5py.File(path, "r") as file:
            file.visititems(
                lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None
            )
        return found
    except ImportError as error:
        raise ConfigError(f"dataset={path}: needs h5py ({error}); install the extra ibe_rl[minari]") from None
    except Exception as error:  # a damaged file may raise anything
        raise ConfigError(f"dataset={path}: it cannot be read ({' '.join(str(error).split())[:200]})") from None
