"""Applications: what not every user needs, built on the core.

In: runs and their folders, agents and logs from elsewhere, people who teach or take part in a study.
Out: reports with figures (``paper``, ``sweep``), what an agent does as a whole (``summary``), runs of others
(``external``, ``minari``), lessons (``teach``), studies (``study``), workers on a cluster (``ray``), and runs in
TensorBoard and the like (``loggers``).
Imports: every other room. None of them imports this one: they reach it by listeners, registries or import strings,
so that the core trains, explains and evaluates without it.

``report_page`` writes the page of a report from a template and its figures, ``plot_style`` is how these look.
"""
