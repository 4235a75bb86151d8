"""Files of a run: its folder, table, checkpoints, and the log of whole episodes.

Nothing logged is lost: files are written under a temporary name and then renamed. Opening a folder runs no code from
it: it holds arrays, JSON and tensors loaded with ``weights_only=True``.

In: rows, arrays, state dicts.
Out: files, and the same values read back and checked.
Imports: types, task, runtime.
"""
