"""Tables between their marks in a page, by hand."""

from pathlib import Path

import pytest

from benchmarks.pages import fill

OLD = "<!-- sight: python -m a -->\nold\n<!-- end of sight -->\n"
NEW = "<!-- sight: python -m a -->\n\n| new |\n\n<!-- end of sight -->\n"
OTHER = "<!-- other: python -m a -->\n{}<!-- end of other -->\n"


def test_a_table_takes_the_place_of_the_one_before(tmp_path: Path):
    page, full = tmp_path / "PAGE.md", OTHER.format("\n1\n2\n\n")
    page.write_text(f"above\n{OLD}between\n{OTHER.format('')}below\n")
    for _ in range(2):
        fill(page, {"other": ["1", "2"], "sight": ["| new |"]}, "a")
        assert page.read_text() == f"above\n{NEW}between\n{full}below\n"


def test_a_page_that_is_not_there_gets_the_tables_only(tmp_path: Path):
    fill(tmp_path / "new" / "PAGE.md", {"sight": ["| new |"]}, "a")
    assert (tmp_path / "new" / "PAGE.md").read_text() == NEW


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<!-- sight: python -m a -->",
        "<!-- end of sight -->",
        "<!-- sight: b -->\n<!-- end of sight -->",
        "<!-- end of sight -->\n<!-- sight: python -m a -->",
    ],
)
def test_a_page_without_a_place_is_refused(text: str, tmp_path: Path):
    page = tmp_path / "PAGE.md"
    page.write_text(text)
    with pytest.raises(
        ValueError, match=r"PAGE\.md: has no place for the table sight; allowed is one with <!-- sight: "
    ):
        fill(page, {"sight": []}, "a")
    assert page.read_text() == text
