"""``python -m ibe_rl.apps.study``; see ``commands``."""

from __future__ import annotations

import sys

from ibe_rl.apps.study.commands import study_command

if __name__ == "__main__":
    sys.exit(study_command())
