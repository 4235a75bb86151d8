"""Whether explanations are true."""

from ibe_rl.metrics.quality import came_true, phrases_true

__all__ = ["came_true", "phrases_true"]
