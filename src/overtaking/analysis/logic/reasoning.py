"""Clingo in a process beside this one: facts in, conclusions out, within limits."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Self

from overtaking.analysis.logic.clauses import reasoner
from overtaking.core.process_limits import check_query_limits, query_limit_error
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess

if TYPE_CHECKING:
    from overtaking.analysis.logic.vocabulary import Signature

MAX_ROWS = 10_000
TIMEOUT_S = 600.0
MEMORY_MIB = 2048
"""Default limits of a question."""

_MOST_READ = 32 * 1024 * 1024
"""Bytes of facts after which the process is replaced: clingo never frees a term."""


class Reasoner:
    """A program that is applied to one group of facts after the other; a context.

    Args:
        program: Rules.
        predicates: Predicates whose atoms are returned; their arguments are the rows.
        max_rows: Most rows of a group; one more shows that there are others.
        timeout_s: Time limit for all groups together [s].
        memory_mib: Memory limit [MiB].
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
            ConfigError: A limit is out of range.
            MissingExtraError: clingo is not installed.
        """
        reasoner()
        check_query_limits("ask", max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
        self._left, self._timeout, self._memory = timeout_s, timeout_s, memory_mib
        self._asked = {
            "program": program,
            "predicates": predicates,
            "max_rows": max_rows,
            "memory_mib": memory_mib,
        }
        self._read = 0
        self._worker = self._started()

    def _started(self) -> WorkerProcess:
        worker = WorkerProcess("overtaking.analysis.logic.child")
        worker.send(self._asked)
        return worker

    def __enter__(self) -> Self:
        """The reasoner itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self._worker.close()

    def rows(self, facts: bytes) -> list[list[Any]]:
        """The arguments of each atom of the predicates that follows from some facts.

        Raises:
            ConfigError: It exceeds its time or memory.
            ProgramError: The program is wrong.
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
            raise query_limit_error(
                "ask", f"an answer within {self._timeout:g} s", "one that takes longer"
            ) from None
        self._left -= time.monotonic() - begin
        if answer is WORKER_ENDED:
            answer = {"error": "memory"}  # clingo aborts where it cannot allocate.
        if answer.get("error") == "memory":
            raise query_limit_error(
                "ask", f"at most {self._memory} MiB of memory", "one that needs more"
            )
        if "error" in answer:
            raise ProgramError(" ".join(answer["said"]))
        return answer["rows"]


class ProgramError(Exception):
    """Clingo cannot use a program; the text is what it says."""
