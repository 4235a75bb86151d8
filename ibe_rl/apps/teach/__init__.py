"""A person in the loop: the page on which one teaches the agent, and what carries it into the training.

The game that is watched is played by the collector's process, and so is the lesson: what is said has to be in the
observation of the next step. ``session`` decides what counts, ``lesson`` is the instructor that the environment asks,
``server`` serves the page from a thread of that process, ``link`` brings the policy, the vocabulary and the figures
there from the trainer, ``classroom`` is the trainer's end of it.

In: what the trainer's listeners hear, and what a person says in the browser.
Out: an instructor for the first environment, lesson.jsonl.
Imports: any room; nothing imports it, train.py reaches it by name.
"""
