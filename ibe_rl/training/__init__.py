"""The parts of the training loop: building, notifying listeners, resuming, failing safely.

``build`` makes a run from its settings, ``run`` holds its parts and state, ``listeners`` notifies all listeners.
``refreshing`` relearns the vocabulary during training, ``instruction_reward`` rewards following instructions.
``failure`` keeps the data when training fails, ``resume`` continues from it.

In: the composed settings, or the folder of a run to resume.
Out: a ``Run`` for train.py's loop, and its summary.
Imports: every package below; applications are loaded by name.
"""
