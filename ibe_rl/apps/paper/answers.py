"""What came out, in sentences and beside what the paper says; every number is one that was measured."""

from __future__ import annotations

from typing import Any

from ibe_rl.apps.paper.names import (
    AT_CONTACT,
    AT_END,
    CUT_NAMES,
    DEFAULT,
    NO_WORDS,
    PAPERS,
    SHUFFLED,
    SIGNS_KEPT,
    SPLIT_MINMAX,
    STRAIGHT,
)

SURE = 0.05
"""A corrected p below this is called significant."""
SMALL_PART = 0.03
"""Of the small movements; what changes less of them is called nothing."""
IN_PAPER = {"A": "63.3 %", "B": "83.3 %", "C": "none"}
CLAIMED = {
    -1.0: "“distributed to the left side more”, above all for A; seen, not tested",
    0.0: "“follow the instruction more often”; seen, not tested",
}
TESTED = {
    AT_END: "of 20 episodes one significantly better, one significantly worse; the others not told",
    AT_CONTACT: "not done",
}
"""What the paper says."""
MIXED = {
    PAPERS: "the paper's vocabulary",
    SIGNS_KEPT: "its split, signs kept instead of min-max",
    SPLIT_MINMAX: "our split with mean instructions and min-max",
    DEFAULT: "our default",
}


def answers(found: dict[str, Any]) -> dict[str, list[str]]:
    """The findings in sentences, by section of the report."""
    return {
        "agents": [_agents(found)],
        "preliminary": [_whole_claim(found), *(_claim(found, value) for value in found["phrases"])],
        "words": [_words(told) for told in found["expressions"]],
        "straight": [_small(told) for told in found["straight"]],
        "prediction": [_foretold(agent, cut) for agent in found["prediction"] for cut in CUT_NAMES],
    }


def headlines(found: dict[str, Any]) -> list[str]:
    """What came out, as far as the paper asked for it: its claim, and the words of its agent B."""
    [words, *_], [straight, *_] = found["expressions"], found["straight"]
    [agent, *_] = found["prediction"]
    foretold = [_foretold(agent, cut) for cut in CUT_NAMES]
    return [_agents(found), _whole_claim(found), _words(words), _small(straight), *foretold]


def table(found: dict[str, Any]) -> list[tuple[str, str, str]]:
    """What, in the paper, here."""
    about = found["protocol"]
    return [
        *((f"Success of agent {one['name']}", IN_PAPER[one["name"]], _success(one)) for one in found["agents"]),
        ("Kind of agent", "deep Q-learning (Mnih et al., 2015)", about["agent"].upper()),
        ("Steps n, clusters k", "60, 8", f"{about['horizon_steps']}, {about['n_clusters']}"),
        *(_claim_row(found, value) for value in found["phrases"]),
        *(_words_row(told) for told in found["expressions"]),
        *(_small_row(told) for told in found["straight"]),
        ("Who foretells", "nine students, five of them with explanations", "simulated observers, no people"),
        *(_foretold_row(agent, cut) for agent in found["prediction"] for cut in CUT_NAMES),
    ]


def _claim_row(found: dict[str, Any], value: str) -> tuple[str, str, str]:
    here = "; ".join(_superiority(agent, value) for agent in found["preliminary"])
    what = f"Told “{found['phrases'][value]}”: do the best episodes follow more?"
    return what, CLAIMED.get(float(value), "not shown"), here


def _words_row(told: dict[str, Any]) -> tuple[str, str, str]:
    here = "; ".join(f"{_name(name)} {_lean(one)}" for name, one in told["vocabularies"].items())
    return f"Do the clusters lean to a side? (agent {told['agent']})", "“skewed to the right”", here


def _small_row(told: dict[str, Any]) -> tuple[str, str, str]:
    here = "; ".join(f"{_name(name)} {_percent(told['rates'][name]['straight_left'])}" for name in (PAPERS, DEFAULT))
    return f"Small movements to the left called straight (agent {told['agent']})", "one episode, seen", here


def _foretold_row(agent: dict[str, Any], cut: str) -> tuple[str, str, str]:
    told = agent["cuts"][cut]
    what = f"Does the explanation help? (agent {agent['agent']}, {CUT_NAMES[cut]})"
    return what, TESTED[cut], f"{_versus(told, PAPERS)}; {_versus(told, DEFAULT)}"


def _agents(found: dict[str, Any]) -> str:
    told = [f"{one['name']} after {one['frame']:,} frames: {_success(one)}" for one in found["agents"]]
    far = [one["name"] for one in found["agents"] if not one["near"]]
    note = f" Not within 8 points of the paper's: {' and '.join(far)}; the search found none nearer." if far else ""
    return f"Agents of this run: {'; '.join(told)}.{note}"


def _success(one: dict[str, Any]) -> str:
    told = one["success"]
    low, high = (f"{100 * told[end]:.1f}" for end in ("low", "high"))
    return f"{100 * told['value']:.1f} % ({low} to {high}, {one['episodes']} fresh episodes)"


def _whole_claim(found: dict[str, Any]) -> str:
    """Whether the paper's claim holds here, in one sentence."""
    ways = [value for value in found["phrases"] if float(value)]
    stays = [value for value in found["phrases"] if not float(value)]
    same = f"among episodes with the same {found['protocol']['context']}"
    return (
        "That high-score episodes follow the instruction more holds here: told to go to a side, "
        f"{_count(found, ways, 'all')}; {same} {_count(found, ways, 'within')}. Told to go straight down, "
        f"{_count(found, stays, 'all')}; {same} {_count(found, stays, 'within')}."
    )


