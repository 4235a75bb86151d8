"""The experiments of Fukuchi, Osawa, Yamakawa and Imai (2017) with the agents of one run.

In: a finished run of an environment with one instruction number, ``motion``, ``first_contact`` and ``scene_path``.
Out: ``evaluation/paper.json``, figures and ``figures/report.html`` in the folder of the run.
Imports: ``evaluation`` and the rooms below it, ``apps.report_page`` and ``apps.plot_style``.

``experiments:reproduce`` does it all and ``report_context:check_report`` refuses before the training what it could not
do; the scripts reach both by these names. ``agents`` finds the paper's agents A, B and C. ``movements`` tests
whether the best episodes follow the instructions. ``vocabularies`` asks when small movements are called straight.
``prediction_task`` lets simulated observers foretell the end. ``charts`` and ``strips`` draw, ``answers`` says it in
sentences, ``page`` puts it together; ``names`` is what all of them call the same things.
"""
