"""A person in the loop: the web page on which a person teaches the agent during training.

The lesson runs in the collector's process, because an instruction has to be in the observation of the next step.
``session`` decides which instruction applies, ``lesson`` is the instructor that the environment asks, and ``server``
serves the page from a thread of that process. ``link`` carries policy, vocabulary and metrics there from the trainer;
``classroom`` is the trainer's end.

In: the events that listeners of the trainer receive, and a person's instructions from the browser.
Out: an instructor for the first environment, lesson.jsonl.
Imports: any room; nothing imports it, train.py reaches it by name.
"""
