"""What the how-to pages tell people to type does what they say."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from overtaking.cli import main

pytestmark = pytest.mark.ci

PAGES = {
    "make-a-data-set.md": {"data/few", "data/pinto"},
    "generate-at-scale.md": {"data/large"},
    "balance-classes.md": {"data/even", "data/even-light", "data/few-of-each"},
    "look-at-a-simulation.md": set(),
    "videos.md": {"data/pinto/videos"},
    "report.md": {"data/pinto/report/index.html", "data/pinto-default", "classes.pdf"},
    "figures-for-a-paper.md": {"waiting-time.pdf", "both.pdf"},
    "export-the-papers-table.md": {"table.csv", "table.parquet"},
    "query-with-sql.md": {"data/er.svg"},
    "ask-with-logic.md": set(),
    "drive-it-yourself.md": {"my_driver.py", "data/mine", "data/again"},
    "evaluate-a-driver.md": {"my_driver.py", "page/index.html", "page/films"},
    "ask-what-if.md": {"twins.mp4", "twins.svg", "data/twins", "fan.svg", "data/branches"},
    "use-gymnasium.md": set(),
    "literature.md": set(),
    "check-the-installation.md": set(),
}
"""Each page, and the files and folders that its commands make."""

LONG = {
    "evaluate-a-driver.md",
    "ask-what-if.md",
    "ask-with-logic.md",
    "balance-classes.md",
    "export-the-papers-table.md",
    "videos.md",
    "report.md",
    "figures-for-a-paper.md",
}

FIRST = "make-a-data-set.md"
"""The page whose first block makes the data set that all others read."""


def blocks(repository: Path, page: str) -> list[tuple[str, str]]:
    """Language and content of the code blocks of a page that are run."""
    text = (repository / "docs" / "how-to" / page).read_text(encoding="utf-8")
    return re.findall(r"^```(console|python)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def save_driver(repository: Path, folder: Path) -> None:
    """Save the driver that `drive-it-yourself.md` asks to save."""
    _, block = blocks(repository, "drive-it-yourself.md")[0]
    name = block.splitlines()[0].removeprefix("# ")
    (folder / name).write_text(block, encoding="utf-8")


def follow(language: str, block: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Do what a block says; a command must succeed without a word on standard error."""
    if language == "python":
        exec(compile(block, "block", "exec"), {"__name__": "__main__"})
        return
    for line in block.splitlines():
        program, *arguments = shlex.split(line)
        assert program == "overtaking"
        if arguments[0] == "evaluate":  # Fewer scenes and films: each command takes minutes.
            arguments += ["-n", "6", *(["--films", "1"] if "--out" in arguments else [])]
        status = main(arguments)
        told = re.sub(r"^page/index.html: 3 figures, 1 films\n$", "", capsys.readouterr().err)
        assert (status, told) == (0, ""), line


@pytest.fixture(scope="module")
def pinto(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set of the first page."""
    folder = tmp_path_factory.mktemp("first")
    (_, block), *_ = blocks(repository, FIRST)
    *arguments, out = shlex.split(block)[1:]
    assert main([*arguments, str(folder / out), "--quiet"]) == 0
    return folder / out


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.ci] if page in LONG else []) for page in PAGES]
)
def test_what_a_page_says_works(page, repository, workdir, pinto, capsys, monkeypatch):
    if page != FIRST:
        shutil.copytree(pinto, workdir / "data" / "pinto")
    (workdir / "examples").symlink_to(repository / "examples")
    if "my_driver.py" in PAGES[page]:
        save_driver(repository, workdir)
        monkeypatch.syspath_prepend(workdir)
    capsys.readouterr()
    found = blocks(repository, page)
    assert found
    for language, block in found:
        follow(language, block, capsys)
    assert all((workdir / made).exists() for made in PAGES[page])
    made = {Path(one).parts[0] for one in PAGES[page]}
    assert {path.name for path in workdir.iterdir()} <= made | {"data", "examples", "__pycache__"}
