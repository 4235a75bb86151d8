"""The page for those who run a study, on a port of its own: who is where, and whether new people are let in.

It shows counts, neither answers nor IDs.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler

from ibe_rl.apps.study.answers import FINISHED, NO_CONSENT, SCREENED_OUT, TIMED_OUT, WITHDRAWN, Answers, Person
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.guarding import ANSWERS, LOOPBACK, STUDY, guard, host_name, page_part, refused

UNDER_WAY = "under_way"
STATES = (FINISHED, UNDER_WAY, TIMED_OUT, SCREENED_OUT, NO_CONSENT, WITHDRAWN)
ADMIN_PARTS = {
    "/": ("admin.html", "text/html"),
    "/admin.js": ("admin.js", "text/javascript"),
    "/part/page.css": ("page.css", "text/css"),
}
MAX_REQUEST_BYTES = 1024


def admin_app(study: Study, answers: Answers) -> web.Application:
    """The admin page of a study, and what it asks."""
    app = web.Application(middlewares=[guard, _only_here], client_max_size=MAX_REQUEST_BYTES)
    app[STUDY], app[ANSWERS] = study, answers
    app.add_routes([web.get(path, _admin_part) for path in ADMIN_PARTS])
    app.add_routes([web.get("/state", _state), web.post("/recruiting", _recruit)])
    return app


def state_of_study(study: Study, answers: Answers) -> dict[str, Any]:
    """Counts of people by arm and page, pilots apart."""
    answers.release(study.settings.release_after_minutes)
    pages, everybody = answers.newest_pages(), answers.people(pilots=True)
    parts = {
        name: _counts(study, [one for one in everybody if one.pilot == pilot], pages)
        for name, pilot in (("people", False), ("pilots", True))
    }
    settings = study.settings
    about_study = {"title": settings.title, "quota": settings.quota, "protocol": study.protocol}
    return {**about_study, "recruiting": answers.recruiting, "states": STATES, **parts}


def _counts(study: Study, people: Sequence[Person], pages: dict[int, str]) -> list[dict[str, Any]]:
    """A row for each order of arms: how many are in each state, and which page those under way answered last."""
    rows = []
    for order in study.orders:
        those = [one for one in people if one.arms == order]
        states = Counter(one.ended or UNDER_WAY for one in those)
        last = Counter(pages.get(one.number, "") for one in those if one.ended is None)
        rows.append({"arms": list(order), "states": {name: states[name] for name in STATES}, "last_page": last})
    return rows


@web.middleware
async def _only_here(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse another name of this machine: it may be a site that has taken it on."""
    if host_name(request) not in LOOPBACK:
        return refused(403, "the admin page is reached as localhost")
    return await handler(request)


async def _admin_part(request: web.Request) -> web.Response:
    return page_part(*ADMIN_PARTS[request.path])


async def _state(request: web.Request) -> web.Response:
    return web.json_response(state_of_study(request.app[STUDY], request.app[ANSWERS]))


async def _recruit(request: web.Request) -> web.Response:
    """Stop or resume letting new people in; those under way go on."""
    body = await request.read()
    try:
        wanted = json.loads(body)["recruiting"]
    except (ValueError, RecursionError, KeyError, TypeError):
        wanted = None
    if not isinstance(wanted, bool):
        return refused(400, "recruiting is true or false")
    request.app[ANSWERS].recruiting = wanted
    return web.json_response(state_of_study(request.app[STUDY], request.app[ANSWERS]))
