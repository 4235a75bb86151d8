"""A test-bed with known truth for the meaning of an instructor's words: ``python -m benchmarks.meaning``."""

from benchmarks.meaning.flown import Flown, Truth
from benchmarks.meaning.judge import Verdict, judge
from benchmarks.meaning.situation import Situation
from benchmarks.meaning.situations import situations

__all__ = ["Flown", "Situation", "Truth", "Verdict", "judge", "situations"]
