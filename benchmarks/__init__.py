"""Benchmarks: every figure is a ratio of things run in turn, in one run, on one machine (docs/BENCHMARKS.md)."""
