"""Arms stay even in whatever order people come, finish, refuse, fail and stay away."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from own_study import write_study

from ibe_rl.apps.study.answers import FINISHED, NO_CONSENT, SCREENED_OUT, Answers, Person
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.sitting import FullError, enter

QUOTA, AT_ONCE = 60, 20
IN_MEMORY = Path(":memory:")
DESIGNS = {
    "two arms": {"arms": ["none", "ibe"]},
    "three arms": {"arms": ["none", "ibe", "paper"]},
    "within": {"arms": ["none", "ibe", "paper"], "design": "within"},
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Study]:
    folder = tmp_path_factory.mktemp("studies")
    small = {"practice": 0, "each_arm": 1, "attention_checks": 0}
    return {
        name: open_study(
            write_study(folder / name, quota=QUOTA, trials=small, test={"arms": ["ibe", "none"]}, **design)
        )
        for name, design in DESIGNS.items()
    }


def leave(answers: Answers, person: Person, lot: random.Random) -> None:
    """Drop out in one of the ways that there are."""
    how = lot.choice([NO_CONSENT, SCREENED_OUT, "stays away", "withdraws"])
    if how == "withdraws":
        answers.withdraw(person)
    elif how == "stays away":  # until the place is given to another
        answers._store.execute("UPDATE people SET last_at = '2000' WHERE number = ?", (person.number,))
    else:
        answers.end(person, how)


@settings(max_examples=10, deadline=None)
@given(lot=st.randoms(use_true_random=False), at_once=st.integers(1, AT_ONCE), unfair=st.booleans())
@pytest.mark.parametrize("design", DESIGNS)
def test_sixty_finished_people_are_even_when_a_third_drops_out(
    studies: dict[str, Study], design: str, lot: random.Random, at_once: int, unfair: bool
) -> None:
    """Unfair: all who drop out are of the same arm, as far as there are some."""
    study, answers = studies[design], Answers(IN_MEMORY)
    active, finished, left = list[Person](), list[Person](), 0
    while len(finished) < QUOTA:
        while len(active) < at_once:
            try:
                active.append(enter(study, answers))
            except FullError:
                break
        if unfair:
            active.sort(key=lambda one: one.arms)
        if left < len(finished) / 2:
            leave(answers, active.pop(0 if unfair else lot.randrange(len(active))), lot)
            left += 1
        else:
            finished.append(active.pop(-1 if unfair else lot.randrange(len(active))))
            answers.end(finished[-1], FINISHED)
    with pytest.raises(FullError):
        enter(study, answers)
    counts = Counter(one.arms for one in finished)
    assert max(counts.values()) - min(counts[order] for order in study.orders) <= 1
    answers.close()