def _count(found: dict[str, Any], values: list[str], over: str) -> str:
    claims = [agent["told"][value]["claim"][over] for agent in found["preliminary"] for value in values]
    verdicts = [claim["holds"] for claim in claims if claim]
    yes, tests = verdicts.count("yes"), len(verdicts)
    often = "never" if not yes else "always" if yes == tests else "mostly" if yes > tests / 2 else "sometimes"
    return f"{often} ({yes} of {tests} tests, the reverse in {verdicts.count('no')})"


def _claim(found: dict[str, Any], value: str) -> str:
    asked = "move less to either side" if not float(value) else "move further that way"
    told = "; ".join(_verdict(agent, value, found["protocol"]["context"]) for agent in found["preliminary"])
    return f"Told “{found['phrases'][value]}”, do the best episodes {asked}? {told}."


def _verdict(agent: dict[str, Any], value: str, context: str) -> str:
    claims = agent["told"][value]["claim"]
    spoken = {"yes": "yes", "no": "no, the others do", "open": "no difference shown"}
    if claims["all"] is None:
        return f"{agent['agent']}: never told so in both groups"
    within = (
        f"; among episodes with the same {context}: {spoken[claims['within']['holds']]}" if claims["within"] else ""
    )
    return f"{agent['agent']}: {spoken[claims['all']['holds']]} ({_chance(claims['all'])}{within})"


def _superiority(agent: dict[str, Any], value: str) -> str:
    one = agent["told"][value]["claim"]["all"]
    return f"{agent['agent']}: {one['holds']} ({_chance(one)})" if one else f"{agent['agent']}: not told so"


def _chance(one: dict[str, Any]) -> str:
    told = one["superiority"]
    return f"chance {told['value']:.2f}, {told['low']:.2f} to {told['high']:.2f}"


def _words(told: dict[str, Any]) -> str:
    parts = [f"{_name(name)} {_lean(one)}" for name, one in told["vocabularies"].items()]
    return f"The clusters of agent {told['agent']}: {'; '.join(parts)}."


def _lean(one: dict[str, Any]) -> str:
    return f"skew {one['skew']:+.2f} ({one['below_zero']} expressions left of 0, {one['above_zero']} right)"


def _small(told: dict[str, Any]) -> str:
    """Whether min-max or the split makes the paper's mapping miss small movements."""
    rates = told["rates"]
    missed = {name: (_missed(rate, "left"), _missed(rate, "right")) for name, rate in rates.items()}
    if any(side is None for sides in missed.values() for side in sides):
        return f"Agent {told['agent']}: too few small movements to say when they are called straight."
    parts = "; ".join(
        f"{MIXED[name]} {100 * left:.0f} and {100 * right:.0f} %" for name, (left, right) in missed.items()
    )
    total = {name: sum(sides) / 2 for name, sides in missed.items()}
    minmax, split = total[PAPERS] - total[SIGNS_KEPT], total[SIGNS_KEPT] - total[DEFAULT]
    return (
        f"Small movements of agent {told['agent']} to the left and to the right that are not called so: {parts}. "
        f"Of all of them min-max {_causes(minmax)}, the paper's split {_causes(split)} to be missed."
    )


def _causes(share: float) -> str:
    if abs(share) < SMALL_PART:
        return "causes none"
    return f"{'causes' if share > 0 else 'saves'} {100 * abs(share):.0f} %"


def _missed(rate: dict[str, Any], side: str) -> Any:
    straight, wrong = rate[f"straight_{side}"]["value"], rate[f"wrong_{side}"]["value"]
    return None if straight is None else straight + wrong


def _foretold(agent: dict[str, Any], cut: str) -> str:
    told = agent["cuts"][cut]
    error = {name: f"{each['value']:.1f} %" for name, each in told["error"].items()}
    return (
        f"Simulated observers of agent {agent['agent']}, {CUT_NAMES[cut]}, are {error[NO_WORDS]} of the width off "
        f"without explanation ({error[STRAIGHT]} if they expect it straight down), {error[PAPERS]} with the "
        f"paper's vocabulary, {error[DEFAULT]} with the default, {error[SHUFFLED]} if instructions were shuffled. "
        f"Beside none {_versus(told, PAPERS)}; {_versus(told, DEFAULT)}."
    )


def _versus(told: dict[str, Any], name: str) -> str:
    test = next(each for each in told["tests"] if (each["explainer"], each["minus"]) == (name, NO_WORDS))
    better = "better" if test["difference"]["value"] < 0 else "worse"
    count = test["better_episodes"] + test["worse_episodes"]
    verdict = f"significantly {better}" if test["p_corrected"] < SURE else f"{better}, not significantly"
    return (
        f"{_name(name)} is {verdict} (better in {test['better_episodes']} of {count} episodes, "
        f"corrected p {test['p_corrected']:.3f})"
    )


def _name(name: str) -> str:
    return {PAPERS: "the paper's vocabulary", DEFAULT: "the default"}.get(name, name)


def _percent(told: dict[str, Any]) -> str:
    return "never moved so" if told["value"] is None else f"{100 * told['value']:.0f} %"
