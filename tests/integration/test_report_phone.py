"""The report in a browser as wide as a phone. Needs Chromium."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest
from tests.support.browser import MISSING

import overtaking

if TYPE_CHECKING:
    from pathlib import Path

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


@pytest.mark.ci
def test_nothing_scrolls_sideways_and_letters_can_be_read(tmp_path: Path):
    if CHROMIUM is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    data = overtaking.generate("pinto2023-physical", 100, 1, tmp_path / "data", keep="features")
    made = overtaking.write_report(data)
    # The browser takes no window below 500 pixels, a frame of any width.
    page = re.sub(r"<meta http-equiv=[^>]*>", "", made.path.read_text(encoding="utf-8"))
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
