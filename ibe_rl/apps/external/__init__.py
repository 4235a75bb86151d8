"""Policies that were trained elsewhere, explained in an instructor's words.

In: an agent (a ``.zip`` of stable-baselines3, a TorchRL policy, any function), and ``ExplainConfig``.
Out: a run folder without the policy (``folder``), opened as a ``TrainedRun`` (``explaining``).
Imports: every room of the core; reached by ``explain.py agent=`` and as ``ibe_rl.explain_agent``.
"""
