"""Processes, signals, ports, code that is named in a setting; knows no reinforcement learning.

``workers`` notices a process that dies or hangs, ``signals`` ends a program in order, ``ports`` finds free ones,
``import_string`` imports what a setting or an application names.

In: process handles, port numbers, import strings.
Out: the same, watched; one-line errors that say what can be done.
Imports: types.
"""
