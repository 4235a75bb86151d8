"""Mixed models beside the registered test: people and episodes as crossed random effects."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from statsmodels.regression.mixed_linear_model import MixedLM

R_SCRIPT = """# The same models in R, with lme4. Run it in the folder of this file.
library(lme4)
trials <- read.csv("data/{file}")
people <- read.csv("data/{people_file}")
counts <- people$person[is.na(people$excluded) | people$excluded == ""]
trials <- subset(trials, block == arm & person %in% counts)
trials$arm <- relevel(factor(trials$arm), ref = "{reference}")
model <- {call}
summary(model)
confint(model, method = "Wald")
"""
LINEAR = "lmer(loss ~ arm + (1 | person) + (1 | episode), data = trials)"
BINOMIAL = "glmer(correct ~ arm + (1 | person) + (1 | episode), data = trials, family = binomial)"
_Z = 1.959964


def r_script(choices: bool, reference: str, file: str, people_file: str) -> str:
    """The model as a script for R.

    Args:
        choices: answers are right or wrong, no places.
        reference: arm that the others are held against.
        file: name of the table of trials.
        people_file: name of the table of people.
    """
    call = BINOMIAL if choices else LINEAR
    return R_SCRIPT.format(file=file, people_file=people_file, reference=reference, call=call)


def linear_model(trials: pd.DataFrame, arms: Sequence[str], reference: str) -> dict[str, Any] | None:
    """Fit loss ~ arm + (1 | person) + (1 | episode) by restricted maximum likelihood.

    Args:
        trials: that count, of people who count.
        arms: of the study.
        reference: arm that the others are held against.

    Returns:
        ``effects`` of each other arm in percent, with 95 % intervals and p by Wald; the standard deviations ``person``,
        ``episode`` and ``residual``; whether the fit ``converged``. None with fewer than two arms or three
        people, or where it cannot be fitted.
    """
    others = [arm for arm in arms if arm != reference and (trials["arm"] == arm).any()]
    if not others or not (trials["arm"] == reference).any() or trials["person"].nunique() < 3:
        return None
    data = trials[["loss", "person", "episode"]].assign(everything=1)
    for at, arm in enumerate(others):
        data[f"arm_{at}"] = (trials["arm"] == arm).astype(float)
    model = MixedLM.from_formula(  # all rows are one group, people and episodes its components of variance
        "loss ~ " + " + ".join(f"arm_{at}" for at in range(len(others))),
        data,
        groups="everything",
        re_formula="0",
        vc_formula={"episode": "0 + C(episode)", "person": "0 + C(person)"},
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of single optimisers; ``converged`` says how it ended
        try:
            fit = model.fit(reml=True, method=["lbfgs", "powell"])
        except np.linalg.LinAlgError:
            return None
    return {
        "formula": "loss ~ arm + (1 | person) + (1 | episode)",
        "reference": reference,
        "effects": {arm: _wald(fit, f"arm_{at}") for at, arm in enumerate(others)},
        "episode": float(np.sqrt(fit.vcomp[0])),
        "person": float(np.sqrt(fit.vcomp[1])),
        "residual": float(np.sqrt(fit.scale)),
        "converged": bool(fit.converged),
    }


def _wald(fit: Any, name: str) -> dict[str, Any]:
    value, error = float(fit.params[name]), float(fit.bse[name])
    return {"value": value, "low": value - _Z * error, "high": value + _Z * error, "p": float(fit.pvalues[name])}
