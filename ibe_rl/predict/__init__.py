"""Where a policy will lead: the environment's own engine, from a snapshot."""

from ibe_rl.predict.simulator import Simulator

__all__ = ["Simulator"]
