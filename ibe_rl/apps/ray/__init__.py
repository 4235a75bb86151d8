"""Ray: workers and whole runs on other machines.

In: the number of workers, the environments of each, and the address of a cluster or ``local``.
Out: batches of transitions as from local workers (``workers``); output and exit status of a command (``run``).
Imports: ``types``, ``runtime``, ``config``. Ray is an extra; without it an error says how to install it.
"""
