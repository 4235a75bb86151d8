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
"""Of the small movements; a smaller share of them counts as none."""
IN_PAPER = {"A": "63.3 %", "B": "83.3 %", "C": "none"}
CLAIMED = {
    -1.0: "“distributed to the left side more”, above all for A; seen, not tested",
    0.0: "“follow the instruction more often”; seen, not tested",
}
TESTED = {
    AT_END: "of 20 episodes one significantly better, one significantly worse; the others not reported",
    AT_CONTACT: "not done",
}
"""What the paper says."""
MIXED_UP = {
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
        "words": [_words(results) for results in found["expressions"]],
        "straight": [_small(results) for results in found["straight"]],
        "prediction": [_prediction(agent, cut) for agent in found["prediction"] for cut in CUT_NAMES],
    }


def headlines(found: dict[str, Any]) -> list[str]:
    """What came out, as far as the paper asked for it: its claim, and the words of its agent B."""
    [words, *_], [straight, *_] = found["expressions"], found["straight"]
    [agent, *_] = found["prediction"]
    predictions = [_prediction(agent, cut) for cut in CUT_NAMES]
    return [_agents(found), _whole_claim(found), _words(words), _small(straight), *predictions]


def table(found: dict[str, Any]) -> list[tuple[str, str, str]]:
    """What, in the paper, here."""
    about = found["protocol"]
    return [
        *((f"Success of agent {one['name']}", IN_PAPER[one["name"]], _success(one)) for one in found["agents"]),
        ("Kind of agent", "deep Q-learning (Mnih et al., 2015)", about["agent"].upper()),
        ("Steps n, clusters k", "60, 8", f"{about['horizon_steps']}, {about['n_clusters']}"),
        *(_claim_row(found, value) for value in found["phrases"]),
        *(_words_row(results) for results in found["expressions"]),
        *(_small_row(results) for results in found["straight"]),
        ("Who predicts", "nine students, five of them with explanations", "simulated observers, no people"),
        *(_prediction_row(agent, cut) for agent in found["prediction"] for cut in CUT_NAMES),
    ]


def _claim_row(found: dict[str, Any], value: str) -> tuple[str, str, str]:
    here = "; ".join(_superiority(agent, value) for agent in found["preliminary"])
    what = f"Instructed “{found['phrases'][value]}”: do the best episodes follow more?"
    return what, CLAIMED.get(float(value), "not shown"), here


def _words_row(results: dict[str, Any]) -> tuple[str, str, str]:
    here = "; ".join(f"{_name(name)} {_lean(one)}" for name, one in results["vocabularies"].items())
    return f"Do the clusters lean to a side? (agent {results['agent']})", "“skewed to the right”", here


def _small_row(results: dict[str, Any]) -> tuple[str, str, str]:
    here = "; ".join(f"{_name(name)} {_percent(results['rates'][name]['straight_left'])}" for name in (PAPERS, DEFAULT))
    return f"Small movements to the left called straight (agent {results['agent']})", "one episode, seen", here


def _prediction_row(agent: dict[str, Any], cut: str) -> tuple[str, str, str]:
    results = agent["cuts"][cut]
    what = f"Does the explanation help? (agent {agent['agent']}, {CUT_NAMES[cut]})"
    return what, TESTED[cut], f"{_versus(results, PAPERS)}; {_versus(results, DEFAULT)}"


def _agents(found: dict[str, Any]) -> str:
    parts = [f"{one['name']} after {one['frame']:,} frames: {_success(one)}" for one in found["agents"]]
    far = [one["name"] for one in found["agents"] if not one["near"]]
    note = (
        f" Not within 8 points of the paper's: {' and '.join(far)}; no policy of the run comes closer." if far else ""
    )
    return f"Agents of this run: {'; '.join(parts)}.{note}"


def _success(one: dict[str, Any]) -> str:
    rate = one["success"]
    low, high = (f"{100 * rate[end]:.1f}" for end in ("low", "high"))
    return f"{100 * rate['value']:.1f} % ({low} to {high}, {one['episodes']} new episodes)"


