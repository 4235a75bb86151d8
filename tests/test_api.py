"""docs/API.md lists what the package exports, as the package declares it."""

import ast
import re

import pytest
from processes import ROOT

import ibe_rl
from docs_site import api_list

PAGE = (ROOT / "docs" / "API.md").read_text()


def test_the_page_is_what_the_package_says():
    assert api_list.page(PAGE) == PAGE, "run python -m docs_site.api_list"


def test_the_list_is_whole():
    listed = [name for names in api_list.SECTIONS.values() for name in names]
    assert sorted(listed) == sorted(ibe_rl.__all__)
    assert re.findall(r"^### `(\w+)`", PAGE, re.MULTILINE) == listed


def test_type_checkers_see_the_same_names():
    stub = ast.parse((ROOT / "ibe_rl" / "__init__.pyi").read_text())
    seen = {
        alias.asname: f"{node.module}" for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert seen.keys() == set(ibe_rl.__all__)
    lazy = ibe_rl.IMPORTED_LATER
    assert {name: module for name, module in seen.items() if name in lazy} == lazy


@pytest.mark.parametrize("name", ibe_rl.__all__)
def test_all_of_it_says_what_it_is(name: str):
    assert getattr(ibe_rl, name).__doc__


def test_another_name_is_refused():
    with pytest.raises(AttributeError, match="'ibe_rl' has no attribute 'explain_everything'"):
        _ = ibe_rl.explain_everything
