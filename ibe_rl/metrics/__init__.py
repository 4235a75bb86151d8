"""Metrics: the quality of explanations, their uncertainty, and drift between refreshes.

Plain functions from arrays to numbers, without environments or files. Import the module that defines a name:

    quality     motion AUC and rank correlation, instruction F1, phrase accuracy
    bootstrap   the same scores on resamples of whole episodes, with intervals
    confidence  Brier score, expected calibration error, risk at a coverage; the calibration itself
    verdict     one word from a motion AUC: good, weak, reversed, unknown
    drift       change of a vocabulary or a policy between two refreshes
    observer    the simulated observer of the paper's prediction task
    effect      differences of two groups of episodes, paired tests, corrected p-values
    histogram   the paper's histograms

In: expressions, state changes, instructions and confidences as arrays; fitted mappings.
Out: numbers, NaN where undefined; ``Calibration`` and ``Verdict``.
Imports: types, task, ibe.
"""
