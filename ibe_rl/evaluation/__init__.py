"""Evaluation of a finished run: are its explanations true?

The scripts open a run once (``runs.open_trained``) and hand it to one task, a function of the run and the settings:

    evaluate     task=evaluate: every explainer on the same moments, at every horizon, with intervals
    compare      task=compare: other mappings, learnt from the same log
    predictors   task=predictors: learned predictors against the exact one
    narration    task=episode: one episode in words

Their parts, from the bottom up:

    trained_run, moments      an opened run; the arrays of the evaluated moments
    rollouts, run_predictor   unseen episodes and their futures; the predictor that a run is explained with
    verbalise, refit          explanations at moments; vocabularies learnt again from the log
    baselines, controls       baselines to beat; negative controls
    rows, judging             metrics on every resample; all explainers at one horizon
    observers, changing       a simulated observer; policies in vocabularies of other ages
    advice                    the verdict in plain words, and what to do next
    report, tables, figures   files, terminal, PNG

In: a run folder, of which no code runs, and ``ExplainConfig``.
Out: evaluation/*.json, evaluation/moments.csv, figures/*.png, and tables in the terminal.
Imports: every room below; of ``view`` only how phrases are written; no applications.
"""
