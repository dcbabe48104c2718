"""Searches the candidates for a balanced data set, and saves the progress in its folder.

The result is a pure function of the recipe. `balance.json` only saves time: a file that is missing,
damaged or of another recipe is ignored.
"""

import hashlib
import json
from contextlib import closing
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from overtaking.core.arrays import F64, I64, U64
from overtaking.core.errors import DatasetError
from overtaking.core.files import read_bounded
from overtaking.core.process_limits import ordered_map
from overtaking.core.progress import ProgressCallback
from overtaking.data import plan
from overtaking.data.balance import MAX_CANDIDATES, OUTSIDE, ClassBalance, selection_weights
from overtaking.data.location import Location
from overtaking.data.manifest import BalanceRecord, CellRecord, Identity
from overtaking.data.recipe import Recipe, Simulator
from overtaking.labels.labelling import label
from overtaking.labels.law.judging import choose_policy, stored_policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.scenarios.sampler import ScenarioSource

FILE_NAME = "balance.json"


_HEAD_BYTES, _SIMULATION_BYTES = 1_000, 16
"""Most of what is remembered, but for the simulations, and of each: a number below
`MAX_CANDIDATES` and its cell, with commas. What is longer is looked for again."""

_SAVED_SHARE = 10
"""The progress of the search is saved whenever the number of candidates has grown by a tenth. So at
most a tenth is lost, and all saves together cost ten times the last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """The candidates that a balanced data set consists of.

    Attributes:
        index: Number of each candidate that is kept, growing, shape (simulation,).
        weight: Weight of its cell, shape (simulation,).
        record: What the manifest says of it.
    """

    index: U64
    weight: F64
    record: BalanceRecord


class Selection:
    """The candidates that are kept so far, and how many of each cell have been seen."""

    def __init__(self, quotas: I64) -> None:
        """Begin with none.

        Args:
            quotas: Simulations wanted of each cell, shape (cell,).
        """
        self._quotas = quotas
        self._parts: list[tuple[U64, I64]] = []
        self.seen, self.kept = np.zeros_like(quotas), np.zeros_like(quotas)
        self.candidates = 0

    @property
    def is_full(self) -> bool:
        """Whether every quota is."""
        return bool((self.kept == self._quotas).all())

    @property
    def missing(self) -> I64:
        """Simulations that are missing in each cell."""
        return self._quotas - self.kept

    @property
    def index(self) -> U64:
        """Number of each kept candidate, growing, shape (simulation,)."""
        return np.concatenate([np.empty(0, np.uint64), *(index for index, _ in self._parts)])

    @property
    def cell(self) -> I64:
        """Its cell, shape (simulation,)."""
        return np.concatenate([np.empty(0, np.int64), *(cell for _, cell in self._parts)])

    def offer(self, cell: I64) -> None:
        """Look at the next candidates; stop at the candidate that fills the last quota.

        Args:
            cell: The cell of each, or `OUTSIDE`.
        """
        keeps = np.zeros(len(cell), np.bool_)
        for number, room in enumerate(self.missing.tolist()):
            keeps[np.flatnonzero(cell == number)[:room]] = True
        if keeps.sum() == self.missing.sum():
            end = int(np.flatnonzero(keeps).max(initial=-1)) + 1
            cell, keeps = cell[:end], keeps[:end]
        rows = np.flatnonzero(keeps)
        self._add(rows.astype(np.uint64) + np.uint64(self.candidates), cell[rows])
        self.seen += np.bincount(cell[cell != OUTSIDE], minlength=len(self.seen))
        self.candidates += len(cell)

    def restore(self, candidates: int, seen: I64, index: U64, cell: I64) -> None:
        """Continue a saved search.

        Args:
            candidates: How many have been looked at.
            seen: How many of each cell were among them.
            index: Number of each that is kept.
            cell: Its cell.
        """
        self.candidates, self.seen = candidates, seen
        self._add(index, cell)

    def expected(self, limit: int) -> int:
        """Estimated number of candidates until every quota is full, at the rate so far.

        Args:
            limit: The most.
        """
        open_cells = self.missing > 0
        if not (self.seen[open_cells] > 0).all():
            return limit
        needed = self._quotas[open_cells] * self.candidates / self.seen[open_cells]
        return int(np.clip(np.ceil(needed.max(initial=0.0)), self.candidates, limit))

    def chosen(self, names: tuple[str, ...]) -> Chosen:
        """The result of the search.

        Args:
            names: Names of the cells.
        """
        weights = selection_weights(self.seen, self.kept)
        columns = (self._quotas, self.seen, self.kept, weights)
        rows = zip(names, *(column.tolist() for column in columns), strict=True)
        record = BalanceRecord(
            candidates=self.candidates,
            outside=self.candidates - int(self.seen.sum()),
            missing=int(self.missing.sum()),
            cells={
                name: CellRecord(quota=quota, seen=seen, kept=kept, weight=weight)
                for name, quota, seen, kept, weight in rows
            },
        )
        return Chosen(index=self.index, weight=weights[self.cell], record=record)

    def _add(self, index: U64, cell: I64) -> None:
        self._parts.append((index, cell))
        self.kept += np.bincount(cell, minlength=len(self.kept))


class Scan:
    """Looks for the candidates to keep.

    Args:
        recipe: The data set to make.
        identity: Its identity, with a balance.
        simulator: What simulates.
        location: Where the data set lies.
    """

    def __init__(
        self, recipe: Recipe, identity: Identity, simulator: Simulator, location: Location
    ) -> None:
        """Refuse impossible wishes; nothing is read or written yet."""
        assert identity.balance is not None
        self._recipe, self._simulator, self._location = recipe, simulator, location
        self._balance: ClassBalance = identity.balance
        self._policy = stored_policy(choose_policy(self._balance.policy, identity.profile))
        self._limit = self._balance.limit(recipe.num_simulations)
        self._key = _key(identity, self._balance)
        self._step = identity.shard_size
        self.selection = Selection(self._balance.quotas(recipe.num_simulations))

    def run(self, report: ProgressCallback | None = None) -> Chosen:
        """Go on until every quota is full or there are no more candidates.

        Args:
            report: Called with the number of candidates so far, and about how many there will be.

        Raises:
            DatasetError: A cell is too rare.
            OSError: The folder cannot be written.
        """
        progress = report or _silent
        _read(self._location, self._key, self._limit, self.selection)
        progress(self.selection.candidates, self.selection.expected(self._limit))
        if not self.selection.is_full:
            self._look(progress)
            self._save()
        self._refuse_too_rare()
        return self.selection.chosen(self._balance.cells)

    def _look(self, progress: ProgressCallback) -> None:
        """Look at one batch of candidates after the other, and save the progress now and then."""
        found = self.selection
        saved = found.candidates
        usual = plan.batch_size(self._recipe.spec.to_dict(), self._simulator.chunk_size)
        size = min(usual, self._recipe.num_simulations)  # A small data set needs few candidates.
        batches = plan.runs(found.candidates, self._limit, size)
        with closing(ordered_map(self._cells, batches, self._simulator.threads)) as ahead:
            for cells in ahead:
                found.offer(cells)
                progress(found.candidates, found.expected(self._limit))
                if found.is_full:
                    return
                if found.candidates - saved >= max(self._step, saved // _SAVED_SHARE):
                    self._save()
                    saved = found.candidates

    def _cells(self, numbers: range) -> I64:
        """The cells of some candidates."""
        recipe = self._recipe
        index = np.arange(numbers.start, numbers.stop, dtype=np.uint64)
        scenario = ScenarioSource(recipe.spec, recipe.road, recipe.seed).sample(index)
        labelled = label(self._simulator.simulate(scenario), policies=[self._policy])
        return self._balance.cell_of(labelled.labels.classes[:, 0], scenario.weather.night)

    def _save(self) -> None:
        found = self.selection
        remembered = _Remembered(
            key=self._key,
            candidates=found.candidates,
            seen=found.seen.tolist(),
            index=found.index.tolist(),
            cell=found.cell.tolist(),
        )
        text = remembered.sealed().model_dump_json() + "\n"
        self._location.put_text(FILE_NAME, text)

    def _refuse_too_rare(self) -> None:
        found = self.selection
        if found.is_full or (self._balance.allows_missing and found.kept.any()):
            return
        rarest = int(np.argmax(found.missing))
        short = int((found.missing > 0).sum())
        raise DatasetError(
            what=f"cell {self._balance.cells[rarest]}",
            where=str(self._location),
            expected=f"{found.kept[rarest] + found.missing[rarest]} simulations of it among "
            f"{self._limit} candidates",
            got=f"{found.kept[rarest]}; cells with too few: {short}",
            next_step="repeat the command with --resume and a larger --balance-candidates, "
            "or with --allow-missing to do with fewer",
        )


def _silent(_done: int, _total: int) -> None:
    """Report nothing."""


_Count = Annotated[int, Field(ge=0, le=MAX_CANDIDATES)]


class _Remembered(BaseModel):
    """The content of `balance.json`.

    Attributes:
        key: Hash over all that decides about it.
        candidates: How many have been looked at.
        seen: How many of each cell were among them.
        index: Number of each that is kept.
        cell: Its cell.
        seal: Hash over all of the above.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    key: str
    candidates: _Count
    seen: list[_Count]
    index: list[_Count]
    cell: list[_Count]
    seal: str = ""

    def sealed(self) -> "_Remembered":
        """The same with its seal."""
        text = self.model_copy(update={"seal": ""}).model_dump_json()
        return self.model_copy(update={"seal": hashlib.sha256(text.encode()).hexdigest()})

    def fits(self, key: str, limit: int, cells: int) -> bool:
        """Whether it is whole, and about this search.

        Args:
            key: Hash over all that decides about it.
            limit: Most candidates.
            cells: Number of cells.
        """
        return (
            (self.key == key and self.candidates <= limit and self.sealed() == self)
            and (len(self.seen) == cells and len(self.index) == len(self.cell))
            and all(cell < cells for cell in self.cell)
        )


def _read(location: Location, key: str, limit: int, selection: Selection) -> None:
    """Restore the saved progress of the same search into a selection, if it is intact."""
    try:
        with location.open(FILE_NAME) as file:
            most = _HEAD_BYTES + _SIMULATION_BYTES * int(selection.missing.sum())
            known = _Remembered.model_validate_json(read_bounded(file, most))
    except (OSError, ValidationError):
        return
    if known.fits(key, limit, len(selection.seen)):
        index = np.array(known.index, dtype=np.uint64)
        cell = np.array(known.cell, dtype=np.int64)
        selection.restore(known.candidates, np.array(known.seen, dtype=np.int64), index, cell)


def _key(identity: Identity, balance: ClassBalance) -> str:
    """Hash over all that decides which candidates are kept; the limit of the search does not."""
    scanned = identity.model_copy(
        update={"balance": ClassBalance(by=balance.by, policy=balance.policy), "shard_size": 1}
    )
    text = json.dumps([scanned.fingerprint, PORTUGAL.version])
    return hashlib.sha256(text.encode()).hexdigest()
