"""The experiments of Fukuchi, Osawa, Yamakawa and Imai (2017), done again with the agents of one run.

``experiments`` is the way through: ``agents`` finds A, B and C, ``moves`` asks whether the best episodes follow the
instructions, ``words`` learns the vocabularies and asks when small movements are called straight, ``foretelling``
lets observers foretell where it will end; ``charts`` and ``strips`` draw it, ``page`` tells it.
"""
