"""The Python interface: what a user's own program calls, as the scripts do for a command line.

In: settings as values, environments, agents, mappings and listeners of the user's own package.
Out: a run with its parts (``settings``, ``loop``), and an agent that explains itself (``explained``).
Imports: every room below it. ``import ibe_rl`` imports nothing of this room before it is used.
"""