def _whole_claim(found: dict[str, Any]) -> str:
    """Whether the paper's claim holds here, in one sentence."""
    ways = [value for value in found["phrases"] if float(value)]
    stays = [value for value in found["phrases"] if not float(value)]
    same = f"among episodes with the same {found['protocol']['context']}"
    return (
        "Do high-score episodes follow the instruction more? Instructed to go to a side: "
        f"{_count(found, ways, 'all')}; {same} {_count(found, ways, 'within')}. Instructed to go straight down: "
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
    verdicts = "; ".join(_verdict(agent, value, found["protocol"]["context"]) for agent in found["preliminary"])
    return f"Instructed “{found['phrases'][value]}”, do the best episodes {asked}? {verdicts}."


def _verdict(agent: dict[str, Any], value: str, context: str) -> str:
    claims = agent["told"][value]["claim"]
    spoken = {"yes": "yes", "no": "no, the others do", "open": "no difference shown"}
    if claims["all"] is None:
        return f"{agent['agent']}: not instructed so in both groups"
    within = (
        f"; among episodes with the same {context}: {spoken[claims['within']['holds']]}" if claims["within"] else ""
    )
    return f"{agent['agent']}: {spoken[claims['all']['holds']]} ({_chance(claims['all'])}{within})"


def _superiority(agent: dict[str, Any], value: str) -> str:
    one = agent["told"][value]["claim"]["all"]
    return f"{agent['agent']}: {one['holds']} ({_chance(one)})" if one else f"{agent['agent']}: not instructed so"


def _chance(one: dict[str, Any]) -> str:
    estimate = one["superiority"]
    return f"chance {estimate['value']:.2f}, {estimate['low']:.2f} to {estimate['high']:.2f}"


def _words(results: dict[str, Any]) -> str:
    parts = [f"{_name(name)} {_lean(one)}" for name, one in results["vocabularies"].items()]
    return f"The clusters of agent {results['agent']}: {'; '.join(parts)}."


def _lean(one: dict[str, Any]) -> str:
    return f"skew {one['skew']:+.2f} ({one['below_zero']} expressions left of 0, {one['above_zero']} right)"


def _small(results: dict[str, Any]) -> str:
    """Whether min-max or the split makes the paper's mapping miss small movements."""
    rates = results["rates"]
    missed = {name: (_missed(rate, "left"), _missed(rate, "right")) for name, rate in rates.items()}
    if any(side is None for sides in missed.values() for side in sides):
        return f"Agent {results['agent']}: too few small movements to say when they are called straight."
    parts = "; ".join(
        f"{MIXED_UP[name]} {100 * left:.0f} and {100 * right:.0f} %" for name, (left, right) in missed.items()
    )
    total = {name: sum(sides) / 2 for name, sides in missed.items()}
    minmax, split = total[PAPERS] - total[SIGNS_KEPT], total[SIGNS_KEPT] - total[DEFAULT]
    return (
        f"Small movements of agent {results['agent']} to the left and to the right that are not called so: {parts}. "
        f"Missed because of min-max: {_caused(minmax)}; because of the paper's split: {_caused(split)}."
    )


def _caused(share: float) -> str:
    return "none" if abs(share) < SMALL_PART else f"{100 * share:+.0f} %"


def _missed(rate: dict[str, Any], side: str) -> Any:
    straight, wrong = rate[f"straight_{side}"]["value"], rate[f"wrong_{side}"]["value"]
    return None if straight is None else straight + wrong


def _prediction(agent: dict[str, Any], cut: str) -> str:
    results = agent["cuts"][cut]
    error = {name: f"{each['value']:.1f} %" for name, each in results["error"].items()}
    return (
        f"Error of simulated observers of agent {agent['agent']}, {CUT_NAMES[cut]}, in % of the width: "
        f"{error[NO_WORDS]} without explanation ({error[STRAIGHT]} if they expect it straight down), "
        f"{error[PAPERS]} with the paper's vocabulary, {error[DEFAULT]} with the default, {error[SHUFFLED]} with "
        f"shuffled instructions. Compared with no explanation, {_versus(results, PAPERS)}; {_versus(results, DEFAULT)}."
    )


def _versus(results: dict[str, Any], name: str) -> str:
    test = next(each for each in results["tests"] if (each["explainer"], each["minus"]) == (name, NO_WORDS))
    better = "better" if test["difference"]["value"] < 0 else "worse"
    count = test["better_episodes"] + test["worse_episodes"]
    verdict = f"significantly {better}" if test["p_corrected"] < SURE else f"{better}, not significantly"
    return (
        f"{_name(name)} is {verdict} (better in {test['better_episodes']} of {count} episodes, "
        f"corrected p {test['p_corrected']:.3f})"
    )


def _name(name: str) -> str:
    return {PAPERS: "the paper's vocabulary", DEFAULT: "the default"}.get(name, name)


def _percent(rate: dict[str, Any]) -> str:
    return "no such movement" if rate["value"] is None else f"{100 * rate['value']:.0f} %"
