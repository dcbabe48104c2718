"""What the how-to pages tell people to type does what they say."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys

PAGES = (
    "make-a-data-set.md",
    "generate-at-scale.md",
    "balance-classes.md",
    "look-at-a-simulation.md",
    "videos.md",
    "export-the-papers-table.md",
    "query-with-sql.md",
    "ask-with-logic.md",
    "literature.md",
    "check-the-installation.md",
)
"""In the order in which a reader meets them: the later ones use the data of the first."""


def blocks(text: str, language: str) -> list[str]:
    """The code blocks of a page."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def test_what_the_pages_say_works(repository, workdir):
    commands = 0
    for page in PAGES:
        text = (repository / "docs" / "how-to" / page).read_text(encoding="utf-8")
        for line in "".join(blocks(text, "console")).splitlines():
            program, *arguments = shlex.split(line)
            assert program == "overtaking"
            command = [sys.executable, "-m", "overtaking.cli", *arguments]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert (done.returncode, done.stderr) == (0, ""), f"{page}: {line}"
            commands += 1
        for block in blocks(text, "python"):
            subprocess.run([sys.executable, "-c", block], check=True)
            commands += 1
    assert commands > len(PAGES)
    assert {path.name for path in workdir.iterdir()} == {"data", "table.csv", "table.parquet"}
