"""Serves a study until it is told to end: its pages on one port, the admin page on another."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from aiohttp import web

from ibe_rl.apps.study.admin import admin_app
from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.folder import Study, hold_protocol, open_study
from ibe_rl.apps.study.recruiters import write_codes
from ibe_rl.apps.study.server import study_app
from ibe_rl.apps.study.settings import CODES
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.runtime.ports import HOST, asked_port, free_port
from ibe_rl.types import ConfigError

STUDY_PORT, ADMIN_PORT = 8471, 8472
SHUTDOWN_S, KEEP_S = 2.0, 30.0


def serve(
    folder: Path,
    host: str = HOST,
    port: int | None = STUDY_PORT,
    admin_port: int | None = ADMIN_PORT,
    codes: int = 0,
    say: Callable[[str], None] | None = None,
) -> None:
    """Serve a study until SIGTERM or Ctrl-C; every answer that was confirmed is on disk.

    Args:
        folder: of the study.
        host: to bind for the pages; the admin page is bound to this machine alone.
        port: of the pages; None for one that is free.
        admin_port: of the admin page; None for one that is free.
        codes: one-time codes to write for a laboratory, unless there are some; 0 for none.
        say: prints a line.

    Raises:
        ConfigError: if the study cannot be served, or a port is taken.
    """
    study = open_study(folder)
    if codes and study.settings.recruiter != CODES:
        raise ConfigError(f"codes={codes}: allowed with recruiter={study.settings.recruiter} is 0")
    port = asked_port("port", port, host=host) or free_port(STUDY_PORT, host=host)
    admin_port = asked_port("admin_port", admin_port, other=port) or free_port(ADMIN_PORT, other=port)
    tell = say or _print
    answers = Answers(folder / FILE)
    try:
        hold_protocol(study, answers)
        if codes:
            tell(f"one-time codes: {write_codes(folder, codes)}")
        with suppress(KeyboardInterrupt):
            asyncio.run(_serve(study, answers, (host, port), admin_port, tell))
    finally:
        answers.close()


async def _serve(
    study: Study, answers: Answers, address: tuple[str, int], admin_port: int, say: Callable[[str], None]
) -> None:
    logging.getLogger("aiohttp").setLevel(logging.CRITICAL + 1)  # it logs addresses; ours logs what was refused
    ended, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, ended.set)
    runners = [
        await _started(study_app(study, answers), *address),
        await _started(admin_app(study, answers), HOST, admin_port),
    ]
    name = f"[{address[0]}]" if ":" in address[0] else address[0]
    say(f"admin page: http://{HOST}:{admin_port}/")
    say(f"people take part here: http://{name}:{address[1]}/")
    await ended.wait()
    for runner in runners:
        await runner.cleanup()


async def _started(app: web.Application, host: str, port: int) -> web.AppRunner:
    runner = web.AppRunner(app, access_log=None, keepalive_timeout=KEEP_S, shutdown_timeout=SHUTDOWN_S)
    await runner.setup()
    await web.TCPSite(runner, host, port).start()
    return runner


def _print(text: str) -> None:
    PlainConsole().print(text, soft_wrap=True)
