"""Environment and policy in, experience out: batches to learn from, and whole greedy episodes.

``collector`` runs TorchRL's collector in one process or several and yields batches; ``rollout`` plays episodes with
the greedy policy, to be counted, or to be recorded and explained; ``schedule`` says what is due at which frame.

In: environments, an instructor, a policy.
Out: batches ``[N, T]``, ``Episode``, ``Moment``, ``RecordedRollout``.
Imports: agents, instructors, envs and what stands below them.
"""
