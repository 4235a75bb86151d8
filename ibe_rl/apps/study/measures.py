"""What is reported beside the registered test: confidence, learning, transfer, scales and single episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from ibe_rl.apps.study.columns import THEN, loss_of
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.registered import compared
from ibe_rl.apps.study.schedule import DEMOGRAPHICS, TRANSFER
from ibe_rl.apps.study.settings import NONE
from ibe_rl.metrics.bootstrap import episode_weights, estimate, ratio, weighted_mean
from ibe_rl.metrics.confidence import ece
from ibe_rl.metrics.effect import corrected
from ibe_rl.types import Array

RIGHT_WITHIN = 10.0
"""A place counts as right within so many percent of the picture's width, where confidence is held against it."""
CONFIDENCE_BINS = 5
"""Of confidence, in the figure."""


def arm_means(trials: pd.DataFrame, arms: Sequence[str], resamples: int, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Mean loss under each arm over the person means, with an interval over persons, and each person's mean."""
    found = {}
    for arm in arms:
        means = trials[trials["arm"] == arm].groupby("person")["loss"].mean()
        found[arm] = {
            "people": len(means),
            "each": means.tolist(),
            "loss": _over_people(means.to_numpy(), resamples, seed),
        }
    return found


def _over_people(values: Array, resamples: int, seed: int) -> dict[str, Any] | None:
    """Mean ``(P,)`` with an interval from people who are drawn again; None without people."""
    if not len(values):
        return None
    return estimate(weighted_mean(values, episode_weights(np.arange(len(values)), resamples, seed))).to_dict()


def calibration(trials: pd.DataFrame, resamples: int, seed: int = 0) -> dict[str, Any] | None:
    """How well confidence goes with being right, with intervals over persons; None where it was not asked for.

    Returns:
        ``confidence`` and ``right``, means in [0, 1]; ``ece``, the expected calibration error; ``slope`` of right on
        confidence, 1 if it is calibrated; ``bins`` with the number of answers, and means of both.
    """
    asked = trials[trials["confidence"].notna()]
    if not len(asked):
        return None
    sure = asked["confidence"].to_numpy(float) / 100
    right = asked["loss"].to_numpy(float) <= RIGHT_WITHIN
    weights = episode_weights(asked["person"].to_numpy(), resamples, seed)
    of_bin = np.minimum((sure * CONFIDENCE_BINS).astype(int), CONFIDENCE_BINS - 1)
    return {
        "answers": len(asked),
        "confidence": estimate(weighted_mean(sure, weights)).to_dict(),
        "right": estimate(weighted_mean(right, weights)).to_dict(),
        "ece": estimate(ece(sure, right, weights)).to_dict(),
        "slope": estimate(slopes(sure, right, weights)).to_dict(),
        "bins": [_bin(sure, right, weights, of_bin == at) for at in range(CONFIDENCE_BINS) if (of_bin == at).any()],
    }


def _bin(sure: Array, right: Array, weights: Array, members: Array) -> dict[str, Any]:
    share = estimate(weighted_mean(right[members], weights[:, members]))
    return {"answers": int(members.sum()), "confidence": float(sure[members].mean()), **share.to_dict()}


def slopes(x: Array, y: Array, weights: Array) -> Array:
    """Least-squares slopes of ``y`` on ``x`` ``(N,)`` under weights ``(R, N)``; NaN where ``x`` is constant."""
    mean_x, mean_y = weighted_mean(x, weights), weighted_mean(y, weights)
    total = weights.sum(axis=1, dtype=float)
    together = weights @ (x * y) - total * mean_x * mean_y
    spread = weights @ (x * x) - total * mean_x**2
    return ratio(together, np.where(spread > 1e-9 * total, spread, 0.0))


def learning(trials: pd.DataFrame, arms: Sequence[str], resamples: int, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Loss under each arm at each place in its block, and its slope: change of the loss in percent a trial."""
    found = {}
    for arm in arms:
        some = trials[trials["arm"] == arm]
        if not len(some):
            continue
        places = some["trial"].to_numpy(float)
        weights = episode_weights(some["person"].to_numpy(), resamples, seed)
        by_place = some.groupby("trial")["loss"].mean()
        found[arm] = {
            "trial": by_place.index.tolist(),
            "loss": by_place.tolist(),
            "slope": estimate(slopes(places, some["loss"].to_numpy(float), weights)).to_dict(),
        }
    return found


def transfer(trials: pd.DataFrame, arms: tuple[str, str], resamples: int, seed: int = 0) -> dict[str, Any] | None:
    """Compare what people do without explanations after a block with them; None where nothing can be compared.

    People of one arm are compared by it. Those of several arms are compared with themselves: the block ``transfer``
    against their block without explanations.

    Args:
        trials: all of people who count.
        arms: to compare.
        resamples: of persons and episodes.
        seed: the same trials and seed give the same numbers.
    """
    after = trials[trials["block"] == TRANSFER]
    if after["arms"].str.contains(THEN, regex=False).any():
        blocks = trials[trials["block"].isin([TRANSFER, NONE])]
        found = compared(blocks.assign(arm=blocks["block"]), (TRANSFER, NONE), resamples, seed)
    else:
        found = compared(after.assign(arm=after["arms"]), arms, resamples, seed)
    return None if found["p"] is None else found


def scales(items: pd.DataFrame, arms: Sequence[str], resamples: int, seed: int = 0) -> list[dict[str, Any]]:
    """Each scale: its reliability, and its mean from 0 to 100 by arm; of all together where people have several."""
    found = []
    for name in dict.fromkeys(items["scale"]):
        if name == DEMOGRAPHICS:
            continue
        of_scale = items[items["scale"] == name]
        share = 100 * of_scale["score"] / (of_scale["options"] - 1)
        means = share.groupby([of_scale["arms"], of_scale["person"]]).mean().dropna()
        by_arm = {arm: means[means.index.get_level_values(0) == arm].to_numpy() for arm in arms}
        groups = {arm: each for arm, each in by_arm.items() if len(each)} or {"all": means.to_numpy()}
        table = of_scale.pivot_table(index="person", columns="item", values="score")
        found.append(
            {
                "scale": name,
                "items": int(of_scale["item"].max()),
                "people": len(table),
                "alpha": cronbach_alpha(table.to_numpy(float)),
                "groups": {arm: _over_people(each, resamples, seed) for arm, each in groups.items()},
            }
        )
    return found


def cronbach_alpha(scores: Array) -> float | None:
    """Cronbach's alpha of scores ``(P, I)``; people who left an item out do not count; None where it is undefined."""
    whole = scores[~np.isnan(scores).any(axis=1)]
    people, items = whole.shape
    if people < 2 or items < 2 or not (total := whole.sum(axis=1).var(ddof=1)):
        return None
    return float(items / (items - 1) * (1 - whole.var(axis=0, ddof=1).sum() / total))


def demographics(study: Study, items: pd.DataFrame) -> list[dict[str, Any]]:
    """How often each option was chosen, for the questions that have options."""
    rows = []
    asked = study.questions[DEMOGRAPHICS]
    for item, chosen in items[items["scale"] == DEMOGRAPHICS].groupby("item")["chosen"]:
        question = asked[int(item) - 1]
        counts = {option: int((chosen == at).sum()) for at, option in enumerate(question.options)}
        rows.append({"question": question.text, "counts": counts | {"no answer": int(chosen.isna().sum())}})
    return rows


def episodes(study: Study, trials: pd.DataFrame, arms: Sequence[str], tested: tuple[str, str]) -> list[dict[str, Any]]:
    """Each episode that people were asked about, as in the paper.

    Args:
        study: opened.
        trials: that count, of people who count.
        arms: of the study.
        tested: the two arms of ``p``, by the ranks of the losses, corrected for all episodes; None where untested.

    Returns:
        For each episode the mean ``loss`` by arm, how many ``people`` it is of, and the ``observers``' losses.
    """
    found = []
    for number in sorted(set(trials["episode"])):
        here, stimulus = trials[trials["episode"] == number], study.stimuli[number]
        losses = {arm: here[here["arm"] == arm]["loss"].to_numpy(float) for arm in arms}
        found.append(
            {
                "episode": int(number),
                "file": stimulus["name"],
                "people": {arm: len(each) for arm, each in losses.items()},
                "loss": {arm: float(each.mean()) if len(each) else None for arm, each in losses.items()},
                "observers": observer_losses(stimulus, arms, "at" if here["error"].notna().any() else "choice"),
                "p": _rank_p(*(losses[arm] for arm in tested)),
            }
        )
    known = [one for one in found if one["p"] is not None]
    for one, p in zip(known, corrected([one["p"] for one in known]), strict=True):
        one["p"] = p
    return found


def _rank_p(first: Array, second: Array) -> float | None:
    """Two-sided p of Mann and Whitney's test; None with fewer than two people in an arm."""
    if min(len(first), len(second)) < 2:
        return None
    return float(stats.mannwhitneyu(first, second).pvalue)


def observer_losses(stimulus: Any, arms: Sequence[str], key: str) -> dict[str, float | None]:
    """Losses of the simulated observers in an episode, as those of people; None for arms that they did not hear."""
    said = stimulus.get("observers", {})
    return {arm: loss_of({key: said[arm][key]}, stimulus["truth"]) if arm in said else None for arm in arms}


def observer_means(of_episodes: Sequence[dict[str, Any]], arms: Sequence[str]) -> dict[str, float | None]:
    """Mean loss of the simulated observers over the same episodes."""
    means = {}
    for arm in arms:
        known = [one["observers"][arm] for one in of_episodes if one["observers"][arm] is not None]
        means[arm] = math.fsum(known) / len(known) if known else None
    return means
