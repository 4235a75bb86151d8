"""``task=summary``: what an agent does as a whole, in its words.

In: an opened run, and another one or an earlier state of it to set beside it.
Out: ``summary/summary.json`` and ``summary/report.html`` in the folder of the run, and tables in the terminal.

``summarising`` plays, counts and writes. ``played`` makes an ``episode_in_words`` of each, ``steps`` has all their
steps as one table. From that come ``shares`` of phrases, where it is ``disobeying``, the ``telling`` episodes with
their ``films``, and two agents ``side_by_side``. ``printing`` is what the terminal shows, ``page`` what the page shows.
"""
