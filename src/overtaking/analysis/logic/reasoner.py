"""clingo in a process beside this one: facts in, conclusions out, within limits."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Self

from overtaking.analysis.logic.programs import import_clingo
from overtaking.core.process_limits import check_query_limits, query_limit_error
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess

if TYPE_CHECKING:
    from overtaking.analysis.logic.reasoner_process import ReasonerSettings
    from overtaking.analysis.logic.vocabulary import Signature

# Default limits of a query of `overtaking ask`, choices. A `Reasoner` by itself returns all rows.
MAX_ROWS = 10_000
TIMEOUT_S = 600.0
MEMORY_MIB = 2048

_RESTART_AFTER_BYTES = 32 * 1024 * 1024
"""Bytes of facts after which the process is replaced.

clingo never frees a term, so its memory grows with the facts that it has read. The number is a
choice: a larger one needs more of the memory limit, a smaller one starts more processes.
"""


class ProgramError(Exception):
    """clingo cannot use a program; the text is clingo's message."""


class Reasoner:
    """A program that is applied to one group of facts after the other; a context manager.

    Args:
        program: Rules.
        predicates: Predicates whose atoms are returned, in this order. The arguments of an atom are
            a row, without the name of its predicate: a caller that needs the name asks for one
            predicate.
        max_rows: Largest number of rows of a group. If more atoms follow, `solve` returns
            `max_rows + 1` rows.
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
        import_clingo()  # The worker needs it; here its absence is a `MissingExtraError`.
        check_query_limits("ask", max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
        self._timeout_s, self._seconds_left = timeout_s, timeout_s
        self._settings: ReasonerSettings = {
            "program": program,
            "predicates": predicates,
            "max_rows": max_rows,
            "memory_mib": memory_mib,
        }
        self._bytes_read = 0
        self._worker = self._start_worker()

    def _start_worker(self) -> WorkerProcess:
        worker = WorkerProcess("overtaking.analysis.logic.reasoner_process")
        worker.send(self._settings)
        return worker

    def __enter__(self) -> Self:
        """The reasoner itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self._worker.close()

    def solve(self, facts: bytes) -> list[list[Any]]:
        """The conclusions from the facts: for each atom of the predicates, its arguments.

        After an error the reasoner must be left: its process has ended, or still computes.

        Args:
            facts: Facts of one group in clingo's syntax, in UTF-8.

        Raises:
            ConfigError: The program exceeds its time or memory.
            ProgramError: The program is wrong.
        """
        if self._bytes_read > _RESTART_AFTER_BYTES:
            self._worker.close()
            self._worker, self._bytes_read = self._start_worker(), 0
        self._bytes_read += len(facts)
        begin = time.monotonic()
        self._worker.send(facts)
        try:
            answer: Any = self._worker.receive(self._seconds_left)
        except TimeoutError:
            raise query_limit_error(
                "ask", f"an answer within {self._timeout_s:g} s", "one that takes longer"
            ) from None
        self._seconds_left -= time.monotonic() - begin
        if answer is WORKER_ENDED:
            answer = {"error": "memory"}  # clingo aborts where it cannot allocate.
        if answer.get("error") == "memory":
            limit = f"at most {self._settings['memory_mib']} MiB of memory"
            raise query_limit_error("ask", limit, "one that needs more")
        if "error" in answer:
            raise ProgramError(" ".join(answer["messages"]))
        return answer["rows"]
