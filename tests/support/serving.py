"""A server of `overtaking view` in this process, and a client that is no browser."""

from __future__ import annotations

import http.client
import json
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from overtaking.show.server.running import ViewServer

if TYPE_CHECKING:
    from collections.abc import Generator

    from overtaking.data.load import Dataset

_PATIENCE_S = 60.0


class Client:
    """Speaks to a server as the page does, unless it is told otherwise."""

    def __init__(self, url: str) -> None:
        self.host, self.token = url.split("/")[2], url.partition("#token=")[2]
        self.cookie = ""

    def enter(self) -> Client:
        """Exchange the token for the cookie."""
        status, _, headers = self.ask("POST", "/api/session", {"token": self.token})
        assert status == 200
        self.cookie = str(headers["set-cookie"]).partition(";")[0]
        return self

    def ask(
        self, method: str, path: str, body: object = None, **headers: str | None
    ) -> tuple[int, Any, http.client.HTTPMessage]:
        """Status, JSON or bytes, and headers of an answer; a header that is None is not sent."""
        sent: dict[str, str | None] = {"Host": self.host, "Cookie": self.cookie or None}
        if method == "POST":
            sent |= {"Origin": f"http://{self.host}", "Content-Type": "application/json"}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        content = body if isinstance(body, bytes) else json.dumps(body).encode()
        line = http.client.HTTPConnection(self.host, timeout=_PATIENCE_S)
        line.putrequest(method, path, skip_host=True)
        for name, value in sent.items():
            if value is not None:
                line.putheader(name, value)
        if method == "POST":
            line.putheader("Content-Length", str(len(content)))
        line.endheaders(content if method == "POST" else None)
        answer = line.getresponse()
        told = answer.read()
        line.close()
        is_json = (answer.getheader("content-type") or "").startswith("application/json")
        return answer.status, json.loads(told) if is_json else told, answer.headers

    def rows(self, **asked: object) -> dict[str, Any]:
        """A part of the list, once the whole data set is read."""
        end = time.monotonic() + _PATIENCE_S
        while time.monotonic() < end:
            status, told, _ = self.ask("POST", "/api/rows", asked)
            assert status == 200, told
            if told["read"] == told["total"]:
                return told
            time.sleep(0.02)
        raise TimeoutError


@contextmanager
def serving(data: Dataset, policy: str = "paper") -> Generator[str]:
    """The address of a server that ends with the context."""
    with ViewServer(data, policy, 0) as server:
        yield server.url


def get(client: Client, path: str) -> Any:
    status, told, _ = client.ask("GET", path)
    assert status == 200, told
    return told


def branches(*changes: dict[str, Any]) -> dict[str, Any]:
    """What the page sends for a branch."""
    return {"changes": changes}
