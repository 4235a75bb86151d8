"""From a finished run to whether what it says is true.

The scripts open a run once (``runs.open_run``) and hand it to one task, a function of the run and the settings:

    evaluate     task=evaluate: every explainer on the same moments, at every horizon, with intervals
    compare      task=compare: other mappings, learnt from the same log
    predictors   task=predictors: learned predictors beside the exact one
    narration    task=episode: one episode in words

What they are made of, from the bottom up:

    trained_run, moments      an opened run; the arrays of the judged moments
    rollouts, run_predictor   unseen episodes and their futures; the predictor that a run is explained with
    verbalise, refit          what a vocabulary says at moments; vocabularies learnt anew from the log
    baselines, controls       what explanations have to beat; what cannot be right
    rows, judging             metrics on every resample; all explainers at one horizon
    observers, changing       a simulated observer; policies in vocabularies of other ages
    advice                    the verdict in plain words, and what to do about it
    report, tables, figures   files, terminal, PNG

In: a run folder, and ``ExplainConfig``. No code from the folder runs.
Out: evaluation/*.json, evaluation/moments.csv, figures/*.png, and tables in the terminal.
Imports: every room below; of ``view`` only how phrases are written. Applications are its users, never imported.
"""
