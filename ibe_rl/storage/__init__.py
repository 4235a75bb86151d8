"""Bytes on disk: the run folder, its table, checkpoints, and the log of whole episodes.

Nothing that was logged is lost: a file is written under another name and then renamed. Opening a folder runs no code
from it: arrays, JSON and tensors with ``weights_only=True``.

In: rows, arrays, state dicts.
Out: files, and the same read back and checked.
Imports: types, task, runtime.
"""
