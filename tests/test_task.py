"""What an environment declares has to fit together."""

from dataclasses import replace
from typing import Any

import pytest
from by_hand import TASK, WORDS


def test_each_number_is_called_by_the_dimension_that_it_is_about():
    both = replace(TASK, phrases=(WORDS, WORDS), explained=(1, 0), explained_band=(1, 2), explained_range=())
    assert both.number_names == ("speed", "height")
    assert both.instruction_size == 2
    assert both.explained_range == (1, 1)
    assert both.observation_size == 3 + 2 + 1


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        (
            {"explained": (0, 1)},
            r"^Task\.explained=\(0, 1\) has 2 entries but Task\.phrases 1: allowed is one for each",
        ),
        ({"explained_band": ()}, r"^Task\.explained_band=\(\) has 0 entries but Task\.phrases 1"),
        ({"explained_range": (1, 2)}, r"^Task\.explained_range=\(1, 2\) has 2 entries but Task\.phrases 1"),
        ({"explained": (3,)}, r"^Task\.explained=\(3,\): allowed are 0 to 2$"),
        ({"explained": (-1,)}, r"^Task\.explained=\(-1,\): allowed are 0 to 2$"),
    ],
)
def test_what_does_not_fit_together_is_refused(wrong: dict[str, Any], expected: str):
    with pytest.raises(ValueError, match=expected):
        replace(TASK, **wrong)
