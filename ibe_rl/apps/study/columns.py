"""What the tables of a study hold, and how wrong an answer is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

THEN = ">"
"""Between the arms of a person, in order."""
TRIALS: Mapping[str, Mapping[str, Any]] = {
    "person": {"description": "Number of the person, from 1"},
    "arms": {"description": f"Arms of the person in the order of their blocks, {THEN} between them"},
    "arm": {"description": "Arm whose explanations were shown in this trial"},
    "block": {"description": "practice, the arm of the block, or transfer (without explanations, after all blocks)"},
    "task": {"description": "What was asked for"},
    "trial": {"description": "Place of the trial in its block, from 1", "minValue": 1},
    "order": {"description": "Place of the trial among all trials of the person, from 1", "minValue": 1},
    "episode": {"description": "Number of the episode, its file in stimuli/", "minValue": 0},
    "answer": {"description": "Answered place as a share of the picture's width, or number of the chosen option"},
    "truth": {"description": "What really came, in the same units as the answer"},
    "error": {
        "description": "Distance of the answered place from the true one; empty for choices",
        "unitText": "widths of the picture",
        "minValue": 0,
        "maxValue": 1,
    },
    "correct": {"description": "1 for the right choice, 0 for another; empty for places", "minValue": 0, "maxValue": 1},
    "loss": {
        "description": "Measure of the registered test: 100 error, or 100 for a wrong choice, 0 for the right one",
        "unitText": "percent",
        "minValue": 0,
        "maxValue": 100,
    },
    "confidence": {"description": "How sure the person was", "unitText": "percent", "minValue": 0, "maxValue": 100},
    "took_ms": {
        "description": "Time to the answer, from the appearance of the page or the end of a trial's recording",
        "unitText": "ms",
        "minValue": 0,
    },
    "hidden_ms": {"description": "How long of it another window hid the page", "unitText": "ms", "minValue": 0},
    "attention_ok": {"description": "1 if the person answered all attention checks rightly, else 0"},
}
"""Columns of the table of trials."""
ITEMS: Mapping[str, Mapping[str, Any]] = {
    "person": TRIALS["person"],
    "arms": TRIALS["arms"],
    "scale": {"description": "Name of the scale, or demographics"},
    "item": {"description": "Place of the item in it, from 1", "minValue": 1},
    "chosen": {"description": "Number of the chosen option, from 0; empty where it was left out", "minValue": 0},
    "score": {"description": "The same, counted from the other end for reversed items", "minValue": 0},
    "options": {"description": "How many options the item has", "minValue": 2},
    "reversed": {"description": "1 where the first option is the highest, else 0"},
}
"""Columns of the table of items."""
PEOPLE: Mapping[str, Mapping[str, Any]] = {
    "person": TRIALS["person"],
    "pilot": {"description": "1 for a simulated or invited person who tries the study out, else 0"},
    "arms": TRIALS["arms"],
    "ended": {"description": "How the person left; under_way if they have not"},
    "counted_trials": {"description": "Answered trials in the blocks of the arms", "minValue": 0},
    "failed_checks": {"description": "Attention checks that were answered wrongly", "minValue": 0},
    "median_s": {"description": "Median time of an answer in the blocks of the arms", "unitText": "s", "minValue": 0},
    "hidden_s": {"description": "How long another window hid the pages, in all", "unitText": "s", "minValue": 0},
    "excluded": {"description": "Why the person does not count in the registered test; empty if they do"},
}
"""Columns of the table of people."""
UNENDED = "under_way"


def counted(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials in the blocks of the arms."""
    return trials[trials["block"].to_numpy() == trials["arm"].to_numpy()]


def loss_of(value: Mapping[str, Any], truth: Mapping[str, Any]) -> float:
    """How wrong an answer is, in percent: of the picture's width for a place; 0 or 100 for a choice."""
    if "at" in value:
        return 100 * abs(float(value["at"]) - float(truth["at"]))
    return 100.0 * (value["choice"] != truth["choice"])
