"""What all tests share."""

import os

from hypothesis import settings

os.environ["RERUN_STRICT"] = "1"  # wrong calls of rerun raise instead of being logged

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
