"""Sweeps: many runs of train.py side by side, resumable, in one report.

In: the overrides of each run from hydra's launcher, and the folders of the runs.
Out: a folder with the folders of all runs; ``figures/report.html`` and ``figures/sweep.csv`` in it.
Imports: ``view``, ``evaluation`` and the rooms below them, ``apps.ray`` for clusters, ``apps.report_page``.

``launch`` plans the runs (``jobs``), runs them (``processes``) and shows their progress (``board``). ``report``
reads their results (``records``), computes intervals over the runs (``intervals``) and draws (``figures``).
"""
