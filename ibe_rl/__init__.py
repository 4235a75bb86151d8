"""ibe_rl: agents that explain themselves while they learn, in the words they were taught with."""

import ibe_rl.env  # noqa: F401 - registers the environments with gymnasium
