"""The page that a server sent, in a browser; and answers that come late."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tests.support.browser import PATIENCE_MS, expect, settle

if TYPE_CHECKING:
    import re
    from collections.abc import Callable, Generator

    from playwright.sync_api import Browser, Page, Route

ROWS = ".simulations tbody tr"


def enter(browser: Browser, url: str, found: str) -> Any:
    """The cookie of the browser that has opened the printed address, once all is read."""
    context = browser.new_context()
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(url)
    expect(page.locator(".found")).to_have_text(found)
    assert "token" not in page.url
    state = context.storage_state()
    context.close()
    return state


@contextmanager
def at(browser: Browser, url: str, key: Any, link: str = "", **settings: object) -> Generator[Page]:
    """The page at a link; fails if it complains, or asks for anything beyond its server."""
    context = browser.new_context(storage_state=key, **settings)
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    complaints: list[str] = []
    asked: set[str] = set()
    page.on("console", lambda said: complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.add(request.url))
    base = url.partition("#")[0]
    page.goto(base + link)
    page.wait_for_selector(".board" if "sim=" in link else ROWS)
    settle(page)
    yield page
    context.close()
    assert complaints == []
    assert all(one.startswith((base, "data:")) for one in asked)


class Held:
    """Requests that are held back until they are let go, in any order.

    Args:
        page: Whose requests.
        path: A pattern of their addresses.
    """

    def __init__(self, page: Page, path: str | re.Pattern[str]) -> None:
        """Hold back from now on."""
        self._page, self._path = page, path
        self._routes: list[Route] = []
        self._has_ended = False
        page.route(path, self._hold)

    def _hold(self, route: Route) -> None:
        """Keep a request, or let it pass after the end."""
        if self._has_ended:
            route.continue_()
        else:
            self._routes.append(route)

    def wait(self, count: int) -> None:
        """Wait until so many have come."""
        for _ in range(PATIENCE_MS // 20):
            if len(self._routes) >= count:
                return
            self._page.wait_for_timeout(20)
        shown = self._page.evaluate("[location.href, document.title, document.body.innerText]")
        raise TimeoutError(f"{len(self._routes)} of {count} requests of {self._path}: {shown}")

    def let_go(self, place: int = 0) -> None:
        """Let one be answered, and wait until the page has the answer."""
        route = self._routes.pop(place)
        with self._page.expect_event("requestfinished", lambda request: request == route.request):
            route.continue_()

    def change(self, place: int, of: Callable[[Any], Any]) -> None:
        """Answer one with something else than the server tells."""
        route = self._routes.pop(place)
        answer = route.fetch()
        route.fulfill(response=answer, json=of(answer.json()))

    def end(self) -> None:
        """Let all requests pass, those that are held and later ones."""
        # First: a request that arrives while `unroute` waits for the browser would stay held.
        self._has_ended = True
        while self._routes:
            self._routes.pop(0).continue_()
        self._page.unroute(self._path)
