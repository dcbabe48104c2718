"""The blocks of every page of the documentation do what the page says.

`tests/support/page_blocks.py` explains the comments in the pages that say how blocks are run.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.support.page_blocks import (
    EXECUTABLE,
    SHOWN,
    Block,
    PageRun,
    given_names,
    page_blocks,
)
from tests.support.page_inputs import WRITERS

from overtaking.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
ALL_PAGES = sorted(
    str(path.relative_to(ROOT)) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
)
PAGES = [
    page
    for page in ALL_PAGES
    if any(
        block.language in EXECUTABLE and not block.is_run_elsewhere
        for block in page_blocks(ROOT, page)
    )
]
LONG_PAGES = [page for page in PAGES if any(block.is_long for block in page_blocks(ROOT, page))]


@pytest.fixture(scope="session")
def pinto(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set `data/pinto` that many pages begin with."""
    folder = tmp_path_factory.mktemp("pages") / "pinto"
    assert main(["generate", "-n", "276", "--seed", "1", "--quiet", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def page_folder(workdir: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder like a clone in which the reader has just run `make demo`."""
    (workdir / "examples").symlink_to(ROOT / "examples")
    monkeypatch.setenv("COLUMNS", "100")  # Outputs on the pages are as wide.
    monkeypatch.syspath_prepend(workdir)
    modules = set(sys.modules)
    yield workdir
    for name in set(sys.modules) - modules:  # A later page may save another file of the same name.
        if str(workdir) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def follow(page: str, folder: Path, pinto: Path, *, with_long: bool) -> None:
    """Make the files that a page expects, and run its blocks in their order."""
    for name in given_names(ROOT, page):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name == "data/pinto":
            shutil.copytree(pinto, path)
        else:
            WRITERS[name](path)
    run = PageRun(with_long=with_long)
    for block in page_blocks(ROOT, page):
        run.run(block)


@pytest.mark.ci
@pytest.mark.parametrize("page", PAGES)
def test_the_blocks_of_a_page_run(page: str, page_folder: Path, pinto: Path):
    follow(page, page_folder, pinto, with_long=False)


@pytest.mark.docs
@pytest.mark.parametrize("page", LONG_PAGES)
def test_the_long_blocks_of_a_page_run(page: str, page_folder: Path, pinto: Path):
    follow(page, page_folder, pinto, with_long=True)


def test_every_block_has_a_language_that_says_whether_it_is_run():
    unknown = {
        block.page: block.language
        for page in ALL_PAGES
        for block in page_blocks(ROOT, page)
        if block.language not in (*EXECUTABLE, *SHOWN)
    }
    assert unknown == {}


def test_a_block_that_another_test_runs_names_a_test_that_exists():
    for page in ALL_PAGES:
        for block in page_blocks(ROOT, page):
            if block.comment.startswith("run: by "):
                assert (ROOT / "tests" / block.comment.removeprefix("run: by ")).exists(), block


@pytest.mark.parametrize(
    ("content", "comment", "is_right"),
    [
        ("first\nsecond\n", "output", True),
        ("first\n...\n", "output", True),
        ("second\n", "output", False),
        ("second\n", "part of output", True),
        ("third\n", "part of output", False),
    ],
)
def test_an_output_that_differs_is_an_error(content: str, comment: str, is_right: bool):
    run = PageRun(with_long=False)
    run.run(Block("page:1", "python", "print('first\\nsecond')", ""))
    output = Block("page:2", "text", content, comment)
    with contextlib.nullcontext() if is_right else pytest.raises(AssertionError, match="expected"):
        run.run(output)


def test_a_session_that_prints_another_value_is_an_error():
    run = PageRun(with_long=False)
    run.run(Block("page:1", "pycon", ">>> 1 + 1\n2\n", ""))
    with pytest.raises(AssertionError, match="Expected"):
        run.run(Block("page:1", "pycon", ">>> 1 + 1\n3\n", ""))


def test_a_command_that_fails_is_an_error():
    with pytest.raises(AssertionError, match="page:1"):
        PageRun(with_long=False).run(Block("page:1", "console", "overtaking info nowhere", ""))
