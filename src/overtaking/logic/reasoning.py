"""A reasoner that works beside this process: facts in, conclusions out, within bounds."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from typing import IO, TYPE_CHECKING, Any, Self

from overtaking.core.bounds import check_bounds, over
from overtaking.logic.clauses import reasoner

if TYPE_CHECKING:
    from types import TracebackType

    from overtaking.logic.vocabulary import Signature

MAX_ROWS = 10_000
TIMEOUT_S = 600.0
MEMORY_MIB = 2048
"""Bounds of a question, unless others are asked for."""

_MOST_READ = 32 * 1024 * 1024
"""Bytes of facts that a process reads: clingo keeps every term that it has ever seen."""

_COMMAND = (sys.executable, "-P", "-m", "overtaking.logic.child")


class Reasoner:
    """A program that is asked of one group of facts after the other; used as a context.

    Args:
        program: Rules.
        predicates: Whose atoms are given back; their arguments are the rows.
        max_rows: How many rows of a group to give at most, and one more.
        timeout_s: How long it may reason, all groups together [s].
        memory_mib: How much memory it may use [MiB].
    """

    def __init__(
        self,
        program: str,
        predicates: tuple[Signature, ...],
        *,
        max_rows: int = 10**9,
        timeout_s: float = TIMEOUT_S,
        memory_mib: int = MEMORY_MIB,
    ) -> None:
        """Start the process.

        Raises:
            ConfigError: A bound is none.
            MissingExtraError: clingo is not installed.
        """
        reasoner()
        check_bounds("ask", max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
        self._left, self._timeout, self._memory = timeout_s, timeout_s, memory_mib
        asked = {
            "program": program,
            "predicates": predicates,
            "max_rows": max_rows,
            "memory_mib": memory_mib,
        }
        self._head = json.dumps(asked).encode() + b"\n"
        self._read = 0
        self._process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        """A new process; what it is told first waits in its pipe."""
        process = subprocess.Popen(
            _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert process.stdin is not None
        process.stdin.write(self._head)
        return process

    def _end(self) -> None:
        self._process.kill()
        self._process.communicate()

    def __enter__(self) -> Self:
        """The reasoner itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process."""
        self._end()

    def rows(self, facts: bytes) -> list[list[Any]]:
        """What follows from some facts: the arguments of each atom that is asked for.

        Raises:
            ConfigError: It needs more time or memory than it may, or the program is wrong.
        """
        if self._read > _MOST_READ:
            self._end()
            self._process, self._read = self._started(), 0
        self._read += len(facts)
        message = b"%d\n" % len(facts) + facts
        begin = time.monotonic()
        timer = threading.Timer(self._left, self._process.kill)
        timer.daemon = True
        timer.start()
        try:
            line = self._exchanged(message)
        finally:
            timer.cancel()
        self._left -= time.monotonic() - begin
        if not line and self._left <= 0:
            raise over("ask", f"an answer within {self._timeout:g} s", "one that takes longer")
        answer: dict[str, Any] = json.loads(line) if line else {"error": "memory"}
        if answer.get("error") == "memory":
            raise over("ask", f"at most {self._memory} MiB of memory", "one that needs more")
        if "error" in answer:
            raise ProgramError(answer["said"])
        return answer["rows"]

    def _exchanged(self, message: bytes) -> bytes:
        """The line that a message is answered with; nothing if the process has ended."""
        to: IO[bytes] | None = self._process.stdin
        back: IO[bytes] | None = self._process.stdout
        assert to is not None
        assert back is not None
        try:
            to.write(message)
            to.flush()
            return back.readline()
        except (BrokenPipeError, OSError):
            return b""


class ProgramError(Exception):
    """What clingo says of a program that it cannot use."""

    def __init__(self, said: list[str]) -> None:
        """Keep what it says, line by line."""
        super().__init__(" ".join(said))
        self.said = said
