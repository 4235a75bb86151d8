"""Processes, signals, ports and code named in settings; independent of reinforcement learning.

``workers`` detects processes that die or hang, ``signals`` stops a program gracefully, ``ports`` finds free ports,
``operating_system`` holds what Linux and macOS do differently,
``import_string`` imports code named in a setting or by an application.

In: process handles, port numbers, import strings.
Out: the same, monitored; one-line errors that say what can be done.
Imports: types.
"""
