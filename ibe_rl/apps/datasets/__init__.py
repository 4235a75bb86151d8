"""Episodes that others recorded, as episodes of this project: read, checked and converted.

In: a data set of Minari, or arrays in a file (``arrays``), and the environment's task.
Out: ``Episode`` objects (``recorded``), with an instruction from the data set or the environment's rule
(``instruction_source``).
Imports: ``types``, ``task``, ``ibe``, ``runtime`` and ``apps.external.actions``.
"""
