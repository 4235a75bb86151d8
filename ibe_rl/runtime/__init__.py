"""Processes, signals, ports and code named in settings; independent of reinforcement learning.

``workers`` detects processes that die or hang, ``signals`` stops a program gracefully, ``ports`` finds free ports,
``import_string`` imports code named in a setting or by an application, ``operating_system`` holds what Linux and macOS
do differently, ``installation`` finds what comes with the package and tells how to type its commands.

In: process handles, port numbers, import strings.
Out: the same, monitored; one-line errors that say what can be done.
Imports: types.
"""
