"""Whether explanations are true, how sure that is, and what moved.

Plain functions from arrays to numbers; none of them acts, plays or reads files. Import the module that defines a name:

    quality     did it go as was said? motion AUC and rank correlation, instruction F1, phrase accuracy
    bootstrap   the same scores on resamples of whole episodes, and the intervals from them
    confidence  Brier score, expected calibration error, risk at a coverage; the calibration itself
    verdict     one word from a motion AUC: good, weak, reversed, unknown
    drift       how far a vocabulary or a policy moved between two refreshes; how evenly clusters are used
    observer    the simulated observer of the paper's prediction task
    effect      differences of two groups of episodes, paired tests, corrected p-values
    histogram   the paper's histograms

In: expressions, state changes, instructions and confidences as arrays; mappings only to be asked.
Out: numbers, NaN where the data cannot tell; ``Calibration`` and ``Verdict``.
Imports: types, task, ibe.
"""
