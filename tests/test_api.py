"""What the package exports is what docs/API.md lists, with the parameters that it lists."""

import inspect
import re
from pathlib import Path

import pytest

import ibe_rl

ROOT = Path(__file__).parent.parent
LISTED = dict(re.findall(r"^\| `(\w+)\((.*?)\)`", (ROOT / "docs" / "API.md").read_text(), re.MULTILINE))


def test_the_list_is_whole():
    assert sorted(LISTED) == sorted(ibe_rl.__all__)


@pytest.mark.parametrize("name", sorted(set(ibe_rl.__all__) - {"ConfigError"}))
def test_the_parameters_are_those_listed(name: str):
    found = inspect.signature(getattr(ibe_rl, name)).parameters.values()
    listed = [one for one in LISTED[name].split(", ") if one != "*"]
    assert [one.name for one in found] == listed
    assert ("*" in LISTED[name]) == any(one.kind is one.KEYWORD_ONLY for one in found)


@pytest.mark.parametrize("name", ibe_rl.__all__)
def test_all_of_it_says_what_it_is(name: str):
    assert inspect.getdoc(getattr(ibe_rl, name))


def test_methods_that_are_listed_are_there():
    text = (ROOT / "docs" / "API.md").read_text()
    for owner, methods in re.findall(r"^\| `(\w+)\(.*?\)`.*?\| (.*\.\w+\(.*) \|$", text, re.MULTILINE):
        for method, parameters in re.findall(r"`\.(\w+)\((.*?)\)`", methods):
            found = inspect.signature(getattr(getattr(ibe_rl, owner), method)).parameters
            assert [name for name in found if name != "self"] == [one for one in parameters.split(", ") if one]


def test_another_name_is_refused():
    with pytest.raises(AttributeError, match="'ibe_rl' has no attribute 'explain_everything'"):
        _ = ibe_rl.explain_everything
