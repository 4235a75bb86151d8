"""The vocabulary of a run over time: a new mapping from the log at each refresh.

``training_episodes`` chooses episodes of the log, ``fitting`` learns a mapping from them, ``refresh`` holds the result.
``tracker`` keeps the identity of clusters and measures drift, ``reactions`` probes the policy with opposite
instructions, ``listener`` is notified of all this.

In: the log of episodes, the greedy policy.
Out: ``Refresh``: a mapping, its training data, its changes.
Imports: explain, predict, metrics, ibe, collect and the packages below them.
"""
