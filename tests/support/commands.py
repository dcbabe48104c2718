"""Commands in processes of their own that start at once.

Importing takes longer than everything else that most commands do. So one process imports once, and
each command runs in a child of it, with its own streams and limits.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

_PARENT = """
import json, os, resource, sys
import overtaking as ot
from overtaking.cli import app, arguments, main, show, summary
from overtaking.recordings import pinto2023
for line in sys.stdin:
    order = json.loads(line)
    child = os.fork()
    if not child:
        for stream, path in ((1, order["stdout"]), (2, order["stderr"])):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
        if order["largest_file"]:
            resource.setrlimit(resource.RLIMIT_FSIZE, (order["largest_file"],) * 2)
        status = main(order["arguments"])
        sys.stdout.flush()
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""

_parents: list[tuple[subprocess.Popen[str], Path]] = []


@contextmanager
def parent(folder: Path) -> Generator[None]:
    """The process whose children run the commands; their streams go through files in a folder."""
    command, pipe = [sys.executable, "-c", _PARENT], subprocess.PIPE
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    environment.pop("COLUMNS", None)
    with subprocess.Popen(command, text=True, stdin=pipe, stdout=pipe, env=environment) as process:
        _parents.append((process, folder))
        yield
        _parents.clear()
        process.communicate()


def run(*arguments: object, largest_file: int = 0) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; the test uses the fixture `parent`.

    Args:
        arguments: Those of the command line.
        largest_file: Bytes that a file may have, which is how a full disk looks to a process.
    """
    ((process, folder),) = _parents
    assert process.stdin is not None
    assert process.stdout is not None
    given = [str(one) for one in arguments]
    files = {name: folder / name for name in ("stdout", "stderr")}
    order = {
        "arguments": given,
        "largest_file": largest_file,
        **{k: str(v) for k, v in files.items()},
    }
    process.stdin.write(json.dumps(order) + "\n")
    process.stdin.flush()
    status = int(process.stdout.readline())
    texts = {name: path.read_text(encoding="utf-8") for name, path in files.items()}
    return subprocess.CompletedProcess(given, status, **texts)
