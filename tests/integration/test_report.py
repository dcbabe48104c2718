"""The report on the command line, and its page in a browser as wide as a phone (Chromium)."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "pinto"
    overtaking.generate("pinto2023-physical", 100, 1, path, keep="features")
    return path


@pytest.fixture(scope="module")
def said(folder: Path, parent: None) -> subprocess.CompletedProcess[str]:
    """What is said of the report that is made for all tests."""
    return commands.run("report", folder, "--json")


def test_a_report_of_data_without_frames_shows_overtakes(
    folder: Path, said: subprocess.CompletedProcess[str]
):
    assert (said.returncode, said.stderr) == (0, "")
    values = json.loads(said.stdout)
    present = set(overtaking.load(folder).features()["CLASS"])
    assert values["page"] == str(folder / "report" / "index.html")
    assert sum(name.startswith("example-") for name in values["figures"]) == len(present)
    assert values["missing"] == []
    overtaking.load(folder).verify()  # A report beside the tables is no damage.


def test_nothing_scrolls_sideways_and_letters_can_be_read(
    folder: Path, said: subprocess.CompletedProcess[str], tmp_path: Path
):
    if CHROMIUM is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    made = json.loads(said.stdout)["page"]
    # The browser takes no window below 500 pixels, a frame of any width.
    page = re.sub(r"<meta http-equiv=[^>]*>", "", Path(made).read_text(encoding="utf-8"))
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
