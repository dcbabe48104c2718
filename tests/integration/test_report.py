"""The report on the command line, and its page in a browser as wide as a phone (Chromium)."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from tests.support import commands
from tests.support.browser import MISSING

import overtaking

pytestmark = pytest.mark.ci

CHROMIUM = shutil.which("chromium")
OPTIONS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
    *("--allow-file-access-from-files", "--hide-scrollbars", "--dump-dom"),
)
WIDTH = 390
FRAME = f'<iframe src="page.html" style="border:0;width:{WIDTH}px;height:9000px"></iframe>'
SCRIPT = """<script>
const wide = [...document.querySelectorAll(".wide, figure")].filter(one => one.scrollWidth >
  one.clientWidth + 1).map(one => one.id || one.firstChild.id);
const small = Math.min(...[...document.querySelectorAll("td, th, p, dd")].map(one =>
  parseFloat(getComputedStyle(one).fontSize)));
parent.document.title = [document.documentElement.scrollWidth, small, ...wide].join(" ");
</script></body>"""


FIGURES = {
    "classes",
    "waiting-time",
    "histograms",
    "boxes",
    "speed-by-class",
    "pairs",
    "pair-details",
    "associations",
    "p-values",
}
"""Those without the examples."""
TABLES = {
    "classes",
    "static-features",
    "dynamic-features",
    "associations-with-class",
    "strongest-associations",
}
VOID = {"meta", "img", "source", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """What a page holds, and whether every tag is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.faults: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.links += [found[name] or "" for name in ("href", "src") if name in found]
        self.ids += [found["id"] or ""] if "id" in found else []
        self.images += [found] if tag == "img" else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(tag)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "pinto"
    overtaking.generate_dataset(
        "pinto2023-physical", num_simulations=100, seed=1, out=path, keep="features"
    )
    return path


@pytest.fixture(scope="module")
def said(folder: Path, parent: None) -> subprocess.CompletedProcess[str]:
    """What is said of the report that is made for all tests."""
    return commands.run("report", folder, "--json")


def test_a_report_of_data_without_frames_shows_overtakes(
    folder: Path, said: subprocess.CompletedProcess[str], found: dict[str, Any]
):
    assert (said.returncode, said.stderr) == (0, "")
    present = set(overtaking.load_dataset(folder).features()["CLASS"])
    assert found["page"] == str(folder / "report" / "index.html")
    assert sum(name.startswith("example-") for name in found["figures"]) == len(present)
    assert found["missing"] == []
    overtaking.load_dataset(folder).verify()  # A report beside the tables is no damage.


@pytest.fixture(scope="module")
def found(said: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """What the command says of the report."""
    return json.loads(said.stdout)


@pytest.fixture(scope="module")
def text(found: dict[str, Any]) -> str:
    """The page."""
    return Path(found["page"]).read_text(encoding="utf-8")


def test_every_figure_and_table_is_there_as_files(found: dict[str, Any]):
    folder = Path(found["page"]).parent
    assert {one for one in found["figures"] if not one.startswith("example-")} == FIGURES
    assert set(found["tables"]) == TABLES
    assert {path.name for path in (folder / "figures").iterdir()} == {
        f"{name}.{kind}" for name in found["figures"] for kind in ("svg", "pdf", "png")
    }
    assert {path.name for path in (folder / "tables").iterdir()} == {
        f"{name}.{kind}" for name in TABLES for kind in ("tex", "csv")
    }


def test_the_page_needs_nothing_from_elsewhere(found: dict[str, Any], text: str):
    links, ids = Page(text).links, Page(text).ids
    outside = [one for one in links if not one.startswith(("#", "data:"))]
    assert outside
    assert all((Path(found["page"]).parent / one.split("#")[0]).is_file() for one in outside)
    assert {one[1:] for one in links if one.startswith("#")} <= set(ids)
    assert "http://" not in text
    assert "https://" not in text
    assert "<script" not in text


def test_every_figure_is_drawn_for_a_phone_too(found: dict[str, Any], text: str):
    source = '<source media="(max-width: 44rem)" srcset="data:image/svg+xml;base64,'
    assert text.count(source) == len(found["figures"])
    assert "@media screen and (max-width: 44rem)" in text


def test_the_page_is_well_formed_and_its_pictures_have_words(found: dict[str, Any], text: str):
    page = Page(text)
    assert page.faults == []
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert len(page.images) == len(found["figures"])
    assert all(len(one["alt"] or "") > 30 for one in page.images)


def test_nothing_scrolls_sideways_and_letters_can_be_read(text: str, tmp_path: Path):
    if CHROMIUM is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    # The browser takes no window below 500 pixels, a frame of any width.
    page = re.sub(r"<meta http-equiv=[^>]*>", "", text)
    (tmp_path / "page.html").write_text(page.replace("</body>", SCRIPT), encoding="utf-8")
    (tmp_path / "frame.html").write_text(FRAME, encoding="utf-8")
    done = subprocess.run(
        [
            str(CHROMIUM),
            *OPTIONS,
            f"--user-data-dir={tmp_path / 'browser'}",
            f"file://{tmp_path / 'frame.html'}",
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    found = re.search(r"<title>(.+)</title>", done.stdout)
    assert found, done.stdout[:500]
    width, letters, *scrolled = found[1].split(" ")
    assert float(width) <= WIDTH
    assert float(letters) >= 9
    assert scrolled == []
