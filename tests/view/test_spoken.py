"""What was said, as rows."""

import numpy as np
from view_data import HORIZON_STEPS, explain, flights, refreshed

from ibe_rl.metrics.stability import FLICKER_STEPS
from ibe_rl.view import spoken
from ibe_rl.view.spoken import without_flicker


def told(told: str, *words: str) -> list[tuple[str, ...]]:
    return [(told, word) for text in words for word in text.split()]


def said(words: list[tuple[str, ...]]) -> str:
    return " ".join(each[1] for each in words)


def test_a_change_that_is_undone_soon_is_none() -> None:
    short, long = "b " * FLICKER_STEPS, "b " * (FLICKER_STEPS + 1)
    assert said(without_flicker(told("up", "a", short, "a"))) == "a " * (FLICKER_STEPS + 1) + "a"
    assert said(without_flicker(told("up", "a", long, "a"))) == f"a {long}a"
    assert said(without_flicker(told("up", "a b a c a a b b b"))) == "a a a a a a b b b"
    assert said(without_flicker(told("up", "a b c c c c c c"))) == "a b c c c c c c"  # it does not go back


def test_what_is_told_is_never_changed() -> None:
    words = [*told("up", "a a"), *told("down", "a"), *told("up", "a a")]
    assert without_flicker(words) == words


def test_rows_hold_all_steps_and_their_figures() -> None:
    spoken_there = explain(flights()[1], refreshed())[:4]
    words = told("up", "a b a c")
    rows = spoken.spoken_rows(words, spoken_there, np.array([1.0, 0.0, 1.0, 1.0]))
    assert [(row.first, row.last) for row in rows] == [(0, 2), (3, 3)]
    assert rows[0].cells[:3] == ("0-2", "up", "a")
    assert rows[0].cells[-1] == "67%"  # each step is judged by what was said there
    mean = np.mean([spoken_there[step].expression[0] for step in (0, 2)])
    assert rows[0].cells[3] == f"{mean:+.2f}"
    assert len(spoken.spoken_rows(words, spoken_there, np.ones(4), steady=False)) == 4
    table = spoken.markdown(spoken_there, rows).splitlines()
    assert table[0] == f"| steps | instruction | next {HORIZON_STEPS} steps | expression | confidence | as predicted |"
    assert len(table) == 4


def test_phrases_are_shown_as_they_are_in_a_table_of_markdown() -> None:
    said = explain(flights()[0], refreshed())
    rows = [spoken.Row(0, 1, ("0-1", "going [left]", "*a* | <b> _c_ `d` ~e~ $f$ &lt; \\g", "x_1 and +0.53", "-"))]
    line = spoken.markdown(said, rows).splitlines()[-1]
    shown = r"\*a\* \| \<b\> \_c\_ \`d\` \~e\~ \$f\$ \&lt; \\g"
    assert line == rf"| 0-1 | going \[left\] | {shown} | x_1 and +0.53 | - |"
