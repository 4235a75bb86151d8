"""The documentation site and its pictures, made from docs/, the docstrings and the demo run."""
