"""The log: takes batches of steps, returns whole episodes, bounded on disk and in memory.

It is a ring buffer of memory-mapped ``.npy`` files, ``T + 1`` rows per episode; the last row holds the last
state only. New episodes overwrite the oldest. Plain ``.npy`` files open without running any code.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ibe_rl.storage.arrays import make_array, map_array
from ibe_rl.storage.log_columns import (
    ABOUT_LOG,
    COLUMNS,
    DIMENSIONS,
    INDEX,
    OPTIONAL,
    PERCEPT_COLUMN,
    TOLD_COLUMN,
    TOLD_SIZE,
)
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.storage.run_folder import read_json, write_atomically, write_json
from ibe_rl.types import Array, Episode


class UnreadableLogError(ValueError):
    """Files of a log are missing or damaged; the message says which."""


class TrajectoryLog:
    """Whole episodes of all environments, joined across batches.

    Args:
        folder: of the files; made if missing.
        capacity_frames: rows kept, at least the states of the longest episode.
        contexts: all names of contexts.

    Attributes:
        frames: steps seen so far, including unfinished episodes.
        episodes_ended: whole episodes seen so far, including overwritten ones.
        index: records of the episodes kept, oldest first (see ``INDEX``).
    """

    def __init__(self, folder: Path, capacity_frames: int, contexts: Sequence[str]):
        self.folder, self.capacity_frames, self.contexts = folder, capacity_frames, tuple(contexts)
        self.frames = self.episodes_ended = 0
        self._columns: dict[str, Array] = {}
        self._open: list[list[dict[str, Array]]] = []  # parts of each environment's unfinished episode
        self._ended: list[int] = []  # episodes of each environment
        self._resumed = False
        self._kept: deque[Any] = deque()
        self._head = 0
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def index(self) -> Array:
        """``(E,)`` records of dtype ``INDEX``."""
        return np.array(list(self._kept), dtype=INDEX)

    @property
    def context_names(self) -> Array:
        """``(E,)`` names of contexts."""
        return np.array(self.contexts)[self.index["context"]]

    def add(self, steps: Mapping[str, Array], context_of: Any) -> Array:
        """Add ``T`` steps of ``N`` environments.

        Args:
            steps: ``(N, T, ...)`` arrays: the columns ``state``, ``action``, ``reward``, ``instruction``,
                ``given``; ``next_state``, ``done``, ``terminated``, ``success`` after the step; ``percept`` and
                ``next_percept`` where that is not the state; ``told`` where a person teaches. Row i continues the same
                environment in every call.
            context_of: initial state ``(S,)`` to the name of the context.

        Returns:
            Records of the episodes that ended, dtype ``INDEX``.

        Raises:
            ValueError: if a row does not continue where it stopped.
        """
        rows = len(steps["done"])
        self._open, self._ended = self._open or [[] for _ in range(rows)], self._ended or [0] * rows
        self._check_continuity(steps["state"][:, 0])
        self.frames += steps["done"].size
        ended = [
            self._store(piece, context_of)
            for row in range(rows)
            for piece in self._pieces(row, {name: column[row] for name, column in steps.items()})
        ]
        return np.array(ended, dtype=INDEX)

    def _check_continuity(self, states: Array) -> None:
        """Check that each row continues; right after a resume, a new episode may have begun instead."""
        for row, (parts, state) in enumerate(zip(self._open, states, strict=True)):
            if not parts or np.array_equal(parts[-1]["next_state"][-1], state):
                continue
            if not self._resumed:
                raise ValueError(f"row {row} does not go on where it stopped")
            parts.clear()
            self._ended[row] += 1
        self._resumed = False

    def _pieces(self, row: int, steps: dict[str, Array]) -> Iterable[dict[str, Array]]:
        """Split one environment's steps ``(T, ...)`` at episode ends; yield the whole episodes."""
        cuts = [0, *(np.flatnonzero(steps["done"]) + 1).tolist(), len(steps["done"])]
        for start, stop in pairwise(cuts):
            if start == stop:
                continue
            self._open[row].append({name: column[start:stop].copy() for name, column in steps.items()})
            if steps["done"][stop - 1]:
                parts, self._open[row] = self._open[row], []
                self._ended[row] += 1
                yield {name: np.concatenate([part[name] for part in parts]) for name in steps}

    def partial_episodes(self) -> list[PartialEpisode]:
        """The unfinished episode of each environment."""
        return [PartialEpisode.of(parts, ended) for parts, ended in zip(self._open, self._ended, strict=True)]

    def _store(self, whole: dict[str, Array], context_of: Any) -> Any:
        steps = len(whole["done"])
        start = self._make_room(steps + 1)
        whole["number"] = np.full(steps + 1, self.episodes_ended)
        for name in {"state", PERCEPT_COLUMN} & whole.keys():
            whole[name] = np.concatenate([whole[name], whole[f"next_{name}"][-1:]])
        for name in (*COLUMNS, *(one for one in OPTIONAL if one in whole)):
            self._column(name, whole[name])[start : start + len(whole[name])] = whole[name]
        record = (
            start,
            self.episodes_ended,
            steps,
            float(np.sum(whole["reward"], dtype=np.float64)),
            bool(whole["terminated"][-1]),
            bool(whole["success"][-1]),
            self.contexts.index(context_of(whole["state"][0])),
            self.frames,
        )
        self._kept.append(record)
        self.episodes_ended += 1
        return record

    def _make_room(self, rows: int) -> int:
        """Free ``rows`` contiguous rows, dropping the episodes there; returns the first."""
        if self._head + rows > self.capacity_frames:
            while self._kept and self._kept[0][0] >= self._head:
                self._kept.popleft()  # the end of the previous lap holds the oldest episodes
            self._head = 0
        start, self._head = self._head, self._head + rows
        while self._kept and start <= self._kept[0][0] < self._head:
            self._kept.popleft()
        return start

    def _column(self, name: str, like: Array) -> Array:
        if name not in self._columns:
            shape = (self.capacity_frames, *like.shape[1:])
            self._columns[name] = make_array(self.folder / f"{name}.npy", like.dtype, shape)
        return self._columns[name]

    def read(self, rows: Iterable[int], percepts: bool = False) -> list[Episode]:
        """Copy episodes at positions ``rows`` of ``index``, on request with percepts that are not the states."""
        kept = list(self._kept)
        return [self._read(kept[row], percepts) for row in rows]

    def told(self, rows: Iterable[int]) -> list[Array]:
        """What the column ``told`` has of the episodes at positions ``rows`` of ``index``, ``(T, n)`` each."""
        kept = [self._kept[row] for row in rows]  # none in a log that has no such column
        return [np.array(self._columns[TOLD_COLUMN][start : start + steps]) for start, _, steps, *_ in kept]

    def told_first(self) -> Array:
        """The same of the first step of each episode, ``(E, TOLD_SIZE)``; zeros where no person teaches."""
        column = self._columns.get(TOLD_COLUMN)
        silence = np.zeros((len(self._kept), TOLD_SIZE), np.int32)
        return silence if column is None else np.array(column[self.index["start"]])

    def percepts_at(self, rows: Array, steps: Array, most_numbers: int) -> Array:
        """Percepts ``(N, P)`` at steps ``(N,)`` of episodes ``(N,)``; fewer if they exceed ``most_numbers``."""
        column = self._columns[PERCEPT_COLUMN if PERCEPT_COLUMN in self._columns else "state"]
        places = self.index["start"][rows] + steps
        return np.array(column[places[: max(1, most_numbers // column.shape[1])]])

    def _read(self, record: Any, with_percepts: bool) -> Episode:
        start, _, steps, _, terminated, success, context, _ = record
        percepts = self._columns.get(PERCEPT_COLUMN) if with_percepts else None
        column = {name: np.array(self._columns[name][start : start + steps]) for name in COLUMNS[1:]}
        return Episode(
            states=np.array(self._columns["state"][start : start + steps + 1]),
            actions=column["action"],
            rewards=column["reward"],
            instructions=column["instruction"],
            given=column["given"],
            terminated=bool(terminated),
            success=bool(success),
            context=self.contexts[context],
            percepts=None if percepts is None else np.array(percepts[start : start + steps + 1]),
        )

    def flush(self) -> None:
        """Write everything to disk; the index is replaced atomically."""
        for column in self._columns.values():
            column.flush()  # type: ignore[attr-defined]  # a memmap, made in _column
        about = {"capacity_frames": self.capacity_frames, "contexts": self.contexts, "frames": self.frames}
        about |= {"episodes_ended": self.episodes_ended}
        write_json(self.folder / ABOUT_LOG, about)
        write_atomically(self.folder / "episodes.npy", lambda stream: np.save(stream, self.index))

    def state_dict(self) -> dict[str, Any]:
        """All that is not in the files, as arrays and plain values."""
        index, parts = self.index, [part for row in self._open for part in row]
        return {
            "frames": self.frames,
            "episodes_ended": self.episodes_ended,
            "head": self._head,
            "index": {name: index[name].copy() for name in INDEX.names or ()},
            "open_steps": [_steps(row) for row in self._open],  # steps of each row, concatenated in:
            "open": {name: np.concatenate([part[name] for part in parts]) for name in (parts or [{}])[0]},
            "ended": list(self._ended),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a ``state_dict`` in the same folder; what was logged after it is logged again.

        Episodes overwritten since then are lost. Without any of the files, all ended episodes are.

        Raises:
            ValueError: if the files are not those of the state.
        """
        index = np.empty(len(state["index"]["start"]), INDEX)
        for name in INDEX.names or ():
            index[name] = state["index"][name]
        self.frames, self.episodes_ended, self._head = state["frames"], state["episodes_ended"], state["head"]
        self._open = _rows(state["open"], state["open_steps"])
        self._ended, self._resumed = list(state["ended"]), True
        there = any((self.folder / f"{name}.npy").exists() for name in COLUMNS)
        self._head = self._head if there else 0
        self._load(index if there else index[:0], "r+")

    def _load(self, index: Array, mode: Literal["r", "r+"]) -> None:
        """Open the files and keep the episodes of ``index`` that are still in them."""
        try:
            if index.size:
                kept = [name for name in OPTIONAL if (self.folder / f"{name}.npy").exists()]
                self._columns = {name: map_array(self.folder / f"{name}.npy", mode) for name in (*COLUMNS, *kept)}
            self._check(index)
            self._kept = deque(record for record in index.tolist() if self._columns["number"][record[0]] == record[1])
        except (ValueError, KeyError, IndexError, TypeError) as error:
            raise UnreadableLogError(f"{self.folder} is not a readable log: {error}") from None

    def _check(self, index: Array) -> None:
        """Check the files against the index; raises ValueError."""
        for name, column in self._columns.items():
            fits = len(column) == self.capacity_frames and column.dtype.kind in "biuf"
            if not fits or column.ndim != DIMENSIONS.get(name, column.ndim):
                raise ValueError(
                    f"{name}.npy has {column.shape} of {column.dtype}, not {self.capacity_frames:.7g} rows"
                )
        start, steps, context = index["start"], index["steps"], index["context"]
        rows = np.asarray(self.capacity_frames)
        inside = (start >= 0) & (start < rows) & (steps > 0) & (steps < rows - start)
        if not np.all(inside & (context >= 0) & (context < len(self.contexts))):
            raise ValueError("its index names rows or contexts that are not there")

    @classmethod
    def open(cls, folder: Path) -> TrajectoryLog:
        """Open the log of a run for reading; no code from it runs.

        Raises:
            ValueError: if the folder is not a log or is damaged.
        """
        try:
            about = read_json(folder / ABOUT_LOG)
            log = cls(folder, int(about["capacity_frames"]), [str(name) for name in about["contexts"]])
            log.frames, log.episodes_ended = int(about["frames"]), int(about["episodes_ended"])
            index = np.array(map_array(folder / "episodes.npy"))
            if index.dtype != INDEX or index.ndim != 1:
                raise ValueError(f"episodes.npy has {index.dtype}, not records of episodes")
        except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
            raise UnreadableLogError(f"{folder} is not a readable log: {error}") from None
        log._load(index, "r")
        return log


def _steps(parts: Sequence[dict[str, Array]]) -> int:
    return sum(len(part["done"]) for part in parts)


def _rows(joined: Mapping[str, Array], steps: Sequence[int]) -> list[list[dict[str, Array]]]:
    """Split concatenated columns into the parts of each row."""
    if any(len(column) != sum(steps) for column in joined.values()):
        raise ValueError(f"its rows are {sum(steps)} steps long, not as long as its columns")
    cuts = [slice(end - count, end) for count, end in zip(steps, np.cumsum(steps).tolist(), strict=True)]
    return [
        [{name: column[cut].copy() for name, column in joined.items()}] if cut.start < cut.stop else [] for cut in cuts
    ]
