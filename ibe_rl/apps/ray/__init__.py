"""Ray: workers and whole runs on other machines.

In: how many workers, what each steps, and the address of a cluster or ``local``.
Out: batches of transitions as those of local workers (``workers``); the output and exit status of a command (``run``).
Imports: ``types``, ``runtime``, ``config``. Ray itself is an extra; without it a clear error says how to install it.
"""
