"""What the terminal says of an episode in which the agent is told something else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from by_hand import TASK, on_a_line
from by_hand import WORDS as OF_THE_LIFT

from ibe_rl.evaluation.told_otherwise import MOST_ANSWERS, answers_table, listening_line
from ibe_rl.explain.phrasing import ExplainerState, put_in_words
from ibe_rl.explain.what_if import values_of, with_answers
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.types import Array, Explanation

VALUES = values_of(TASK)
LIFT = ExplainerState(on_a_line([-4, 0, 4]), 4, [OF_THE_LIFT])


def said_to(*answers: tuple[float, float, float]) -> list[Explanation]:
    """Explanations of steps, with how far it would go if told down, to stay, and up."""

    def going(changes: Array) -> list[Explanation]:
        return put_in_words(np.multiply.outer(changes, np.linspace(0, 1, 5))[:, None, :, None], LIFT)

    changes = np.array(answers, float)
    return with_answers(going(changes[:, 1]), going(changes.T.ravel()), VALUES)


def lines(said: list[Explanation]) -> list[str]:
    shown = PlainConsole(width=120, force_terminal=False)
    with shown.capture() as text:
        shown.print(answers_table(said, TASK.phrases))
    return [" ".join(line.split()) for line in text.get().splitlines()]


def test_a_row_stands_for_steps_with_the_same_answers():
    table = lines(said_to(*[(-4, 0, 4)] * 10, *[(4, 4, 4)] * 10))
    assert table[0] == "If it were told otherwise, next 4 steps"
    assert table[1] == "steps told going down told staying told going up listens"
    assert table[3:5] == ["0-9 going down staying going up 100%", "10-19 going up going up going up 0%"]


def test_the_table_is_no_longer_than_a_screen():
    rows = [(sign * 4, 0, step % 2 * 4) for step in range(60) for sign in [(-1) ** (step // 7)] for _ in range(7)]
    table = lines(said_to(*rows))
    assert "..." in table
    assert len(table) <= MOST_ANSWERS + 6


def test_of_many_values_those_with_the_same_answer_stand_together():
    said = said_to((-4, -4, 4), (4, 4, 4))
    more = [
        replace(one, what_if={f"{name} {number}": answer for number in (1, 2) for name, answer in one.what_if.items()})
        for one in said
    ]
    table = "\n".join(lines(more))
    assert "told going down 1 or staying 1 or going down 2 or staying 2: going down; told going up 1" in table
    assert "whatever it is told: going up" in table


def test_how_much_it_listens_is_said_and_where_it_does_not():
    line = listening_line(said_to(*[(-4, 0, 4)] * 5, *[(4, 4, 4)] * 15))
    assert line.startswith("It listens 25% (0 %: it does the same whatever it is told; 100 %: as it is told). ")
    assert line.endswith(
        "At 75% of the moments it does the same whatever it is told; at steps 5 to 19, whatever you say: going up."
    )
    assert listening_line(said_to((-4, 0, 4))).endswith("as it is told).")


@pytest.mark.parametrize("step", [0, 3])
def test_a_single_step_is_called_so(step: int):
    rows = [(-4, 0, 4)] * 5
    rows[step] = (0, 0, 0)
    assert f"at step {step}, whatever you say: staying" in listening_line(said_to(*rows))
