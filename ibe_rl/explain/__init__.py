"""What the agent says about its next steps, and how sure it is.

In: moments, the policy, a predictor, and an ExplainerState (vocabularies, words, calibration).
Out: one Explanation for each moment, and what of it is spoken, step by step.
Imports: types, task, ibe, metrics.
"""
