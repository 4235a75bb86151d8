"""What the report calls its vocabularies, observers and cuts: keys of paper.json, labels, colours and markers."""

from __future__ import annotations

from ibe_rl.apps.plot_style import hexed
from ibe_rl.view import palette as colours

PAPERS, SIGNS_KEPT, SPLIT_MINMAX, DEFAULT = "paper", "paper_signs_kept", "default_split_minmax", "default"
"""The paper's vocabulary and ours, and two between them that each have a half of the other."""
AT_END, AT_CONTACT = "end", "contact"
"""Where the frames are cut off: at the end of the episode, as in the paper, or when it first touches the ground."""
STRAIGHT, NO_WORDS, SWAPPED, SHUFFLED = "straight_down", "no_explanation", "flipped", "shuffled"
PREDICTED_CHANGE, TRUE_END = "predicted_change", "true_future"
"""Observers that hear neither vocabulary as it is."""

CUT_NAMES = {AT_END: "cut at the end", AT_CONTACT: "cut at first contact"}
VOCABULARY_NAMES = {PAPERS: "the paper's vocabulary", DEFAULT: "our default vocabulary"}
VARIANT_LABELS = {
    PAPERS: "the paper's",
    SIGNS_KEPT: "the paper's split,\nsigns kept",
    SPLIT_MINMAX: "our split,\nmin-max",
    DEFAULT: "our default",
}
"""Kinds of vocabulary to their labels where they stand beside each other."""
OBSERVER_STYLES = {
    TRUE_END: ("the true future", colours.GREEN, "*"),
    PREDICTED_CHANGE: ("the predicted change, without words", colours.VIOLET, "o"),
    DEFAULT: ("the default vocabulary", colours.EXPLANATION, "D"),
    PAPERS: ("the paper's vocabulary", colours.PINK, "s"),
    NO_WORDS: ("no explanation: the motion continues", colours.PALE, "v"),
    STRAIGHT: ("no explanation: straight down from here", colours.MUTED, "^"),
    SHUFFLED: ("learnt from shuffled instructions", colours.MUTED, "X"),
    SWAPPED: ("the default, left and right swapped", colours.MUTED, "P"),
}
"""Observers, in the order in which they are drawn, to what they hear, their colour and their marker."""
OBSERVER_LABELS = {name: label for name, (label, _, _) in OBSERVER_STYLES.items()}
OBSERVER_COLOURS = {name: hexed(colour) for name, (_, colour, _) in OBSERVER_STYLES.items()}
OBSERVER_MARKERS = {name: marker for name, (_, _, marker) in OBSERVER_STYLES.items()}
