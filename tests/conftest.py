"""What all tests share."""

import os

os.environ["RERUN_STRICT"] = "1"  # wrong calls of rerun raise instead of being logged
