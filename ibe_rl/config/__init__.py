"""Settings: what can be set, its limits, and how a config is composed.

In: a command line, the YAML files that come along, in ``./configs`` and below a ``--config-dir``, or of a run folder.
Out: dataclasses with values within their limits, a one-line error, or a page of ``--help``.
``settings`` has what all kinds of a part share. ``kinds`` finds the class that a ``kind`` names, with its own settings;
nothing else lists kinds. ``kind_files`` shows these settings to hydra, ``manual`` to the reader of ``--help``.
Imports: ``types``, ``runtime``, ``storage``. No other package knows hydra or omegaconf.
"""
