"""What came out of a study, in sentences and beside the paper; every number is one that was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from statsmodels.stats.power import TTestIndPower

from ibe_rl.apps.paper.answers import SURE, TESTED
from ibe_rl.apps.paper.names import AT_END
from ibe_rl.apps.report_page import number
from ibe_rl.apps.study.arm_names import ARM_NAMES, unit
from ibe_rl.apps.study.comparisons import WANTED

PAPER_PEOPLE = (5, 4)
"""Students with and without explanations in the paper."""
FEWEST = 5
"""People in an arm below which a number is no more than an impression."""


def outcome(found: dict[str, Any]) -> list[str]:
    """The main results, the registered test first."""
    people, test = found["people"], found["registered"]
    pilot = "Pilot: no participants of the study. " if found["pilot"] else ""
    return [
        f"{pilot}{people['begun']} people began, {people['counted']} count; design: {found['design']}.",
        registered_sentence(test, unit(found)),
        *(_transfer_sentence(found["transfer"], unit(found)) if found["transfer"] else ()),
    ]


def registered_sentence(test: dict[str, Any], of: str) -> str:
    """What the registered test shows."""
    first, second = (ARM_NAMES[arm] for arm in test["arms"])
    if test["p"] is None:
        one, other = test["people"]
        return f"The registered test cannot be done yet: {one} people with {first}, {other} with {second}."
    change = "less" if test["difference"]["value"] < 0 else "more"
    verdict = f"people err {change} with {first}" if test["p"] < test["alpha"] else "no difference is shown"
    return (
        f"Registered test, {first} against {second}: {verdict}. Difference {number(test['difference'], 1, sign=True)} "
        f"{of}, {_p_is(test['p'])}, alpha = {test['alpha']:g}."
    )


def _transfer_sentence(test: dict[str, Any], of: str) -> list[str]:
    first, second = (ARM_NAMES[arm] for arm in test["arms"])
    what = f"{first} against {second}" if test["paired"] else f"people who had had {first} against those with {second}"
    return [
        f"Transfer, all without explanations: {what}: difference {number(test['difference'], 1, sign=True)} {of}, "
        f"{_p_is(test['p'])} (not registered)."
    ]


def p_value(p: float | None) -> str:
    """A p-value as it is written in a table."""
    if p is None:
        return "-"
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def _p_is(p: float) -> str:
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def caveats(found: dict[str, Any]) -> list[str]:
    """What to know before believing the numbers."""
    counts = found["people"]["by_arms"]
    lines = []
    few = [f"{arms} ({count})" for arms, count in counts.items() if count < FEWEST]
    if few:
        lines.append(
            f"fewer than {FEWEST} people count with {', '.join(few)}: these numbers are no more than an impression"
        )
    test = found["registered"]
    if test["episodes_of_both"] < test["episodes"]:
        one_arm = test["episodes"] - test["episodes_of_both"]
        lines.append(
            f"{one_arm} of {test['episodes']} episodes were seen under one arm of the registered test only; they tell "
            "nothing about it"
        )
    if found["model"] and not found["model"]["converged"]:
        lines.append("the fit of the mixed model did not converge: its numbers mean nothing")
    return lines


def least_effect(people: Sequence[int], alpha: float = SURE) -> float:
    """The smallest effect, in standard deviations of persons, that a t-test shows with a power of 80 %."""
    solved = TTestIndPower().solve_power(
        effect_size=None,
        nobs1=people[0],
        ratio=people[1] / people[0],
        alpha=alpha,
        power=WANTED,
        alternative="two-sided",
    )
    return float(solved)


def beside_paper(found: dict[str, Any]) -> list[tuple[str, str, str]]:
    """What, in the paper, here. The paper's numbers are those of Fukuchi et al. (2017), as far as it reports them."""
    test, people = found["registered"], found["people"]
    counts = " and ".join(str(count) for count in test["people"])
    paired = ", each person with both" if test["paired"] else ""
    who = "simulated or invited pilots" if found["pilot"] else "people"
    rows = [
        (
            "Who predicts",
            "nine students, five of them with explanations",
            f"{people['counted']} {who}; {counts} in the registered test{paired}",
        ),
        ("Episodes", "20", f"{len(found['episodes'])} in all"),
        ("Single episodes, corrected for all of them", TESTED[AT_END], _single(found)),
        ("Over all episodes", "not reported", registered_sentence(test, unit(found))),
    ]
    if min(test["people"]) >= 2 and not test["paired"]:
        rows.append(
            (
                f"Smallest effect that a t-test shows ({WANTED:.0%} power)",
                f"{least_effect(PAPER_PEOPLE):.1f} standard deviations (computed here)",
                f"{least_effect(test['people'], test['alpha']):.1f}",
            )
        )
    return rows


def _single(found: dict[str, Any]) -> str:
    first, second = found["registered"]["arms"]
    tested = [one for one in found["episodes"] if one["p"] is not None]
    sure = [one["loss"][first] < one["loss"][second] for one in tested if one["p"] < SURE]
    return f"of {len(tested)} episodes {sum(sure)} significantly better, {len(sure) - sum(sure)} significantly worse"
