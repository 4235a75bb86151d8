"""A study with people: the paper's prediction task in a browser, from stimuli to statistics.

A study is a folder. ``settings`` and ``folder`` read and check it, ``stimuli`` fills it from a run. ``assignment``
gives each person an arm, ``schedule`` the pages that follow, ``answers`` keeps what they say, and ``sitting`` puts
these together: which page comes next, and whether an answer counts.

``make`` makes that folder: ``preparing`` flies the agent (``flights``), lets each arm speak (``arms``), draws what it
did (``scenes``) and cuts it into what people see (``stimuli``, or ``sides`` for two agents). ``shipped_texts`` copies
``texts``. ``commands`` is the command line.

Without a server: ``bundle`` lays the pages out as static files, and ``collecting`` takes what an endpoint has stored.

In: a trained run, study.yaml, texts. Out: answers.sqlite, and what is made from it.
Imports: any room; nothing imports it, the command line reaches it by name.
"""
