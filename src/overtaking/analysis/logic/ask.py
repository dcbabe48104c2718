"""Questions to a data set: which simulations, vehicles and frames meet a condition."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from overtaking.analysis.logic.facts import EVERY, group_text
from overtaking.analysis.logic.question import ANSWER, Column, question, refused
from overtaking.analysis.logic.reasoning import (
    MAX_ROWS,
    MEMORY_MIB,
    TIMEOUT_S,
    ProgramError,
    Reasoner,
)
from overtaking.analysis.logic.source import groups
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import check_in_range
from overtaking.core.process_limits import remaining_answer_bytes
from overtaking.core.representation import ShownAsTable

if TYPE_CHECKING:
    import pandas as pd

    from overtaking.core.arrays import I64
    from overtaking.core.progress import ProgressCallback
    from overtaking.data.load import Dataset

Value = int | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers(ShownAsTable, ContentEquality):
    """The answers to a question.

    Attributes:
        columns: The variables of the question.
        rows: Their values, in order.
        is_cut: Whether there are more than the limit.
        num_asked: Number of simulations that were asked.
        frame_interval_ms: Time between two frames [ms].
    """

    columns: tuple[Column, ...]
    rows: list[tuple[Value, ...]]
    is_cut: bool
    num_asked: int
    frame_interval_ms: int

    def to_pandas(self) -> pd.DataFrame:
        """The rows as a DataFrame with a column for each variable."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=[column.name for column in self.columns])


def ask(
    data: Dataset,
    text: str,
    *,
    chosen: I64 | None = None,
    every: int = EVERY,
    max_rows: int = MAX_ROWS,
    timeout_s: float = TIMEOUT_S,
    memory_mib: int = MEMORY_MIB,
    progress: ProgressCallback | None = None,
) -> Answers:
    """Ask a data set a question; each simulation is asked on its own.

    Args:
        data: The data set.
        text: A condition on the predicates of facts, theory and law, in clingo's language.
        chosen: Numbers of the simulations in order; all of them if left out.
        every: Interval between known positions [frames], as in an export.
        max_rows: Most answers.
        timeout_s: Time limit of the reasoner [s].
        memory_mib: Memory limit [MiB]; the answers may take an eighth of it.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: It is no question, or exceeds its time or memory.
        DatasetError: A file of the data set is damaged.
        MissingExtraError: clingo is not installed.
    """
    check_in_range(every, 1, what="--frame-step", where="logic", unit="frame")
    asked = question(text)
    rows: list[tuple[Value, ...]] = []
    num_asked, interval, room = 0, 0, None
    with Reasoner(
        asked.program,
        ((ANSWER, len(asked.columns)),),
        max_rows=max_rows,
        timeout_s=timeout_s,
        memory_mib=memory_mib,
    ) as reasoner:
        for group in groups(data, chosen):
            interval = group.case.signals.frame_interval_ms
            found = _answers(reasoner, group_text(group, asked.demand, every))
            room = remaining_answer_bytes(room, found, "ask", memory_mib)
            rows += found
            num_asked += len(group.numbers)
            if progress is not None:
                progress(group.done, len(data))
            if len(rows) > max_rows:
                break
    return Answers(
        columns=asked.columns,
        rows=rows[:max_rows],
        is_cut=len(rows) > max_rows,
        num_asked=num_asked,
        frame_interval_ms=interval,
    )


def _answers(reasoner: Reasoner, facts: bytes) -> list[tuple[Value, ...]]:
    """The answers of one group, in order; numbers before names."""
    try:
        found = reasoner.rows(facts)
    except ProgramError as error:
        unsafe = re.findall(r"'(\w+)' is unsafe", str(error))
        if unsafe:
            got = f"{', '.join(dict.fromkeys(unsafe))}, which nothing gives a value to"
            raise refused(got, "every variable in an atom that is not negated") from None
        raise refused(" ".join(str(error).split())[:120], "one that clingo can answer") from None
    rows = [tuple(row) for row in found]
    return sorted(rows, key=lambda row: [(isinstance(one, str), one) for one in row])
