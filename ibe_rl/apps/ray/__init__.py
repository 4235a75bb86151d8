"""Collecting and sweeping on a Ray cluster.

In: the settings ``collect.engine=ray`` and ``runs_on``.
Out: a collector whose workers are Ray actors, and runs started there.
Imports: config, runtime, types.
"""
