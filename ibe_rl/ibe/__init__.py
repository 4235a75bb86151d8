"""Instruction-based Behavior Explanation on plain arrays: numpy and scikit-learn, no torch."""

from ibe_rl.ibe.delta import Windows, cut_windows, delta_states, top_episodes
from ibe_rl.ibe.mapping import ClusterMapping, PaperMapping, TooLittleDataError
from ibe_rl.ibe.vocabulary import NORMALISATIONS, normalise, phrase

__all__ = [
    "NORMALISATIONS",
    "ClusterMapping",
    "PaperMapping",
    "TooLittleDataError",
    "Windows",
    "cut_windows",
    "delta_states",
    "normalise",
    "phrase",
    "top_episodes",
]
