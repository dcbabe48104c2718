"""The pages and answers of the server, each by its path."""

from __future__ import annotations

import asyncio
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from overtaking.core.errors import NoSuchSimulationError, OvertakingError
from overtaking.show.server.guard import SESSION, Guard, Keys
from overtaking.show.server.library import FAULT
from overtaking.show.server.wanted import Branch, Futures, Query, Rows, Token, asked
from overtaking.show.view.page import shell

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request as AnyRequest

    from overtaking.show.server.library import Library

    Request = AnyRequest[Any]

MOST_BYTES = 16_384
"""Of the body of a request."""

MOST_BRANCHES = 4
"""Branches and fans that are computed at a time."""

MOST_WAITING = 16
"""Branches and fans that are computed or wait for their turn; further ones are refused."""

_DIGITS = re.compile(r"[0-9]{1,15}", re.ASCII)
_USED = "this address has been used: go on in the browser that used it, or start the command again"
_BUSY = "too much is asked for at once: wait for an answer"


def app(library: Library, hosts: tuple[str, ...], keys: Keys) -> Starlette:
    """The application.

    Args:
        library: What it tells of.
        hosts: The addresses that are listened on, with the port.
        keys: Who is let in.
    """
    answers = _Answers(library, keys)
    get, post = ["GET"], ["POST"]
    routes = [
        Route("/", _page, methods=get),
        Route("/viewer.js", _built("viewer.js", "text/javascript"), methods=get),
        Route("/viewer.css", _built("viewer.css", "text/css"), methods=get),
        Route(SESSION, answers.session, methods=post),
        Route("/api/start", answers.start, methods=get),
        Route("/api/rows", answers.rows, methods=post),
        Route("/api/sql", answers.sql, methods=post),
        Route("/api/runs/{number}", answers.run, methods=get),
        Route("/api/runs/{number}/beliefs", answers.beliefs, methods=get),
        Route("/api/runs/{number}/thumbnail", answers.thumbnail, methods=get),
        Route("/api/runs/{number}/branches", answers.branch, methods=post),
        Route("/api/runs/{number}/fan", answers.fan, methods=post),
    ]
    return Starlette(
        routes=routes,
        middleware=[Middleware(Guard, hosts=hosts, keys=keys)],
        exception_handlers={
            HTTPException: _refused,
            OvertakingError: _wrong,
            Exception: _failed,
        },
    )


class _Answers:
    """The answer of each path, computed in threads."""

    def __init__(self, library: Library, keys: Keys) -> None:
        self._library, self._keys = library, keys
        self._waiting, self._branches = 0, asyncio.Semaphore(MOST_BRANCHES)

    async def session(self, request: Request) -> Response:
        key = self._keys.exchange(asked(Token, await _body(request)).token)
        if key is None:
            raise HTTPException(401, _USED)
        answer = JSONResponse({})
        answer.set_cookie(self._keys.cookie, key, httponly=True, samesite="strict")
        return answer

    async def start(self, _: Request) -> Response:
        return JSONResponse(self._library.start())

    async def rows(self, request: Request) -> Response:
        return await _told(self._library.rows, asked(Rows, await _body(request)))

    async def sql(self, request: Request) -> Response:
        return await _told(self._library.sql, asked(Query, await _body(request)).sql)

    async def run(self, request: Request) -> Response:
        return await _told(self._library.run, _number(request))

    async def beliefs(self, request: Request) -> Response:
        return await _told(self._library.beliefs, _number(request))

    async def thumbnail(self, request: Request) -> Response:
        return await _told(self._library.thumbnail, _number(request))

    async def branch(self, request: Request) -> Response:
        number, what = _number(request), asked(Branch, await _body(request))
        return await self._in_turn(self._library.branch, number, what)

    async def fan(self, request: Request) -> Response:
        number, what = _number(request), asked(Futures, await _body(request))
        return await self._in_turn(self._library.fan, number, what)

    async def _in_turn(self, function: Callable[..., dict[str, Any]], *what: Any) -> Response:
        """What takes long, a few at a time; refused while many wait."""
        if self._waiting >= MOST_WAITING:
            raise HTTPException(429, _BUSY)
        self._waiting += 1
        try:
            async with self._branches:
                return await _told(function, *what)
        finally:
            self._waiting -= 1


async def _told(function: Callable[..., dict[str, Any]], *arguments: Any) -> Response:
    return JSONResponse(await run_in_threadpool(function, *arguments))


async def _body(request: Request) -> bytes:
    """The body of a request, if it is small."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MOST_BYTES:
            raise HTTPException(413, f"a request has {MOST_BYTES} bytes at most")
    return body


def _number(request: Request) -> int:
    """The number of a simulation in a path."""
    text = request.path_params["number"]
    if not _DIGITS.fullmatch(text):
        raise HTTPException(404, "no such simulation")
    return int(text)


async def _page(_: Request) -> Response:
    return HTMLResponse(shell())


def _built(name: str, kind: str) -> Callable[[Request], Response]:
    content = files("overtaking.show.view").joinpath(name).read_bytes()
    return lambda _: Response(content, media_type=kind)


async def _refused(_: Request, error: Exception) -> Response:
    is_known = isinstance(error, HTTPException)
    status, detail = (error.status_code, error.detail) if is_known else (500, FAULT)
    return JSONResponse({"error": detail}, status)


async def _wrong(_: Request, error: Exception) -> Response:
    return JSONResponse(
        {"error": str(error)}, 404 if isinstance(error, NoSuchSimulationError) else 400
    )


async def _failed(_: Request, __: Exception) -> Response:
    return JSONResponse({"error": FAULT}, 500)
