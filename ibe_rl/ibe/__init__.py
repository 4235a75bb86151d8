"""Instruction-based Behavior Explanation on plain arrays: numpy and scikit-learn, no torch."""

from ibe_rl.ibe.delta import Windows, cut_windows, delta_states, top_episodes
from ibe_rl.ibe.estimator import IBEMapping
from ibe_rl.ibe.horizon import find_horizon, instruction_lasts, leading_change
from ibe_rl.ibe.identity import Transition, keep_identity
from ibe_rl.ibe.interpret import Interpretation, Reactions, interpret
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Evidence, Meaning, UnknownMeaningWarning, sayable
from ibe_rl.ibe.meaning_lines import asked, meaning_lines, positive_phrase
from ibe_rl.ibe.settings import check_settings
from ibe_rl.ibe.space import TooLittleDataError, rule_axes
from ibe_rl.ibe.vocabulary import NORMALISATIONS, normalise, phrase, phrases_of

__all__ = [
    "NORMALISATIONS",
    "ClusterMapping",
    "Evidence",
    "IBEMapping",
    "Interpretation",
    "Meaning",
    "Reactions",
    "TooLittleDataError",
    "Transition",
    "UnknownMeaningWarning",
    "Windows",
    "asked",
    "check_settings",
    "cut_windows",
    "delta_states",
    "find_horizon",
    "instruction_lasts",
    "interpret",
    "keep_identity",
    "leading_change",
    "meaning_lines",
    "normalise",
    "phrase",
    "phrases_of",
    "positive_phrase",
    "rule_axes",
    "sayable",
    "top_episodes",
]
