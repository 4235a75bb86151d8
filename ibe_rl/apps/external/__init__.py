"""Agents that were trained elsewhere.

In: a policy of another library, or a function.
Out: a run folder with a vocabulary for it, and explanations.
Imports: any room below.
"""
