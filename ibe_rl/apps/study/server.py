"""The web server of a study: loopback unless told otherwise; what it confirms is on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from aiohttp import web

from ibe_rl.apps.study.answers import WITHDRAWN, Answers, Person
from ibe_rl.apps.study.content import about, feedback_on, shown_now
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.guarding import ANSWERS, LOOPBACK, STUDY, begin_log, guard, host_name, page_part, refused
from ibe_rl.apps.study.joint_writer import JointWriter
from ibe_rl.apps.study.messages import MAX_ANSWER_BYTES, BadAnswerError, parse_answer
from ibe_rl.apps.study.recruiters import KNOWN, UnknownRecruitError, is_known_code, recruit_of
from ibe_rl.apps.study.settings import CODES
from ibe_rl.apps.study.sitting import FullError, enter, schedule_of

PAGE_PARTS = {
    "page.js": "text/javascript",
    "trial.js": "text/javascript",
    "draw.js": "text/javascript",
    "page.css": "text/css",
}
WRITER = web.AppKey("writer", JointWriter)


def study_app(study: Study, answers: Answers) -> web.Application:
    """The pages of a study, and what they ask."""
    begin_log()
    app = web.Application(middlewares=[guard], client_max_size=MAX_ANSWER_BYTES)
    app[STUDY], app[ANSWERS], app[WRITER] = study, answers, JointWriter(study, answers)
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
    study, answers = request.app[STUDY], request.app[ANSWERS]
    body = await request.read()
    person = _person(request)  # who withdrew while the answer came in is not there any more
    try:
        answer = parse_answer(body)
        became = await request.app[WRITER].take(person, answer)
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
