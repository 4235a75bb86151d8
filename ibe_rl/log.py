"""The log: batches of steps in, whole episodes out, bounded on disk and in memory.

Episodes lie one behind the other in memory-mapped ``.npy`` files, ``T + 1`` rows each (the last row holds
the last state only), and the oldest make room. Plain ``.npy`` files open without running any code.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.data import Array, Episode
from ibe_rl.run_folder import write_atomically, write_json

COLUMNS = ("number", "state", "action", "reward", "instruction", "given")
INDEX = np.dtype(
    [
        ("start", "i8"),
        ("number", "i8"),
        ("steps", "i8"),
        ("total_reward", "f8"),
        ("terminated", "?"),
        ("success", "?"),
        ("context", "i8"),
        ("frame", "i8"),
    ]
)
"""One record an episode: where it lies, and what can be asked without reading it; ``frame`` is when it ended."""


class TrajectoryLog:
    """Whole episodes of all environments, joined across batches.

    Args:
        folder: where the files go; made if missing.
        capacity_frames: rows kept, at least as many as the longest episode has states.
        contexts: the names that episodes can have as their context.

    Attributes:
        frames: steps seen so far, those of unfinished episodes included.
        episodes_ended: whole episodes seen so far, those that made room included.
        index: records of the episodes kept, oldest first (see ``INDEX``).
    """

    def __init__(self, folder: Path, capacity_frames: int, contexts: Sequence[str]):
        self.folder, self.capacity_frames, self.contexts = folder, capacity_frames, tuple(contexts)
        self.frames = self.episodes_ended = 0
        self._columns: dict[str, Array] = {}
        self._open: dict[int, list[dict[str, Array]]] = {}
        self._kept: deque[Any] = deque()
        self._head = 0
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def index(self) -> Array:
        """``(E,)`` records of dtype ``INDEX``."""
        return np.array(list(self._kept), dtype=INDEX)

    @property
    def context_names(self) -> Array:
        """``(E,)`` names."""
        return np.array(self.contexts)[self.index["context"]]

    def add(self, steps: Mapping[str, Array], context_of: Any) -> Array:
        """Take in what ``N`` environments did in ``T`` steps.

        Args:
            steps: ``(N, T, ...)`` arrays: the columns ``state``, ``action``, ``reward``, ``instruction``,
                ``given``; ``next_state``, ``done``, ``terminated``, ``success`` after the step; ``episode``,
                a number that the steps of one episode share, also across calls.
            context_of: initial state ``(S,)`` to the name of the context.

        Returns:
            Records of the episodes that ended, dtype ``INDEX``.
        """
        self.frames += steps["done"].size
        ended = [
            self._store(piece, context_of)
            for row in range(len(steps["done"]))
            for piece in self._pieces({name: column[row] for name, column in steps.items()})
        ]
        return np.array(ended, dtype=INDEX)

    def _pieces(self, steps: dict[str, Array]) -> Iterable[dict[str, Array]]:
        """Cut one environment's steps ``(T, ...)`` at the ends of episodes; yield those that became whole."""
        cuts = [0, *(np.flatnonzero(steps["done"]) + 1).tolist(), len(steps["done"])]
        for start, stop in pairwise(cuts):
            if start == stop:
                continue
            piece = {name: column[start:stop] for name, column in steps.items()}
            key = int(piece["episode"][0])
            self._open.setdefault(key, []).append({name: column.copy() for name, column in piece.items()})
            if piece["done"][-1]:
                parts = self._open.pop(key)
                yield {name: np.concatenate([part[name] for part in parts]) for name in piece}

    def _store(self, whole: dict[str, Array], context_of: Any) -> Any:
        steps = len(whole["done"])
        start = self._make_room(steps + 1)
        whole["number"] = np.full(steps + 1, self.episodes_ended)
        whole["state"] = np.concatenate([whole["state"], whole["next_state"][-1:]])
        for name in COLUMNS:
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
        """Find ``rows`` rows in a line and forget the episodes that lay there; return the first."""
        if self._head + rows > self.capacity_frames:
            while self._kept and self._kept[0][0] >= self._head:
                self._kept.popleft()  # the end of the last lap, older than what lies at the beginning
            self._head = 0
        start, self._head = self._head, self._head + rows
        while self._kept and start <= self._kept[0][0] < self._head:
            self._kept.popleft()
        return start

    def _column(self, name: str, like: Array) -> Array:
        if name not in self._columns:
            shape = (self.capacity_frames, *like.shape[1:])
            path = self.folder / f"{name}.npy"
            self._columns[name] = np.lib.format.open_memmap(path, mode="w+", dtype=like.dtype, shape=shape)
        return self._columns[name]

    def read(self, rows: Iterable[int]) -> list[Episode]:
        """Copy episodes out of the files.

        Args:
            rows: positions in ``index``.
        """
        kept = list(self._kept)
        return [self._read(kept[row]) for row in rows]

    def _read(self, record: Any) -> Episode:
        start, _, steps, _, terminated, success, context, _ = record
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
        )

    def flush(self) -> None:
        """Bring everything to disk; the index is replaced in one go."""
        for column in self._columns.values():
            column.flush()  # type: ignore[attr-defined]  # a memmap, made in _column
        about = {"capacity_frames": self.capacity_frames, "contexts": self.contexts, "frames": self.frames}
        about |= {"episodes_ended": self.episodes_ended}
        write_json(self.folder / "log.json", about)
        write_atomically(self.folder / "episodes.npy", lambda stream: np.save(stream, self.index))

    @classmethod
    def open(cls, folder: Path) -> TrajectoryLog:
        """Open the log of a run for reading; no code from it runs.

        Raises:
            ValueError: if the folder is not a log or is damaged.
        """
        try:
            about = json.loads((folder / "log.json").read_text())
            log = cls(folder, int(about["capacity_frames"]), [str(name) for name in about["contexts"]])
            log.frames, log.episodes_ended = int(about["frames"]), int(about["episodes_ended"])
            log._kept = deque(np.load(folder / "episodes.npy", allow_pickle=False).astype(INDEX).tolist())
            if log.episodes_ended:
                log._columns = {
                    name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in COLUMNS
                }
            log._kept = deque(record for record in log._kept if log._columns["number"][record[0]] == record[1])
        except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
            raise ValueError(f"{folder} is not a readable log: {error}") from None
        return log
