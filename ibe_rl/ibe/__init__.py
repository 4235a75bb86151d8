"""Instruction-based Behavior Explanation (IBE) on plain arrays.

Learns which expression of the instructor's scale belongs to a change of the state, and infers what the instructions
mean.

    delta       windows of episodes, logged steps
    interpret   axis and sign of the instructions, by a vote over evidence (sources) and rates (what they depend on)
    meaning     the values that come of it: Evidence, Meaning, Interpretation
    estimator   IBEMapping, with space, split and settings
    mapping     ClusterMapping, what it learns; identity keeps its cluster ids over refreshes
    horizon     how many steps ahead to explain
    vocabulary  expressions to phrases; meaning_lines, meanings to lines

In: episodes, or arrays of changes of the state and instructions.
Out: a ClusterMapping from changes to expressions, with the Meaning of each number of the instruction.
Imports: types, task, config; numpy, scipy and scikit-learn, no torch.
"""

from ibe_rl.ibe.delta import Windows, cut_windows, delta_states, top_episodes
from ibe_rl.ibe.estimator import IBEMapping
from ibe_rl.ibe.horizon import find_horizon, instruction_lasts, leading_change
from ibe_rl.ibe.identity import ClusterTransition, keep_identity
from ibe_rl.ibe.interpret import interpret
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Evidence, Interpretation, Meaning, Reactions, UnknownMeaningWarning, sayable
from ibe_rl.ibe.meaning_lines import asked, meaning_lines, positive_phrase
from ibe_rl.ibe.settings import IBEConfig, check_settings
from ibe_rl.ibe.space import TooLittleDataError, rule_axes
from ibe_rl.ibe.vocabulary import normalise, phrase, phrases_of

__all__ = [
    "ClusterMapping",
    "ClusterTransition",
    "Evidence",
    "IBEConfig",
    "IBEMapping",
    "Interpretation",
    "Meaning",
    "Reactions",
    "TooLittleDataError",
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
