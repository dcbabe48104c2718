"""A reasoner that works beside this process: facts in, conclusions out, within bounds."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Self

from overtaking.analysis.logic.clauses import reasoner
from overtaking.core.bounds import check_bounds, over
from overtaking.core.worker import ENDED, Worker

if TYPE_CHECKING:
    from types import TracebackType

    from overtaking.analysis.logic.vocabulary import Signature

MAX_ROWS = 10_000
TIMEOUT_S = 600.0
MEMORY_MIB = 2048
"""Bounds of a question, unless others are asked for."""

_MOST_READ = 32 * 1024 * 1024
"""Bytes of facts that a process reads: clingo keeps every term that it has ever seen."""


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
        self._asked = {
            "program": program,
            "predicates": predicates,
            "max_rows": max_rows,
            "memory_mib": memory_mib,
        }
        self._read = 0
        self._worker = self._started()

    def _started(self) -> Worker:
        worker = Worker("overtaking.analysis.logic.child")
        worker.send(self._asked)
        return worker

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
        self._worker.close()

    def rows(self, facts: bytes) -> list[list[Any]]:
        """What follows from some facts: the arguments of each atom that is asked for.

        Raises:
            ConfigError: It needs more time or memory than it may, or the program is wrong.
        """
        if self._read > _MOST_READ:
            self._worker.close()
            self._worker, self._read = self._started(), 0
        self._read += len(facts)
        begin = time.monotonic()
        self._worker.send(facts)
        try:
            answer: Any = self._worker.receive(self._left)
        except TimeoutError:
            raise over(
                "ask", f"an answer within {self._timeout:g} s", "one that takes longer"
            ) from None
        self._left -= time.monotonic() - begin
        if answer is ENDED:
            answer = {"error": "memory"}  # clingo aborts where it cannot allocate.
        if answer.get("error") == "memory":
            raise over("ask", f"at most {self._memory} MiB of memory", "one that needs more")
        if "error" in answer:
            raise ProgramError(answer["said"])
        return answer["rows"]


class ProgramError(Exception):
    """What clingo says of a program that it cannot use."""

    def __init__(self, said: list[str]) -> None:
        """Keep what it says, line by line."""
        super().__init__(" ".join(said))
        self.said = said
