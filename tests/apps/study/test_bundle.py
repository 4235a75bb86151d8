"""A bundle is complete, shows a place what the server would show it, and no more."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from own_study import write_study

from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.bundle import bundled_page, make_bundle, shown_at_place
from ibe_rl.apps.study.content import about, content_of, feedback_on
from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.sitting import schedule_of
from ibe_rl.types import ConfigError

COLLECT = "https://collect.example.org/answers"
CODES = {"finished": "F1", "screened_out": "S1", "no_consent": "N1"}


def laid_out(folder: Path) -> list[Any]:
    answers = Answers(folder / FILE)
    try:
        return answers.people(pilots=True, laid_out=True)
    finally:
        answers.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_study(tmp_path / "study", recruiter="prolific", completion_codes=CODES)


def test_a_place_has_its_pages_in_order(folder: Path, tmp_path: Path) -> None:
    said = make_bundle(folder, str(tmp_path / "out"), COLLECT, people=4, address="https://www.example.org/s")
    assert said.startswith("4 places: ")
    places, study = laid_out(folder), open_study(folder)
    links = (tmp_path / "out/links.txt").read_text().split()
    assert links == [f"https://www.example.org/s/page.html?p={one.token}" for one in places]
    public = tmp_path / "out/public"
    assert {str(one.relative_to(public)) for one in public.rglob("*") if one.is_file()} == {
        *("page.html", "page.js", "trial.js", "draw.js", "bundle.js", "page.css", "about.json", "p/index.html"),
        *(f"p/{one.token}.json" for one in places),
    }
    assert json.loads((public / "about.json").read_text()) == {**about(study), "collect": COLLECT}
    assert sorted(one.arms for one in places) == [("ibe",)] * 2 + [("none",)] * 2
    for one in places:
        given, pages = json.loads((public / f"p/{one.token}.json").read_text()), schedule_of(study, one)
        assert [each["page"] for each in given["pages"]] == [page.name for page in pages]
        for each, page in zip(given["pages"], pages, strict=True):
            right = {"right": [1]} if page.kind == "comprehension" else {}
            shown = {"page": page.name, "kind": page.kind, **content_of(study, page), **right}
            assert each == json.loads(json.dumps({**shown, "feedback": feedback_on(study, page)}))
        assert given["attempts"] == 2
        way_back = {"code": "F1", "address": "https://app.prolific.com/submissions/complete?cc=F1"}
        assert given["ends"]["finished"] == way_back
        assert given["ends"]["withdrawn"] == {"code": "", "address": ""}


def test_a_place_tells_no_more_than_its_person_sees(folder: Path) -> None:
    """Truth only where feedback is shown; of the arms only the person's own; nothing of observers and seeds."""
    study = open_study(folder)
    for arms, others in ((("none",), 4), (("ibe",), 3)):
        make_bundle(folder, str(folder.parent / arms[0]), COLLECT, people=1)
        person = next(one for one in laid_out(folder) if one.arms == arms)
        place = shown_at_place(study, schedule_of(study, person))
        text = json.dumps(place)
        assert not re.search(r"truth|observers|success|seed|context|explanations|placebic|true_future", text)
        shown = [one for one in place["pages"] if one["feedback"]]
        assert [one["block"] for one in shown] == ["practice"]
        told = [one["recordings"][0]["said"] for one in place["pages"] if one.get("recordings")]
        assert len(told) == 4
        assert all(said is None for said in told) == (others == 4)


def test_the_page_finds_its_files_and_may_reach_the_endpoint_alone() -> None:
    html = (Path(bundled_page.__code__.co_filename).parent / "page.html").read_text()
    page = bundled_page(html, "https://collect.example.org:8443/answers")
    assert re.findall(r'(?:src|href)="([^"]+)"', page) == [
        *("data:,", "page.css", "bundle.js", "draw.js", "trial.js", "page.js")
    ]
    [policy] = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]+)"', page)
    assert policy.endswith("; connect-src 'self' https://collect.example.org:8443")
    assert policy.startswith("default-src 'self'; ")
    assert "frame-ancestors" not in policy
    assert '<meta name="referrer" content="no-referrer" />' in page


def test_a_second_bundle_goes_on_where_the_first_ended(folder: Path, tmp_path: Path) -> None:
    make_bundle(folder, str(tmp_path / "one"), COLLECT, people=1)
    make_bundle(folder, str(tmp_path / "two"), COLLECT, people=1)
    assert sorted(one.arms for one in laid_out(folder)) == [("ibe",), ("none",)]
    assert [one.number for one in laid_out(folder)] == [1, 2]
    assert len((tmp_path / "two/links.txt").read_text().split()) == 1


def test_it_freezes_the_study_unless_it_is_a_trial(folder: Path, tmp_path: Path) -> None:
    make_bundle(folder, str(tmp_path / "trial"), COLLECT, people=1, pilot=True)
    assert [one.pilot for one in laid_out(folder)] == [True]
    (folder / "texts/en/consent.md").write_text("# Really?")
    make_bundle(folder, str(tmp_path / "one"), COLLECT, people=1)
    (folder / "texts/en/consent.md").write_text("# Really not?")
    with pytest.raises(ConfigError, match=r"texts/en/consent.md changed after the first person had begun"):
        make_bundle(folder, str(tmp_path / "two"), COLLECT, people=1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"people": 0}, r"^people=0: allowed are 1 to 2000"),
        ({"people": 2_001}, r"^people=2001: allowed are"),
        ({"collect": ""}, r"^collect=: allowed is an address that begins with https:// or http://"),
        ({"collect": "collect.example.org"}, r"^collect=collect.example.org: allowed"),
        ({"collect": "https://a.example; script-src *"}, r"^collect=https://a.example; script-src \*: allowed"),
        ({"address": "www"}, r"^address=www: allowed is an address"),
    ],
)
def test_what_is_mistyped_is_named_before_anything_is_given_out(
    folder: Path, tmp_path: Path, wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        make_bundle(folder, **{"out": str(tmp_path / "out"), "collect": COLLECT, "people": 2, **wrong})
    assert not (tmp_path / "out").exists()
    assert not (folder / FILE).exists()


def test_what_is_there_is_kept(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(ConfigError, match=r"^out=.*/out: is there already"):
        make_bundle(folder, str(tmp_path / "out"), COLLECT, people=2)


def test_a_folder_that_cannot_be_written_gives_nothing_out(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=r"^out=.*/file/out: cannot be written \(Not a directory\)"):
        make_bundle(folder, str(tmp_path / "file/out"), COLLECT, people=2)
    assert laid_out(folder) == []


def test_sona_has_to_know_who_comes_back(folder: Path, tmp_path: Path) -> None:
    shutil.rmtree(folder)
    write_study(folder, recruiter="sona", completion_codes={**CODES, **dict.fromkeys(CODES, "https://s.example/?c=1")})
    with pytest.raises(ConfigError, match=r"^recruiter=sona: it has to know who comes back"):
        make_bundle(folder, str(tmp_path / "out"), COLLECT, people=2)
