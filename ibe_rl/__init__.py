"""ibe_rl: agents that explain themselves while they learn, in the words they were taught with.

Importing it registers the environments with gymnasium; IBE itself works on plain arrays, without torch.
"""

import ibe_rl.env  # noqa: F401 - registers the environments
from ibe_rl.ibe import ClusterMapping, IBEMapping, cut_windows, delta_states, phrase, top_episodes

__all__ = ["ClusterMapping", "IBEMapping", "cut_windows", "delta_states", "phrase", "top_episodes"]
