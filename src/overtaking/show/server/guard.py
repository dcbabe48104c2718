"""Refuses requests that do not come from this page, in the browser that has the token.

Any page that a browser shows may send requests to this machine. So `Host` must be the address that
is listened on (against DNS rebinding), requests that carry something must come from the page itself
(`Origin`, `Sec-Fetch-Site`), and all that tells of the data needs a cookie, which the page is given
once for the token of its address.
"""

from __future__ import annotations

import hmac
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

API = "/api/"
SESSION = "/api/session"
"""Where the token becomes a cookie; the one place of the interface that needs none."""

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""What every answer says."""


class Keys:
    """The token of the address, which opens once, and the key of the browser that used it.

    Args:
        port: The port that is listened on; browsers send cookies to every port of a machine.
    """

    def __init__(self, port: int) -> None:
        """Draw both."""
        self.cookie = f"overtaking-{port}"
        self.token, self._key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        self._is_spent = False

    def exchange(self, token: str) -> str | None:
        """The key, for the token and once; None for anything else."""
        if self._is_spent or not _is_same(token, self.token):
            return None
        self._is_spent = True
        return self._key

    def fits(self, cookies: str) -> bool:
        """Whether a `Cookie` header holds the key."""
        try:
            found = SimpleCookie(cookies).get(self.cookie)
        except CookieError:
            return False
        return found is not None and _is_same(found.value, self._key)


class Guard:
    """Refuses requests before anything else sees them, and says the same of every answer.

    Args:
        app: What answers.
        hosts: The addresses that are listened on, with the port.
        keys: Who has been let in.
    """

    def __init__(self, app: ASGIApp, hosts: tuple[str, ...], keys: Keys) -> None:
        """Take what is checked."""
        self._app, self._hosts, self._keys = app, hosts, keys

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            return

        async def told(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        refusal = self._refusal(scope)
        await (refusal or self._app)(scope, receive, told)

    def _refusal(self, scope: Scope) -> JSONResponse | None:
        """The answer to a request that is refused."""
        headers, is_api = Headers(scope=scope), scope["path"].startswith(API)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _no(421, "this address is not served")
        changes = scope["method"] not in ("GET", "HEAD")
        if changes and headers.get("origin") != f"http://{hosts[0]}":
            return _no(403, "only the page itself may ask")
        if changes and headers.get("content-type") != "application/json":
            return _no(415, "only JSON is read")
        if is_api and headers.get("sec-fetch-site", "same-origin") != "same-origin":
            return _no(403, "only the page itself may ask")
        if is_api and scope["path"] != SESSION and not self._keys.fits(headers.get("cookie", "")):
            return _no(401, "open the address that overtaking view has printed")
        return None


def _is_same(given: str, known: str) -> bool:
    return hmac.compare_digest(given.encode(), known.encode())


def _no(status: int, why: str) -> JSONResponse:
    return JSONResponse({"error": why}, status)
