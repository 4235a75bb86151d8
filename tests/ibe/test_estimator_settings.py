"""Settings of the estimator that do not exist or that nothing would read."""

from typing import Any

import pytest
from sklearn.base import clone
from test_estimator_axis import heard, windows

from ibe_rl.ibe import IBEMapping, check_settings

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "one cluster": ({"n_clusters": 1}, "n_clusters=1: at least 2"),
    "memory without end": ({"memory": 1.0}, r"memory=1\.0: at least 0 and below 1"),
    "another space": ({"space": "outer"}, "space='outer': choose one of all, information, lasso, network, rule"),
    "a root of all": ({"power": 0.5}, r"power=0\.5: allowed is 1 with space=all"),
    "a root of a network": ({"space": "network", "power": 0.5}, r"power=0\.5: allowed is 1 with space=network"),
    "no power": ({"space": "rule", "power": 0.0}, "power=0: above 0"),
    "a layer of none": ({"space": "network", "hidden": [8, 0]}, r"hidden=\[8, 0\]: each at least 1"),
    "movement of all": (
        {"normalisation": "movement"},
        "normalisation=movement: allowed are minmax, sign with space=all",
    ),
    "direct of all": ({"membership": "direct"}, "membership=direct: allowed are hard, soft with space=all"),
    "graded of all": ({"membership": "graded"}, "membership=graded: allowed are hard, soft with space=all"),
    "graded of signs": (
        {"space": "rule", "normalisation": "sign", "membership": "graded"},
        "membership=graded: allowed are hard, soft, direct with normalisation=sign",
    ),
    "quantiles of all": ({"split": "quantile"}, "split=quantile: allowed are kmeans, bisecting with space=all"),
    "a network goes on": ({"space": "network", "last": "some"}, "last: allowed is None with space=network"),
    "halving goes on": ({"split": "bisecting", "last": "some"}, "last: allowed is None with split=bisecting"),
    "quantiles go on": (
        {"space": "rule", "split": "quantile", "last": "some"},
        "last: allowed is None with split=quantile, which starts from scratch",
    ),
    "another split": ({"split": "halves"}, "split='halves': choose one of kmeans, bisecting, quantile"),
    "another normalisation": ({"normalisation": "none"}, "normalisation='none': choose one of minmax, sign"),
    "another membership": ({"membership": "loose"}, "membership 'loose' of width .*: choose hard, soft, direct"),
}
BUILT_LATER = {"another split", "another normalisation", "another membership"}
"""Refused by those who read them, when there is something to read."""


@pytest.mark.parametrize("case", REFUSED)
def test_settings_that_cannot_work_are_refused(case: str):
    settings, message = REFUSED[case]
    estimator = IBEMapping(**settings)
    with pytest.raises(ValueError, match=message):
        clone(estimator).fit(*windows(), *heard())
    if case not in BUILT_LATER:
        with pytest.raises(ValueError, match=message):
            check_settings(estimator)


@pytest.mark.parametrize("space", ["information", "all"])
def test_spaces_of_the_state_refuse_what_needs_an_axis(space: str):
    for settings in ({"power": 0.5}, {"normalisation": "movement"}, {"membership": "direct"}, {"split": "quantile"}):
        with pytest.raises(ValueError, match=f"with space={space}"):
            check_settings(IBEMapping(space=space, **settings))


@pytest.mark.parametrize("space", ["lasso", "network", "rule"])
def test_spaces_of_instructions_allow_it(space: str):
    for settings in ({"normalisation": "movement"}, {"membership": "direct"}, {"split": "quantile"}):
        check_settings(IBEMapping(space=space, **settings))
