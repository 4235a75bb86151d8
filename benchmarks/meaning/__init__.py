"""A test-bed with known truth for the meaning of an instructor's words: ``python -m benchmarks.meaning``."""

from benchmarks.meaning.judge import Verdict, judge
from benchmarks.meaning.situation import Situation
from benchmarks.meaning.situations import situations
from benchmarks.meaning.trial import Trial, Truth

__all__ = ["Situation", "Trial", "Truth", "Verdict", "judge", "situations"]
