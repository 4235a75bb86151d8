"""What the pages of people and the admin page have in common: who may send what, and how a refusal reads."""

from __future__ import annotations

import logging
import traceback
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler

from ibe_rl.apps.study.answers import Answers
from ibe_rl.apps.study.folder import Study

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
STUDY, ANSWERS = web.AppKey("study", Study), web.AppKey("answers", Answers)
LOOPBACK = ("127.0.0.1", "localhost", "::1")
_log = logging.getLogger("ibe_rl.study")


def begin_log() -> None:
    """Let the log speak: where hydra ran before in the same process, it has disabled every logger that it found."""
    _log.disabled = False


@web.middleware
async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse what other sites send; answer every request with JSON or a page, and log nothing about the person."""
    try:
        response = await handler(request) if _is_own(request) else refused(403, "only the page of this study may send")
    except web.HTTPException as error:
        response = refused(error.status, error.reason)
    except Exception as error:  # a message may hold what somebody wrote, so it is not logged
        frame = traceback.extract_tb(error.__traceback__)[-1]
        _log.error("failed: %s in %s, line %d", type(error).__name__, Path(frame.filename).name, frame.lineno or 0)
        response = refused(500, "this failed; it is tried again")
    response.headers.update(SECURITY_HEADERS)
    return response


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
