"""From run folders to what can be told about them."""

from ibe_rl.evaluation.runs import TrainedRun, load_run

__all__ = ["TrainedRun", "load_run"]
