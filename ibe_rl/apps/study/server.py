"""The web server of a study: loopback unless told otherwise; what it confirms is on disk."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler

from ibe_rl.apps.study.answers import Answers, Person
from ibe_rl.apps.study.content import feedback_on, shown_now
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.messages import MAX_BYTES, BadAnswerError, parse
from ibe_rl.apps.study.recruiters import KNOWN, UnknownRecruitError, recruit_of
from ibe_rl.apps.study.sitting import FullError, enter, schedule_of, take

PARTS = {
    "page.js": "text/javascript",
    "draw.js": "text/javascript",
    "page.css": "text/css",
}
SECURITY = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
STUDY, ANSWERS = web.AppKey("study", Study), web.AppKey("answers", Answers)
OPEN = web.AppKey("open", dict[str, bool])
"""Whether new people are let in; the admin page changes it."""
_log = logging.getLogger("ibe_rl.study")


def make_app(study: Study, answers: Answers) -> web.Application:
    """The pages of a study, and what they ask."""
    app = web.Application(middlewares=[_guard], client_max_size=MAX_BYTES)
    app[STUDY], app[ANSWERS], app[OPEN] = study, answers, {"recruiting": True}
    app.add_routes(
        [
            web.get("/", _page),
            web.get("/p/{token}", _page),
            web.get("/part/{name}", _part),
            web.post("/begin", _begin),
            web.get("/p/{token}/now", _now),
            web.post("/p/{token}/answer", _answer),
            web.post("/p/{token}/withdraw", _withdraw),
        ]
    )
    return app


@web.middleware
async def _guard(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Only the page itself may send; no answer may be kept by a browser or a proxy."""
    origin = request.headers.get("Origin")
    if request.method == "POST" and origin is not None and origin.partition("://")[2] != request.headers.get("Host"):
        _log.warning("refused: a request of another site")
        raise web.HTTPForbidden(text="only the page of this study may answer\n")
    response = await handler(request)
    response.headers.update(SECURITY)
    return response


async def _page(request: web.Request) -> web.Response:
    body = files(__package__).joinpath("page.html").read_bytes()
    return web.Response(body=body, content_type="text/html", charset="utf-8")


async def _part(request: web.Request) -> web.Response:
    name = request.match_info["name"]
    if name not in PARTS:
        raise web.HTTPNotFound
    body = files(__package__).joinpath(name).read_bytes()
    return web.Response(body=body, content_type=PARTS[name], charset="utf-8")


async def _begin(request: web.Request) -> web.Response:
    """Let somebody in; a link that is only opened, by a preview or a scanner, lets nobody in."""
    study, answers = request.app[STUDY], request.app[ANSWERS]
    parameters = _parameters(await request.read())
    pilot = parameters.pop("pilot", "") == "1"
    try:
        name = study.settings.recruiter
        external, fields = recruit_of(name, parameters)
        known = answers.of_recruit(name, external)
        if known is None and not (pilot or request.app[OPEN]["recruiting"]):
            raise FullError
        person = known or enter(study, answers, pilot, name, external, fields)
    except UnknownRecruitError as error:
        return _refused(400, str(error))
    except FullError:
        return _refused(409, "this study has all the people it needs")
    return web.json_response({"address": f"/p/{person.token}"})


async def _now(request: web.Request) -> web.Response:
    person = _person(request)
    return web.json_response(shown_now(request.app[STUDY], request.app[ANSWERS], person))


async def _answer(request: web.Request) -> web.Response:
    """Keep an answer; the reply tells what became of it, what really happened, and what comes next."""
    study, answers, person = request.app[STUDY], request.app[ANSWERS], _person(request)
    try:
        answer = parse(await request.read())
        became = take(study, answers, person, answer)
    except BadAnswerError as error:
        _log.warning("refused: %s", error)
        return _refused(409, str(error), now=shown_now(study, answers, person))
    page = next(one for one in schedule_of(study, person) if one.name == answer.page)
    reply = {"became": became, "feedback": feedback_on(study, page)}
    return web.json_response({**reply, "now": shown_now(study, answers, _person(request))})


async def _withdraw(request: web.Request) -> web.Response:
    request.app[ANSWERS].withdraw(_person(request))
    return web.json_response({"ended": "withdrawn", "code": "", "address": ""})


def _person(request: web.Request) -> Person:
    person = request.app[ANSWERS].person(request.match_info["token"])
    if person is None:
        raise web.HTTPNotFound(text="nobody takes part under this address\n")
    return person


def _parameters(body: bytes) -> dict[str, str]:
    try:
        given = json.loads(body)
    except ValueError:
        return {}
    known = {one for recruiter in KNOWN.values() for one in (recruiter.id, *recruiter.fields)} | {"pilot"}
    if not isinstance(given, Mapping):
        return {}
    return {name: value for name, value in given.items() if name in known and isinstance(value, str)}


def _refused(status: int, why: str, **more: Any) -> web.Response:
    return web.json_response({"refused": why, **more}, status=status)
