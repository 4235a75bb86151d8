"""Where a policy will lead: the environment's own engine, from a snapshot."""

from ibe_rl.predict.simulator import Simulator, make_simulator

__all__ = ["Simulator", "make_simulator"]
