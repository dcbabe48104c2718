"""The system's Chromium, driven by Playwright."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator

    from playwright.sync_api import Browser, Locator, Page

OPTIONS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE_MS = 60_000
AXE = Path(__file__).parents[2] / "viewer" / "node_modules" / "axe-core" / "axe.min.js"
MISSING = "there is no Chromium: apt-get install chromium"


@contextmanager
def chromium() -> Generator[Browser]:
    """A browser without a window; tests fail without one in CI, and are skipped elsewhere."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(OPTIONS))
        yield browser
        browser.close()


def expect(of: Page | Locator) -> Any:
    """What waits until something is so; patient, as machines may be busy."""
    from playwright.sync_api import expect

    expect.set_options(timeout=PATIENCE_MS)
    return expect(of)


def settle(page: Page) -> None:
    """Wait until the page awaits no answer, has drawn, and its address says what it shows.

    After a click on a link, wait for what the link leads to first: browsers follow it later.
    """
    expect(page.locator("main").first).to_be_attached()
    expect(page.locator("[aria-busy=true], [data-address]")).to_have_count(0)
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def axe_finds(page: Page) -> list[Any]:
    """What axe finds wrong with a page: rules, and the elements that break them."""
    if not AXE.exists():
        (pytest.fail if os.environ.get("CI") else pytest.skip)("axe-core is missing: make viewer")
    if not page.evaluate("'axe' in window"):
        page.add_script_tag(path=AXE)
    # All that it approves of is megabytes, which would be sent here.
    wrong = page.evaluate("axe.run({resultTypes: ['violations']}).then(all => all.violations)")
    return [(one["id"], [node["html"] for node in one["nodes"]]) for one in wrong]


@contextmanager
def opened(browser: Browser, path: Path, link: str = "", **settings: object) -> Generator[Page]:
    """A page from disk; fails if it complains, or asks for anything but itself."""
    context = browser.new_context(**settings)
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    complaints: list[str] = []
    asked: set[str] = set()
    page.on("console", lambda said: complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.add(request.url.partition("#")[0]))
    page.goto(path.as_uri() + link)
    page.wait_for_selector(".board")
    settle(page)
    yield page
    context.close()
    assert complaints == []
    assert {url for url in asked if not url.startswith("data:")} == {path.as_uri()}
