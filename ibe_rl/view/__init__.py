"""The live view: a run as a rerun recording, and its server.

In: what the environment declares (``Task``), refreshes, recorded episodes with their explanations, rows of metrics.
Out: a recording file that grows (``recorder``), and the process that serves it in the browser (``relay``).
``viewer`` opens finished runs, ``overlay`` lays the curves of several over each other. ``sentences`` and ``wording``
are for people, ``palette`` has the colours that every figure shares.
Imports: ``types``, ``task``, ``runtime``, ``storage``, ``ibe``, ``metrics`` and, of ``vocabulary``, what a refresh is.
It knows nothing of training: nothing here opens a connection to the trainer, and what fails here ends no training.

The way of a refresh or an episode: ``run_recorder`` decides whether it is kept, ``recorder`` says where on the two
timelines it lies, ``chart`` and ``film`` log it, ``picture`` computes coordinates, ``blueprint`` lays out the panels.
``curves`` (over training) and ``lanes`` (over an episode) are drawn with axes of their own by ``marks``; ``spoken`` has
the rows of the table that the terminal and the recording share.
"""
