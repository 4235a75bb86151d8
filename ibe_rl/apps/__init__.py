"""What not every user needs: teaching page, the paper's report, sweeps, Minari, external agents, Ray.

Each application attaches to the core: as a listener, as a hydra plugin, or by its name in a setting. The core trains,
explains and evaluates without this folder.

In: runs, and what listeners hear.
Out: pages, reports, datasets, more processes.
Imports: any room; none imports it.
"""
