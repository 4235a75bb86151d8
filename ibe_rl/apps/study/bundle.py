"""A study as a folder of static files: each place is laid out beforehand, answers go to an endpoint of the lab's own.

public/page.html, *.js, page.css   the pages, for any web host
public/about.json                  what all pages need, and the address of the endpoint
public/p/PLACE.json                the pages of one person in order, and how they end
links.txt                          the link of each place; not for the host

A place's file has no other arm. It has what its page decides by: the right answers of the comprehension check, what is
shown after a trial, and the completion codes.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from contextlib import closing
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ibe_rl.apps.study.answers import FILE, FINISHED, NO_CONSENT, SCREENED_OUT, WITHDRAWN, Answers, Person
from ibe_rl.apps.study.content import about, content_of, feedback_on
from ibe_rl.apps.study.folder import Study, hold_protocol, open_study
from ibe_rl.apps.study.guarding import SECURITY_HEADERS
from ibe_rl.apps.study.recruiters import way_out
from ibe_rl.apps.study.schedule import COMPREHENSION, Page
from ibe_rl.apps.study.server import PAGE_PARTS
from ibe_rl.apps.study.settings import SONA
from ibe_rl.apps.study.sitting import lay_out, schedule_of
from ibe_rl.types import ConfigError

PUBLIC, PLACES, LINKS, PAGE_HTML, BUNDLE_JS = "public", "p", "links.txt", "page.html", "bundle.js"
MOST_PLACES = 2_000
_WEB = re.compile(r"https?://[\w.:\[\]-]+(/[\w./~%-]*)?", re.ASCII)
_FRAMES = "frame-ancestors"  # only a header can say this


def make_bundle(folder: Path, out: str, collect: str, people: int, address: str = "", pilot: bool = False) -> str:
    """Lay a study out as static files for a web host; from then on it is frozen.

    Args:
        folder: of the study.
        out: folder to make: its ``public`` is for the web host, its ``links.txt`` is not.
        collect: address of the endpoint that stores the answers.
        people: how many places are laid out, with the arms balanced over them.
        address: where ``public`` will be, for complete links.
        pilot: those who come by these links are pilots; the study stays open to changes.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    study = open_study(folder)
    _check(study, Path(out), collect, people, address)
    temporary = Path(out).with_name(f"{Path(out).name}.part")
    shutil.rmtree(temporary, ignore_errors=True)
    with closing(Answers(folder / FILE)) as answers:
        hold_protocol(study, answers)
        try:
            with answers.transaction():
                persons = [lay_out(study, answers, pilot) for _ in range(people)]
                _write(temporary / PUBLIC, study, persons, collect)
                links = [f"{_beginning(address)}{PAGE_HTML}?p={one.token}\n" for one in persons]
                (temporary / LINKS).write_text("".join(links), encoding="utf-8")
                temporary.rename(out)
        except OSError as error:
            raise ConfigError(f"out={out}: cannot be written ({error.strerror}); nothing was given out") from None
    return f"{people} places: {Path(out) / PUBLIC} is for the web host; the links are in {Path(out) / LINKS}"


def _check(study: Study, out: Path, collect: str, people: int, address: str) -> None:
    if out.exists():
        raise ConfigError(f"out={out}: is there already; allowed is a folder that is to be made")
    if not 1 <= people <= MOST_PLACES:
        raise ConfigError(f"people={people}: allowed are 1 to {MOST_PLACES}")
    for key, value in (("collect", collect), ("address", address)):
        if not _WEB.fullmatch(value) and (value or key == "collect"):
            raise ConfigError(f"{key}={value}: allowed is an address that begins with https:// or http://")
    if study.settings.recruiter == SONA:
        raise ConfigError(f"recruiter={SONA}: it has to know who comes back; allowed with a bundle are the others")


def _beginning(address: str) -> str:
    """The address of a folder, with its stroke at the end; empty for links without one."""
    return f"{address.rstrip('/')}/" if address else ""


def _write(public: Path, study: Study, persons: Sequence[Person], collect: str) -> None:
    (public / PLACES).mkdir(parents=True)
    (public / PLACES / "index.html").touch()  # a host that lists folders lists no places
    parts = files(__package__)
    for name in (*PAGE_PARTS, BUNDLE_JS):
        (public / name).write_bytes(parts.joinpath(name).read_bytes())
    page = bundled_page(parts.joinpath(PAGE_HTML).read_text(encoding="utf-8"), collect)
    (public / PAGE_HTML).write_text(page, encoding="utf-8")
    _write_json(public / "about.json", {**about(study), "collect": collect})
    for person in persons:
        _write_json(public / PLACES / f"{person.token}.json", shown_at_place(study, schedule_of(study, person)))


def bundled_page(html: str, collect: str) -> str:
    """The page with relative paths, with ``bundle.js``, and with the rules that a server would send as headers."""
    parts = urlsplit(collect)
    rules = [one for one in SECURITY_HEADERS["Content-Security-Policy"].split("; ") if not one.startswith(_FRAMES)]
    policy = "; ".join([*rules, f"connect-src 'self' {parts.scheme}://{parts.netloc}"])
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}" />\n    '
    meta += '<meta name="referrer" content="no-referrer" />\n    '
    first = '<script src="draw.js">'
    html = html.replace("/part/", "").replace("<title>", f"{meta}<title>", 1)
    return html.replace(first, f'<script src="{BUNDLE_JS}"></script>\n    {first}', 1)


def shown_at_place(study: Study, pages: Sequence[Page]) -> dict[str, Any]:
    """All that one place shows: its pages in order, attempts at the comprehension check, and the ways out."""
    settings, ends = study.settings, (FINISHED, SCREENED_OUT, NO_CONSENT, WITHDRAWN)
    sent = {"bundle": "1"}  # a recruiter may have sent them; none of the recruiters here needs anything back
    return {
        "pages": [_page_of(study, page) for page in pages],
        "attempts": settings.comprehension_attempts,
        "ends": {end: way_out(settings.recruiter, end, settings.completion_codes, sent) for end in ends},
    }


def _page_of(study: Study, page: Page) -> dict[str, Any]:
    shown = {"page": page.name, "kind": page.kind, **content_of(study, page), "feedback": feedback_on(study, page)}
    asked = study.questions[COMPREHENSION]
    return {**shown, "right": [one.right for one in asked]} if page.kind == COMPREHENSION else shown


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, separators=(",", ":"), allow_nan=False), encoding="utf-8")
