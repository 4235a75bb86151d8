"""What the arms of a study are called in reports, and what their losses are measured in."""

from __future__ import annotations

from typing import Any

ARM_NAMES = {
    "none": "no explanation",
    "paper": "the paper's vocabulary",
    "ibe": "our vocabulary",
    "placebic": "words of another episode",
    "true_future": "the true future",
    "transfer": "no explanation, afterwards",
}


def unit(found: dict[str, Any]) -> str:
    """What a loss is measured in."""
    return "% wrong" if found["choices"] else "% of the width"
