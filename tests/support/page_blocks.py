"""The fenced blocks of a page of the documentation, and how they are run.

A comment above a block, which no reader of the page sees, says how a test treats it:

* no comment: the block is run, in its order on the page. It takes less than five seconds.
* `<!-- run: long -->`: it takes longer, or needs the network; `make test-docs` runs it.
* `<!-- run: until ready -->`: the command serves until it is interrupted; the test interrupts it
  when it has printed an address.
* `<!-- run: never: REASON -->`: tests cannot run it, for example because it needs a cluster.
* `<!-- run: by TEST -->`: another test, a path below `tests`, runs it.
* `<!-- save: FILE -->`: the block is the content of a file.
* `<!-- output -->`: the block is the output of the last block that was run; `...` is any text.
* `<!-- part of output -->`: the block is a part of that output.
* `<!-- given: NAME ... -->`, anywhere: files that the page expects.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import signal
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb

from overtaking.cli import main

FENCE = re.compile(
    r"(?:^ *<!-- (?P<comment>[^\n]+?) -->\n+)?"
    r"^(?P<indent> *)```(?P<language>[\w-]*)\n(?P<content>.*?)^ *```$",
    re.DOTALL | re.MULTILINE,
)
OUTPUTS = ("output", "part of output")
GIVEN = re.compile(r"<!-- given: (.+?) -->")
MODES = (
    "run: long",
    "run: until ready",
    "run: never: ",
    "run: by ",
    "save: ",
    "output",
    "part of output",
)
EXECUTABLE = ("console", "pycon", "python", "sql", "toml")
"""Languages of blocks that must be run or have a comment."""

SHOWN = ("json", "math", "mermaid", "text", "yaml")
"""Languages of blocks that are only read."""


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block of a page.

    Attributes:
        page: Path of the page below the repository, and the line of the block.
        language: The word after the opening fence.
        content: The text of the block.
        comment: The comment above it, empty without one.
    """

    page: str
    language: str
    content: str
    comment: str

    @property
    def is_long(self) -> bool:
        return self.comment == "run: long"

    @property
    def is_run_elsewhere(self) -> bool:
        return self.comment.startswith(("run: never: ", "run: by "))


def page_blocks(root: Path, page: str) -> list[Block]:
    """The blocks of a page, in their order."""
    text = (root / page).read_text(encoding="utf-8")
    blocks = []
    for match in FENCE.finditer(text):
        comment = match["comment"] or ""
        line = text.count("\n", 0, match.start("language")) + 1
        content = re.sub(f"^{match['indent']}", "", match["content"], flags=re.MULTILINE)
        is_known = comment.startswith(MODES)
        blocks.append(
            Block(f"{page}:{line}", match["language"], content, comment if is_known else "")
        )
    return blocks


def given_names(root: Path, page: str) -> list[str]:
    """Names of the files that a page expects."""
    match = GIVEN.search((root / page).read_text(encoding="utf-8"))
    return match[1].split() if match else []


class PageRun:
    """Runs the blocks of a page in the current folder.

    Args:
        with_long: Whether blocks that take long are run.
    """

    def __init__(self, *, with_long: bool) -> None:
        self._with_long = with_long
        self._names: dict[str, Any] = {"__name__": "page"}
        self._output: str | None = None

    def run(self, block: Block) -> None:
        """Run a block, or compare it with the output of the one before."""
        if block.comment.startswith("save: "):
            path = Path(block.comment.removeprefix("save: "))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.content, encoding="utf-8")
        elif block.comment in OUTPUTS:
            self._compare_output(block)
        elif block.is_run_elsewhere or (block.is_long and not self._with_long):
            self._output = None
        elif block.comment == "run: until ready":
            serve_until_ready(block.content)
        elif block.language in EXECUTABLE:
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                self._execute(block)
            self._output = output.getvalue()

    def _execute(self, block: Block) -> None:
        if block.language == "python":
            exec(compile(block.content, block.page, "exec"), self._names)
        elif block.language == "pycon":
            self._names = run_session(block.content, self._names, block.page)
        elif block.language == "console":
            for line in block.content.replace("\\\n", " ").splitlines():
                run_command(line, block.page)
        elif block.language == "toml":
            tomllib.loads(block.content)
        elif ".parquet" in block.content:  # `overtaking sql` reads no files; DuckDB itself does.
            duckdb.sql(f"create table answer as {block.content}")
        else:
            query = " ".join(block.content.rstrip().rstrip(";").split())
            assert main(["sql", "data/pinto", query]) == 0, block.page

    def _compare_output(self, block: Block) -> None:
        if self._output is None:  # The block before was not run.
            return
        expected = block.content.strip() + "\n"
        output = re.sub(r" +$", "", self._output.strip() + "\n", flags=re.MULTILINE)
        if block.comment == "part of output":
            expected = f"...{expected}..."
        is_same = doctest.OutputChecker().check_output(expected, output, doctest.ELLIPSIS)
        assert is_same, f"{block.page}: expected\n{block.content}\ngot\n{self._output}"


def run_command(line: str, page: str) -> None:
    """Run a command of a console block; it must succeed without a warning."""
    words = shlex.split(line, comments=True)
    if not words:
        return
    program, *arguments = words
    assert program == "overtaking", f"{page}: {line}"
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors):
        status = main(arguments)
    # `validate` ends with 1 if a figure of the profile misses its target, as the page states.
    allowed = (0, 1) if arguments[0] == "validate" else (0,)
    assert status in allowed, f"{page}: {line}: {errors.getvalue()}"
    assert "Traceback" not in errors.getvalue(), f"{page}: {line}"
    assert "arning" not in errors.getvalue(), f"{page}: {line}: {errors.getvalue()}"


def run_session(content: str, names: dict[str, Any], page: str) -> dict[str, Any]:
    """Run an interactive session and compare its output; returns the names that it defines."""
    test = doctest.DocTestParser().get_doctest(content, names, page, page, 0)
    report: list[str] = []
    result = doctest.DocTestRunner().run(test, out=report.append, clear_globs=False)
    assert result.failed == 0, "".join(report)
    return test.globs


def serve_until_ready(content: str) -> None:
    """Start a server, and interrupt it once it has printed its address."""
    (line,) = content.splitlines()
    program, *arguments = shlex.split(line)
    assert program == "overtaking"
    command = [sys.executable, "-u", "-m", "overtaking", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as server:
        assert server.stdout
        assert server.stderr
        first_line = server.stdout.readline().decode()
        server.send_signal(signal.SIGINT)
        _, errors = server.communicate()
    assert re.search(r"http://|ready", first_line), f"{first_line}{errors.decode()}"
    assert "Traceback" not in errors.decode()
