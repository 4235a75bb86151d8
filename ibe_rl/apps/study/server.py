"""The web server of a study: loopback unless told otherwise; what it confirms is on disk."""

from __future__ import annotations

import json
import logging
import sqlite3
import traceback
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler

from ibe_rl.apps.study.answers import WITHDRAWN, Answers, Person
from ibe_rl.apps.study.commits import Commits
from ibe_rl.apps.study.content import about, feedback_on, shown_now
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.messages import MAX_ANSWER_BYTES, BadAnswerError, parse_answer
from ibe_rl.apps.study.recruiters import KNOWN, UnknownRecruitError, is_known_code, recruit_of
from ibe_rl.apps.study.settings import CODES
from ibe_rl.apps.study.sitting import FullError, enter, schedule_of, take

PAGE_PARTS = {
    "page.js": "text/javascript",
    "trial.js": "text/javascript",
    "draw.js": "text/javascript",
    "page.css": "text/css",
}
SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
STUDY, ANSWERS = web.AppKey("study", Study), web.AppKey("answers", Answers)
COMMITS = web.AppKey("commits", Commits)
LOOPBACK = ("127.0.0.1", "localhost", "::1")
_log = logging.getLogger("ibe_rl.study")


def study_app(study: Study, answers: Answers) -> web.Application:
    """The pages of a study, and what they ask."""
    app = web.Application(middlewares=[guard], client_max_size=MAX_ANSWER_BYTES)
    app[STUDY], app[ANSWERS], app[COMMITS] = study, answers, Commits(answers.store)
    app.add_routes(
        [
            web.get("/", _page),
            web.get("/about", _about),
            web.get("/part/{name}", _part),
            web.post("/begin", _begin),
            web.get("/p/{token}", _page),
            web.get("/p/{token}/now", _now),
            web.post("/p/{token}/answer", _answer),
            web.post("/p/{token}/withdraw", _withdraw),
        ]
    )
    return app


@web.middleware
async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse what other sites send; answer all others with JSON or a page, once what they brought is on disk."""
    try:
        response = await handler(request) if _is_own(request) else refused(403, "only the page of this study may send")
    except web.HTTPException as error:
        response = refused(error.status, error.reason)
    except Exception as error:
        response = _failed(error)
    try:
        await request.app[COMMITS].confirmed()
    except sqlite3.Error as error:
        response = _failed(error)
    response.headers.update(SECURITY_HEADERS)
    return response


def _failed(error: Exception) -> web.Response:
    """A reply after which the page tries again; the message may hold what somebody wrote, so it is not logged."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    _log.error("failed: %s in %s, line %d", type(error).__name__, Path(frame.filename).name, frame.lineno or 0)
    return refused(500, "this failed; it is tried again")


def refused(status: int, why: str, **more: Any) -> web.Response:
    """A reply that says why not, in the log too."""
    _log.warning("refused: %s", why)
    return web.json_response({"refused": why, **more}, status=status)


def host_name(request: web.Request) -> str:
    """The name or address under which the request reached the server, without its port."""
    return urlsplit(f"//{request.headers.get('Host', '')}").hostname or ""


def page_part(name: str, kind: str) -> web.Response:
    """A file of the package."""
    return web.Response(body=files(__package__).joinpath(name).read_bytes(), content_type=kind, charset="utf-8")


def _is_own(request: web.Request) -> bool:
    """Whether a request only reads, or comes from no other site."""
    origin = request.headers.get("Origin")
    return request.method != "POST" or origin is None or origin.partition("://")[2] == request.headers.get("Host")


async def _page(_: web.Request) -> web.Response:
    return page_part("page.html", "text/html")


async def _about(request: web.Request) -> web.Response:
    return web.json_response(about(request.app[STUDY]))


async def _part(request: web.Request) -> web.Response:
    name = request.match_info["name"]
    if name not in PAGE_PARTS:
        raise web.HTTPNotFound
    return page_part(name, PAGE_PARTS[name])


async def _begin(request: web.Request) -> web.Response:
    """Let somebody in; a link that is only opened, by a preview or a scanner, lets nobody in."""
    parameters = _parameters(await request.read())
    pilot = parameters.pop("pilot", "") == "1"
    if pilot and host_name(request) not in LOOPBACK:
        return refused(403, "refused_pilot")
    try:
        person = _let_in(request.app[STUDY], request.app[ANSWERS], parameters, pilot)
    except UnknownRecruitError:
        return refused(400, "refused_id")
    except BegunError:
        return refused(409, "refused_begun")
    except FullError:
        return refused(409, "refused_full")
    return web.json_response({"address": f"/p/{person.token}"})


class BegunError(Exception):
    """An ID that takes part already, in another session of the recruiter."""


def _let_in(study: Study, answers: Answers, parameters: Mapping[str, str], pilot: bool) -> Person:
    name = study.settings.recruiter
    external, fields = recruit_of(name, parameters)
    if name == CODES and not pilot and not is_known_code(study.folder, external):
        raise UnknownRecruitError("nobody gave out this code")
    if known := answers.of_recruit(name, external):
        if answers.recruit_fields(known) != fields:
            raise BegunError
        return known
    if not pilot and not answers.recruiting:
        raise FullError
    return enter(study, answers, pilot, name, external, fields)


async def _now(request: web.Request) -> web.Response:
    return web.json_response(shown_now(request.app[STUDY], request.app[ANSWERS], _person(request)))


async def _answer(request: web.Request) -> web.Response:
    """Keep an answer; the reply tells what became of it, what really happened, and what comes next."""
    study, answers, body = request.app[STUDY], request.app[ANSWERS], await request.read()
    person = _person(request)  # after the body has come: somebody may withdraw meanwhile
    try:
        answer = parse_answer(body)
        became = take(study, answers, person, answer)
    except BadAnswerError as error:
        return refused(409, str(error), now=shown_now(study, answers, _person(request)))
    page = next(one for one in schedule_of(study, person) if one.name == answer.page)
    reply = {"became": became, "feedback": feedback_on(study, page)}
    return web.json_response({**reply, "now": shown_now(study, answers, _person(request))})


async def _withdraw(request: web.Request) -> web.Response:
    """Delete a person; who has withdrawn is not there any more."""
    request.app[ANSWERS].withdraw(_person(request))
    return web.json_response({"now": {"ended": WITHDRAWN, "code": "", "address": ""}})


def _person(request: web.Request) -> Person:
    person = request.app[ANSWERS].person(request.match_info["token"])
    if person is None:
        raise web.HTTPNotFound(reason="nobody takes part under this address")
    return person


def _parameters(body: bytes) -> dict[str, str]:
    """What a recruiter added to the address, as the page sends it; other parameters are left out."""
    try:
        given = json.loads(body)
    except (ValueError, RecursionError):
        given = None
    known = {one for recruiter in KNOWN.values() for one in (recruiter.id, *recruiter.fields)} | {"pilot"}
    if not isinstance(given, Mapping):
        return {}
    return {name: value for name, value in given.items() if name in known and _is_text(value)}


def _is_text(value: Any) -> bool:
    """Whether this can be written down: half a character, as JSON allows it, cannot."""
    return isinstance(value, str) and value.isprintable()
