"""The documentation site: what is copied, generated and built, and that it asks nobody else for anything."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from processes import ROOT

import ibe_rl
from docs_site import __main__ as site

LOADS = {"script": "src", "img": "src", "iframe": "src", "link": "href", "source": "src"}


class Loaded(HTMLParser):
    """Collects the addresses that a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        address = dict(attrs).get(LOADS.get(tag, ""))
        self.found += [address] if address else []


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_loads_nothing_from_elsewhere() -> None:
    assert site.main() == 0
    pages = sorted(site.SITE.rglob("*.html"))
    assert {"index.html", "REFERENCE.html", "quick_start.html"} <= {page.name for page in pages}
    for page in pages:
        loaded = Loaded()
        loaded.feed(page.read_text())
        assert loaded.found
        assert not [address for address in loaded.found if re.match(r"(https?:)?//", address)], page
    for sheet in site.SITE.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", sheet.read_text()), sheet
    documented = (site.SITE / "REFERENCE.html").read_text()
    for name in ibe_rl.__all__:
        assert re.search(rf'id="ibe_rl\.[\w.]*\.{name}"', documented), name
    assert "IBEMapping" in (site.SITE / "search.json").read_text()


def test_every_page_is_in_the_navigation() -> None:
    listed = (ROOT / "zensical.toml").read_text()
    for page in site.DOCS.rglob("*.md"):
        assert f'"{page.relative_to(site.DOCS)}"' in listed
    for notebook in site.DOCS.rglob("*.ipynb"):
        assert f'"{notebook.relative_to(site.DOCS).with_suffix(".md")}"' in listed


def test_a_notebook_becomes_a_page() -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "text"]},
        {"cell_type": "code", "source": ["print(1)"], "outputs": [{"text": ["1\n"]}, {"data": {"image/png": "…"}}]},
        {"cell_type": "code", "source": ["pass"], "outputs": []},
    ]
    expected = "# Title\ntext\n\n```python\nprint(1)\n```\n\n```text\n1\n```\n\n```python\npass\n```\n"
    assert site.as_page({"cells": cells}) == expected


def test_links_lead_to_pages_of_the_site(tmp_path: Path) -> None:
    (tmp_path / "docs" / "notebooks").mkdir(parents=True)
    (tmp_path / "docs" / "A.md").write_text("[n](notebooks/n.ipynb)")
    (tmp_path / "docs" / "notebooks" / "n.ipynb").write_text('{"cells": []}')
    site.stage(tmp_path / "docs", tmp_path / "copy")
    assert (tmp_path / "copy" / "A.md").read_text() == "[n](notebooks/n.md)"
    assert (tmp_path / "copy" / "notebooks" / "n.md").exists()
    assert "::: ibe_rl.task.Task\n" in (tmp_path / "copy" / "REFERENCE.md").read_text()
