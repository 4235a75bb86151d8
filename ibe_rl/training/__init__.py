"""The training loop's parts: building them, telling listeners, resuming, ending in order.

``build`` makes a run from its settings, ``run`` holds its parts and its state, ``listeners`` tells who listens,
``refreshing`` learns a vocabulary in the middle of it, ``instruction_reward`` rewards following instructions,
``resume`` and ``failure`` go on after an end that was not planned.

In: the composed settings, or the folder of a run to resume.
Out: a ``Run`` for train.py's loop, and its summary.
Imports: every room below; applications are reached by name.
"""
