"""The data set behind the page: the list, one simulation, its beliefs, branches and thumbnail.

One simulation at a time is prepared: requests wait for each other, so that memory and processors
are bounded whatever a page asks for.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.database.query import query
from overtaking.analysis.whatif.scenes import scene_of
from overtaking.core.errors import ConfigError, NoSuchSimulationError, OvertakingError
from overtaking.labels.labelling import label
from overtaking.show.server.index import Index, titles
from overtaking.show.server.kept import Kept
from overtaking.show.server.thumbnail import thumbnail
from overtaking.show.server.whatif import DECISIONS, branch, futures
from overtaking.show.view.ghosts import beliefs_at_every_decision
from overtaking.show.view.pack import pack
from overtaking.show.view.page import report_values, words
from overtaking.sim.stepping import trace_beliefs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.data.load import Dataset
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.show.server.wanted import Branch, Futures, Rows

FAULT = "a fault of overtaking itself, please report it"

SQL_ROWS, SQL_SECONDS, SQL_MIB = 100_000, 20.0, 512
"""Bounds of a query: rows, time [s] and memory [MiB]."""

_SHOWN_ROWS = 200
_PATIENCE_S = 1.0
_KEPT_RUNS, _KEPT_THUMBNAILS, _KEPT_QUERIES, _KEPT_FANS = 32, 2000, 8, 64
_KEY = "simulation"


class Library:
    """A data set, and what a page may ask of it.

    Args:
        data: The data set.
        policy: Which rules count at first.
    """

    def __init__(self, data: Dataset, policy: str) -> None:
        """Read nothing yet."""
        self._data, self._policy, self._index = data, policy, Index(data)
        self._work, self._failure = threading.Lock(), ""
        self._runs = Kept(_KEPT_RUNS, self._prepared)
        self._thumbnails = Kept(_KEPT_THUMBNAILS, self._thumbnail)
        self._queries = Kept(_KEPT_QUERIES, self._query)
        self._fans = Kept(_KEPT_FANS, self._fan)
        self._querying, self._fanning = threading.Lock(), threading.Lock()
        self._is_closed = threading.Event()

    def read(self) -> None:
        """Read what the list needs; the page shows a failure."""
        try:
            self._index.read()
        except OvertakingError as error:
            self._failure = str(error)
        except Exception:
            self._failure = FAULT
            raise

    def close(self) -> None:
        """Cancel queries that run or wait, and stop reading."""
        self._is_closed.set()
        self._index.close()

    def start(self) -> dict[str, Any]:
        """What the page needs at its start."""
        return {
            "title": self._data.name,
            "policy": self._policy,
            "words": words() | {"kinds": titles()},
            "import_report": report_values(self._data.import_findings),
            "total": len(self._data),
            "decisions": DECISIONS,
            "weathers": list(self._index.weather.names[:-1]),
        }

    def rows(self, asked: Rows) -> dict[str, Any]:
        """A part of the list, and how many simulations have what."""
        asked = asked.model_copy(update={"policy": asked.policy or self._policy})
        self._index.wait(_PATIENCE_S)
        read = self._index.done  # Before the selection: what is read meanwhile is not in it.
        extra = self._queries.get(asked.sql)["mask"] if asked.sql else None
        numbers, counts = self._index.select(asked, extra)
        first = asked.first
        if asked.around is not None:
            at = np.flatnonzero(numbers == asked.around)
            first = int(at[0]) // asked.count * asked.count if len(at) else 0
        self._index.told()
        return {
            "rows": self._index.rows(numbers[first : first + asked.count]),
            "first": first,
            "found": len(numbers),
            "read": read,
            "total": self._index.total,
            "counts": counts,
            "failure": self._failure,
        }

    def sql(self, text: str) -> dict[str, Any]:
        """The answer to a query, for people; its simulations become the list if it names any."""
        return self._queries.get(text)["answer"]

    def run(self, number: int) -> dict[str, Any]:
        """One simulation as the page reads it."""
        return self._runs.get(self._checked(number))[1]

    def thumbnail(self, number: int) -> dict[str, Any]:
        """A small picture of one simulation, as lines."""
        return self._thumbnails.get(self._checked(number))

    def beliefs(self, number: int) -> dict[str, Any]:
        """Where the ego believes others to be, at every decision."""
        labelled, _ = self._runs.get(self._checked(number))
        run = labelled.trajectories
        if run.unknown:
            raise _refused("beliefs", "a simulated driver", "a recording without percepts")
        with self._work:
            return beliefs_at_every_decision(run, trace_beliefs(run.scenario, run.actions))

    def branch(self, number: int, asked: Branch) -> dict[str, Any]:
        """One simulation that goes on otherwise."""
        labelled, packed = self._runs.get(self._checked(number))
        with self._work:
            return branch(labelled, number, packed["values"], asked)

    def fan(self, number: int, asked: Futures) -> dict[str, Any]:
        """Outcomes of an overtake that begins at each instant of one simulation."""
        asked = asked.model_copy(update={"policy": asked.policy or self._policy})
        return self._fans.get((self._checked(number), asked))

    def _fan(self, key: tuple[int, Futures]) -> dict[str, Any]:
        number, asked = key
        with self._fanning:
            return futures(scene_of(self._data, number), asked)

    def _checked(self, number: int) -> int:
        if not 0 <= number < len(self._data):
            last = len(self._data) - 1
            raise NoSuchSimulationError.out_of_range(
                what="simulation", where=self._data.name, low=0, high=last, got=number
            )
        return number

    def _prepared(self, number: int) -> tuple[LabelledTrajectories, dict[str, Any]]:
        with self._work:
            labelled = label(self._data.trajectory(number))
            return labelled, pack(labelled, number)

    def _thumbnail(self, number: int) -> dict[str, Any]:
        return thumbnail(self._runs.get(number)[1])

    def _query(self, text: str) -> dict[str, Any]:
        with self._querying:
            found = query(
                self._data,
                text,
                max_rows=SQL_ROWS,
                timeout_s=SQL_SECONDS,
                memory_mib=SQL_MIB,
                cancelled=self._is_closed,
            )
        values = found.values()
        mask = _mask(values["columns"], values["rows"], len(self._data))
        answer = {
            "columns": values["columns"],
            "rows": values["rows"][:_SHOWN_ROWS],
            "num_rows": len(values["rows"]),
            "is_cut": found.is_cut,
            "filters": mask is not None,
        }
        return {"mask": mask, "answer": answer}


def _mask(columns: list[str], rows: list[list[Any]], total: int) -> NDArray[np.bool_] | None:
    """The simulations that an answer names; None if it has no such column."""
    if _KEY not in columns:
        return None
    place, mask = columns.index(_KEY), np.zeros(total, np.bool_)
    numbers = [row[place] for row in rows]
    mask[[one for one in numbers if isinstance(one, int) and 0 <= one < total]] = True
    return mask


def _refused(what: str, expected: str, got: str) -> ConfigError:
    step = "open a simulation of this package's model"
    return ConfigError(what=what, where="view", expected=expected, got=got, next_step=step)
