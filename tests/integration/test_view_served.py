"""The page of `overtaking view DATA`, from a server, in a browser. Needs Chromium."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from tests.integration.test_view_browser import FRAME, PHONE, says, shows
from tests.support.browser import PATIENCE_MS, axe_finds, expect, settle
from tests.support.serving import Client, serving
from tests.support.viewing import ROWS, at, enter

import overtaking as ot
from overtaking.cli import main
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page

    from overtaking.data.load import Dataset

pytestmark = pytest.mark.ci

EVERYTHING = "#sim=3&t=3&against=strict&if=STAY@1,STAY@1~PULL_OUT@3&vs=8&fan=truth"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """More than one part of the list, without frames."""
    folder = tmp_path_factory.mktemp("served") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=120, seed=1, out=folder, keep="features"
    )


@pytest.fixture(scope="module")
def url(data: Dataset) -> Iterator[str]:
    with serving(data) as found:
        yield found


@pytest.fixture(scope="module")
def key(browser: Browser, url: str) -> Any:
    """The cookie of the browser that has opened the printed address."""
    return enter(browser, url, "120 of 120 simulations")


def state(page: Page) -> dict[str, Any]:
    """What the page shows, once its address says so."""
    settle(page)
    return {
        "title": page.title(),
        "link": page.evaluate("location.hash"),
        "frame": page.evaluate(FRAME),
        "now": page.inner_text("#now"),
        "list": page.locator(".runs a").evaluate_all("all => all.map(one => one.dataset.sim)"),
        "branches": page.locator("article.branch").all_inner_texts(),
        "beside": page.input_value("#beside"),
    }


def test_from_the_list_to_an_article_and_back_by_link(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        expect(page.locator(".found")).to_have_text("120 of 120 simulations")
        # All at once: before the server has answered to the first.
        page.evaluate(
            "document.querySelectorAll('#classes-Success_I, #light-night, #rules-L3')"
            ".forEach(box => box.click())"
        )
        settle(page)
        assert page.evaluate("location.hash") == "#class=Success_I&rule=L3&light=night"
        count = page.locator("label[for=rules-L3] .many").inner_text()
        expect(page.locator(".found")).to_have_text(f"{count} of 120 simulations")
        assert page.locator(ROWS).count() == int(count)
        assert all("L3" in text for text in page.locator(f"{ROWS} .codes").all_inner_texts())
        expect(page.locator(f"{ROWS} .thumb svg").first).to_be_visible()
        row = page.locator(f"{ROWS} a").nth(1)
        number = str(row.get_attribute("data-sim"))
        row.click()
        shows(page, number)
        settle(page)
        assert page.locator(".runs a").count() == int(count)
        page.click("#play")
        expect(page.locator("#frame")).to_have_value(re.compile(r"^([5-9]|\d\d+)$"))
        page.click("#play")
        page.get_by_label("One frame on").click()
        rule = page.locator("button.law").first
        rule.click()
        assert "Article" in page.inner_text("#rule")
        before = state(page)
        page.reload()
        page.wait_for_selector(".board")
        assert state(page) == before
        page.click("#all")
        expect(page.locator(".found")).to_have_text(f"{count} of 120 simulations")
        expect(page.locator(ROWS).first).to_be_visible()
        assert page.is_checked("#classes-Success_I")
        page.click("#clear")
        expect(page.locator(".found")).to_have_text("120 of 120 simulations")


def test_the_list_has_parts_orders_and_margins(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        assert page.locator(ROWS).count() == 50
        page.click(".pages button:last-child")
        expect(page.locator(f"{ROWS} a").first).to_have_text("50")
        page.select_option("#margin-rule", "L3")
        settle(page)
        page.get_by_label("Largest margin").fill("-5")
        page.get_by_label("Largest margin").press("Enter")
        settle(page)
        page.select_option("#order", "margin")
        settle(page)
        expect(page.locator(".found")).not_to_have_text("120 of 120 simulations")
        first, second = (
            str(page.locator(f"{ROWS} a").nth(k).get_attribute("data-sim")) for k in range(2)
        )
        page.locator(f"{ROWS} a").first.click()
        shows(page, first)
        settle(page)
        least = margin(page, "L3")
        page.keyboard.press("j")
        shows(page, second)
        assert least <= margin(page, "L3") <= -5


def margin(page: Page, rule: str) -> float:
    """The margin that the page tells of a broken rule."""
    return float(page.inner_text(f"article[data-rule={rule}]").split("margin ")[1].split()[0])


def test_sql_filters_the_list(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        page.click(".sql summary")
        page.fill(
            "#sql", "SELECT simulation FROM labels WHERE policy = 'strict' AND detail = 'spun'"
        )
        page.click("#ask")
        expect(page.locator(".answer")).to_contain_text("which filter the list")
        found = int(page.locator(".answer p").inner_text().split()[0])
        expect(page.locator(".found")).to_have_text(f"{found} of 120 simulations")
        settle(page)
        page.reload()
        expect(page.locator(".found")).to_have_text(f"{found} of 120 simulations")


def test_beliefs_are_there_at_every_moment(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        expect(page.locator(".key.belief")).to_contain_text(re.compile(r"1 believed \d"))
        picture = "document.getElementById('road').toDataURL()"
        shown = page.evaluate(picture)
        page.uncheck("#ghosts")
        assert page.evaluate(picture) != shown


def test_what_if_says_what_changes_and_survives_a_reload(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        page.click("#what-if [data-what=STAY]")
        card = page.locator("article.branch")
        expect(card).to_contain_text("Outcome: no attempt, instead of completed.")
        page.select_option("#other-weather", "HardRainNight")
        expect(card).to_have_count(2)
        assert "ego in a" in page.inner_text("#board")
        assert page.locator(".curve.branch").count() >= 8
        picture = "document.getElementById('road').toDataURL()"
        page.keyboard.press("End")
        with_branches = page.evaluate(picture)
        before = state(page)
        assert "if=STAY@1,HardRainNight@1" in before["link"]
        page.reload()
        expect(card).to_have_count(2)
        assert state(page) == before
        for _ in range(2):
            page.locator("article.branch .close").first.click()
        expect(card).to_have_count(0)
        assert page.evaluate(picture) != with_branches


def test_a_branch_goes_on_from_a_branch(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        page.click("#what-if [data-what=STAY]")
        card = page.locator("article.branch")
        expect(card).to_have_count(1)
        page.select_option("#base", label="in branch a")
        page.fill("#seconds", "3.5")
        page.press("#seconds", "Enter")
        page.click("#what-if [data-what=PULL_OUT]")
        expect(card).to_have_count(2)
        expect(card.nth(1)).to_contain_text("stay at 1.00 s, then pull out at 3.50 s")
        before = state(page)
        assert before["link"].endswith("t=3.5&if=STAY@1,STAY@1~PULL_OUT@3.5")
        page.reload()
        expect(card).to_have_count(2)
        assert state(page) == before


def test_a_link_names_what_is_still_computed(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=1") as page:
        held: list[Any] = []
        page.route("**/branches", lambda route: held.append(route))
        page.click("#what-if [data-what=STAY]")
        expect(page).to_have_url(re.compile("if=STAY@1$"))
        expect(page.locator("main[aria-busy=true]")).to_have_count(1)
        assert page.locator("article.branch").count() == 0
        held[0].continue_()
        expect(page.locator("article.branch")).to_have_count(1)


def test_futures_of_a_start_are_told_with_intervals(
    browser: Browser, url: str, key: Any, data: Dataset
):
    with at(browser, url, key, "#sim=3&t=1.5") as page:
        for condition, words in (("truth", "hindsight"), ("belief", "its decision")):
            page.keyboard.press("f")
            panel = page.locator(".stage .futures")
            expect(panel).to_contain_text(words)
            fan = ot.whatif.outcome_fan(data, 3, condition_on=condition)
            place = fan.time.tolist().index(1.5)
            for code in OvertakeClass:
                share, (low, high) = fan.shares[place, code], fan.interval(code)[place]
                text = f"{code.title} {100 * share:.0f} % ({100 * low:.0f}–{100 * high:.0f})"
                assert (text in panel.inner_text()) == (share >= 0.005)
                assert (text in page.inner_text("#futures")) == (share >= 0.005)
            assert words in page.inner_text(".fan-about")
        before = state(page)
        assert before["link"].endswith("&fan=belief")
        page.reload()
        page.wait_for_selector(".fan-about")
        assert state(page) == before
        page.keyboard.press("f")
        expect(panel).to_be_hidden()


def test_two_policies_are_side_by_side(
    browser: Browser, url: str, key: Any, data: Dataset, capsys: pytest.CaptureFixture[str]
):
    assert main(["show", data.where, "3", "--json"]) == 0
    policies = json.loads(capsys.readouterr().out)["policies"]
    with at(browser, url, key, "#sim=3&t=1") as page:
        page.select_option("select[aria-label='Another policy beside it']", "strict")
        assert page.locator(".policy-row").count() == 2
        told = page.inner_text("#difference")
        only = set(policies["strict"]["broken"]) - set(policies["paper"]["broken"])
        assert only
        assert all(f"{rule} " in told.partition("Only strict counts")[2] for rule in only)
        assert policies["strict"]["class"] in page.inner_text("h1 .pair:last-child")
        before = state(page)
        assert "against=strict" in before["link"]
        page.reload()
        page.wait_for_selector(".policy-row")
        assert state(page) == before
        page.keyboard.press("v")
        expect(page.locator(".policy-row")).to_have_count(0)


def test_a_fifth_branch_is_refused_in_words(browser: Browser, url: str, key: Any):
    link = "#sim=3&t=1&if=STAY@1,PULL_OUT@1,ClearNoon@1,ClearNight@1"
    with at(browser, url, key, link) as page:
        expect(page.locator("article.branch")).to_have_count(4)
        page.click("#what-if [data-what=CANCEL]")
        expect(page.locator("main .failure").last).to_contain_text("drop one first")


def test_two_simulations_run_on_one_clock(browser: Browser, url: str, key: Any):
    with at(browser, url, key, "#sim=3&t=2") as page:
        page.fill("#beside", "8")
        page.press("#beside", "Enter")
        expect(page.locator("#road-beside")).to_be_visible()
        expect(page.locator("#road-beside")).to_have_attribute(
            "aria-label", re.compile("simulation 8. 2.00 s")
        )
        page.keyboard.press("Tab")
        page.get_by_label("One frame on").click()
        expect(page.locator("#road-beside")).to_have_attribute(
            "aria-label", re.compile("simulation 8. 2.05 s")
        )
        assert "Events in 8" in page.inner_text("#board")
        before = state(page)
        page.reload()
        expect(page.locator("#road-beside")).to_be_visible()
        assert state(page) == before


def test_the_keyboard_is_enough(browser: Browser, url: str, key: Any):
    with at(browser, url, key) as page:
        press = page.keyboard.press
        press("/")
        assert page.evaluate("document.activeElement.id").startswith("classes-")
        press(" ")
        expect(page.locator(".found")).not_to_have_text("120 of 120 simulations")
        page.evaluate("document.activeElement.blur()")
        press("j")
        press("j")
        number = page.evaluate("document.activeElement.dataset.sim")
        press("Enter")
        shows(page, number)
        press("ArrowRight")
        assert page.evaluate(FRAME) == 1
        press("b")
        assert page.evaluate("document.activeElement.dataset.what") == "PULL_OUT"
        press("Enter")
        expect(page.locator("article.branch")).to_have_count(1)
        press("j")
        expect(page).not_to_have_title(re.compile(f"^Simulation {number},"))
        page.evaluate("document.activeElement.blur()")
        press("a")
        expect(page.locator(ROWS).first).to_be_visible()


def test_the_page_says_what_show_says(
    browser: Browser, url: str, key: Any, data: Dataset, capsys: pytest.CaptureFixture[str]
):
    with at(browser, url, key, "#sim=1") as page:
        for number in (0, 4, 7):
            assert main(["show", data.where, str(number), "--json"]) == 0
            values = json.loads(capsys.readouterr().out)
            page.evaluate(f"location.hash = 'sim={number}'")
            shows(page, number)
            settle(page)
            says(page, values)


def test_who_has_no_key_sees_no_data(browser: Browser, url: str):
    base = url.partition("#")[0]
    for link in ("", "#token=wrong", "#sim=3"):
        context = browser.new_context()
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.goto(base + link)
        expect(page.locator(".closed [role=alert]")).to_contain_text("address")
        assert page.locator(ROWS).count() == 0
        context.close()


def test_wrong_links_are_told(browser: Browser, url: str, key: Any):
    context = browser.new_context(storage_state=key)
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(url.partition("#")[0] + "#sim=99999&class=%3Cimg%20src=x%20onerror=alert(1)%3E")
    expect(page.locator(".failure:visible").first).to_contain_text("expected 0 to 119")
    expect(page.locator(".simulations")).to_be_visible()
    assert page.locator("img").count() == 0
    context.close()


def test_on_a_phone_nothing_scrolls_sideways(browser: Browser, url: str, key: Any):
    for link in ("", EVERYTHING):
        with at(browser, url, key, link, viewport=PHONE, has_touch=True, is_mobile=True) as page:
            assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [{"width": 1280, "height": 900}, PHONE], ids=["desk", "phone"])
def test_axe_finds_nothing(
    browser: Browser, url: str, key: Any, scheme: str, viewport: dict[str, int]
):
    settings = {"color_scheme": scheme, "viewport": viewport, "bypass_csp": True}
    for link in ("", "#class=Success_I&rule=L3", EVERYTHING):
        with at(browser, url, key, link, **settings) as page:
            if not link and viewport == PHONE:
                page.click("aside .drawer > summary")
            assert axe_finds(page) == []


def test_the_command_serves_until_it_is_interrupted(data: Dataset):
    command = [sys.executable, "-m", "overtaking", "view", data.where, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as server:
        assert server.stdout is not None
        text = b"".join(iter(server.stdout.readline, b"}\n")) + b"}"
        client = Client(json.loads(text)["url"]).enter()
        assert client.rows()["total"] == 120
        server.send_signal(signal.SIGINT)
        _, said = server.communicate(timeout=60)
    assert server.returncode == 130
    assert b"Traceback" not in said


def test_a_choice_without_a_file_is_refused(data: Dataset, capsys: pytest.CaptureFixture[str]):
    assert main(["view", data.where, "--simulations", "3"]) == 2
    assert "add --export" in capsys.readouterr().err
