"""Recordings in the browser: the process that serves one while it grows, and the curves of several runs.

Nothing is imported here: ``relay`` is run as a program, which must be the first to import itself.
"""
