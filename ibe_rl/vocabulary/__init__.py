"""The vocabulary of a run over time: from the log to a mapping, again and again.

``training_episodes`` chooses episodes of the log, ``fitting`` learns a mapping from them, ``refresh`` is one such
time, ``tracker`` keeps the identity of clusters and measures drift, ``reactions`` asks the agent what it does if it is
told otherwise, ``listener`` is what hears of all this.

In: the log of episodes, the greedy policy.
Out: ``Refresh``: a mapping, what it was learnt from, what it changed.
Imports: explain, predict, metrics, ibe, collect and what stands below them.
"""
