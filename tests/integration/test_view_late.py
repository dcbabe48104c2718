"""The page of a server where answers come late, or people are quick. Needs Chromium."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from tests.integration.test_view_browser import shows
from tests.support.browser import expect, settle
from tests.support.serving import serving
from tests.support.viewing import ROWS, Held, at, enter

import overtaking as ot

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page, Route

pytestmark = pytest.mark.ci

ALL = "120 of 120 simulations"


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("late") / "data"
    with serving(
        ot.generate_dataset(
            "pinto2023-physical", num_simulations=120, seed=1, out=folder, keep="features"
        )
    ) as found:
        yield found


@pytest.fixture(scope="module")
def key(browser: Browser, url: str) -> Any:
    return enter(browser, url, ALL)


def test_who_turns_back_stays_there(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3") as page:
        held = Held(page, re.compile(r"/runs/4$"))
        page.keyboard.press("j")
        held.wait(1)
        page.keyboard.press("k")
        expect(page.locator(".runs [aria-current]")).to_have_attribute("data-sim", "3")
        held.let_go()
        settle(page)
        shows(page, 3)
        assert page.evaluate("location.hash") == "#sim=3&t=0"


def test_the_next_simulation_is_shown_after_the_list_has_failed(
    browser: Browser, url: str, key: Any
):
    context = browser.new_context(storage_state=key)
    page = context.new_page()
    failure = {"status": 500, "json": {"error": "not now"}}
    failures = [failure, failure]  # At the start, and when simulation 3 has come.
    page.route(
        "**/rows",
        lambda route: route.fulfill(**failures.pop()) if failures else route.continue_(),
    )
    page.goto(url.partition("#")[0] + "#sim=3")
    page.wait_for_selector(".board")
    settle(page)
    page.keyboard.press("j")
    shows(page, 4)
    assert failures == []
    context.close()


def test_the_last_of_two_that_are_put_beside_is_shown(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        held = Held(page, re.compile(r"/runs/\d+$"))
        for number in ("8", "9"):
            page.fill("#beside", number)
            page.press("#beside", "Enter")
        held.wait(2)
        held.let_go(1)
        held.let_go(0)
        settle(page)
        expect(page.locator("#road-beside")).to_be_visible()
        assert "simulation 9. " in str(page.get_attribute("#road-beside", "aria-label"))


def test_what_was_left_early_is_whole_when_it_comes_back(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        held = Held(page, "**/beliefs")
        page.locator(f"{ROWS} a").nth(3).click()
        shows(page, 3)
        held.wait(1)
        page.keyboard.press("a")
        expect(page.locator(ROWS).first).to_be_visible()
        held.let_go()
        page.locator(f"{ROWS} a").nth(3).click()
        shows(page, 3)
        expect(page.locator(".key.belief")).to_have_count(1)


def test_choices_go_on_from_each_other(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#class=Success_I&light=night") as page:
        held = Held(page, "**/rows")
        page.click("#clear")
        page.check("#classes-No_attempt")
        page.select_option("#order", "duration")
        held.wait(3)
        assert not page.is_checked("#classes-Success_I")
        assert not page.is_checked("#light-night")
        for place in (2, 1, 0):
            held.let_go(place)
        settle(page)
        assert page.evaluate("location.hash") == "#class=No_attempt&sort=duration"
        many = page.inner_text("label[for=classes-No_attempt] .many")
        expect(page.locator(".found")).to_have_text(f"{many} of {ALL.partition(' of ')[2]}")


def test_parts_of_the_list_are_turned_faster_than_they_come(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        held = Held(page, "**/rows")
        for _ in range(2):
            page.get_by_role("button", name="next").click()
        held.wait(2)
        held.end()
        expect(page.locator(f"{ROWS} a").first).to_have_text("100")


def test_keys_go_on_over_the_end_of_a_part(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=48") as page:
        held = Held(page, "**/rows")
        for _ in range(3):
            page.keyboard.press("j")
        held.wait(1)
        held.end()
        shows(page, 51)
        settle(page)
        expect(page.locator(".runs [aria-current]")).to_have_attribute("data-sim", "51")


def test_a_key_waits_for_the_part_of_its_simulation(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        held = Held(page, "**/rows")
        page.goto("about:blank")
        page.goto(url.partition("#")[0] + "#sim=77")
        shows(page, 77)
        page.keyboard.press("j")
        held.end()
        shows(page, 78)


def test_the_list_has_the_simulation_that_came_before_it(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        held = Held(page, "**/rows")
        page.goto("about:blank")
        page.goto(url.partition("#")[0] + "#sim=77")
        shows(page, 77)
        held.end()
        settle(page)
        page.keyboard.press("j")
        shows(page, 78)


def test_links_keep_what_was_chosen_since(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        page.select_option("select[aria-label=Camera]", "all")
        page.uncheck("#ghosts")
        page.locator(".runs a").nth(5).click()
        shows(page, 5)
        settle(page)
        assert page.evaluate("location.hash") == "#sim=5&t=0&cam=all&ghosts=0"
        page.click("#play")
        expect(page.locator("#frame")).to_have_value(re.compile(r"^([5-9]|\d\d+)$"))
        # The address is that of its beginning, and so is the link.
        page.evaluate("history.replaceState(null, '', '#sim=5&t=0&cam=all&ghosts=0')")
        page.locator(".runs a").nth(5).click()
        expect(page.locator("#frame")).to_have_value("0")


def test_what_is_typed_is_not_taken_away(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        for pressed in ("End", *["ArrowLeft"] * 5, ",", ",", ",", " "):
            page.keyboard.press(pressed)
        page.focus("#beside")
        page.keyboard.type("8")
        expect(page.locator("#play")).to_have_attribute("aria-label", "Play")  # At the end.
        assert page.input_value("#beside") == "8"
        page.keyboard.press("Enter")
        expect(page.locator("#road-beside")).to_be_visible()


def test_nothing_goes_from_under_the_hand(browser: Browser, url: str, key: Any):
    """While a large data set is read, the list is asked for again and again."""
    with at(browser, url, key) as page:
        held = Held(page, "**/rows")

        def reading(answer: Any) -> Any:
            return answer | {"read": 100, "found": answer["found"] - 20}

        page.check("#light-night")
        held.wait(1)
        held.change(0, reading)
        expect(page.locator(".found")).to_contain_text("read so far")
        link = page.locator(f"{ROWS} a").nth(1)
        number = str(link.get_attribute("data-sim"))
        link.hover()
        page.mouse.down()
        held.wait(1)
        held.let_go()
        expect(page.locator(".found")).not_to_contain_text("read so far")
        page.mouse.up()
        shows(page, number)


def test_the_cursor_is_held_while_more_arrives(browser: Browser, url: str, key: Any):
    high = {"width": 1280, "height": 2000}
    with at(browser, url, key, "#sim=3&t=1", viewport=high) as page:
        held = Held(page, "**/branches")
        page.click("#what-if [data-what=STAY]")
        held.wait(1)
        box = page.locator(".board .field").bounding_box()
        assert box
        middle = box["y"] + box["height"] / 2
        page.mouse.move(box["x"] + 10, middle)
        page.mouse.down()
        held.let_go()
        expect(page.locator("article.branch")).to_have_count(1)
        before = page.input_value("#frame")
        page.mouse.move(box["x"] + box["width"] / 2, middle, steps=4)
        expect(page.locator("#frame")).not_to_have_value(before)
        page.mouse.up()


def test_words_keep_the_focus_while_more_arrives(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        held = Held(page, "**/branches")
        page.click("#what-if [data-what=STAY]")
        page.locator("#events button").first.focus()
        held.wait(1)
        held.let_go()
        expect(page.locator("article.branch")).to_have_count(1)
        assert page.evaluate("document.activeElement.closest('#events') !== null")


def test_as_many_courses_as_a_link_names_come(browser: Browser, url: str, key: Any):
    link = "#sim=3&t=1&if=STAY@1,PULL_OUT@1,ClearNoon@1,ClearNight@1&fan=truth"
    with at(browser, url, key, link) as page:
        # A second time, while the first is still computed.
        page.goto("about:blank")
        page.goto(url.partition("#")[0] + link.replace("@1", "@2"))
        page.reload()
        settle(page)
        expect(page.locator("article.branch")).to_have_count(4)
        expect(page.locator(".fan-about")).to_have_count(1)


def test_an_answer_in_sql_is_to_what_was_asked_last(browser: Browser, url: str, key: Any):
    def ask(page: Page, most: int) -> None:
        page.fill("#sql", f"SELECT simulation FROM simulations WHERE simulation < {most}")
        page.click("#ask")

    with at(browser, url, key) as page:
        page.click(".sql summary")
        held = Held(page, "**/sql")
        ask(page, 7)
        ask(page, 5)
        page.fill("#sql", "SELECT")
        held.wait(2)
        held.let_go(1)
        held.let_go(0)
        expect(page.locator(".found")).to_have_text("5 of 120 simulations")
        settle(page)
        assert page.input_value("#sql") == "SELECT"


def test_a_request_that_a_busy_server_refuses_is_sent_again(browser: Browser, url: str, key: Any):
    statuses = [429, 429]

    def refuse(route: Route) -> None:
        if statuses:
            status = statuses.pop()
            route.fulfill(status=status, headers={"Retry-After": "0"}, json={"error": "busy"})
        else:
            route.continue_()

    # Not `at`: Chromium itself writes each refusal to the console.
    with browser.new_context(storage_state=key) as context:
        page = context.new_page()
        page.route(re.compile(r"/api/rows$"), refuse)
        page.goto(url.partition("#")[0])
        expect(page.locator(".found")).to_have_text(ALL)
        assert not statuses
