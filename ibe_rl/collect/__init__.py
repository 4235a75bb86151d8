"""Collects experience: training batches and whole greedy episodes.

``collector`` runs TorchRL's collector in one or several processes and yields batches; ``rollout`` rolls out the greedy
policy for evaluation, recording and explanation; ``schedule`` decides what is due at which frame.

In: environments, an instructor, a policy.
Out: batches ``[N, T]``, ``Episode``, ``Moment``, ``RecordedRollout``.
Imports: agents, instructors, envs and the packages below them.
"""
