"""The columns of the list, in memory, so that a filter of a million simulations is quick.

Files are read one after another, in a thread; until all are read, the list has the first ones.
Reading takes all processors, which the browser needs as well, so the others wait until the list
of the first file is shown.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.data.tables import names
from overtaking.data.tables.arrow import column_to_numpy
from overtaking.data.tables.columns import codes
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.knowledge.glossary import terms
from overtaking.model.verdicts import Verdict
from overtaking.show import wording
from overtaking.show.server.kept import Kept

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa
    from numpy.typing import NDArray

    from overtaking.data.load import Dataset
    from overtaking.show.server.wanted import Rows

    Mask = NDArray[np.bool_]

FREE = "drawn freely"
"""Weather that is none of the presets."""

_MS_PER_S = 1000.0
_COLUMNS = {
    "simulations": ("simulation", "weather", "num_frames", "frame_interval_ms"),
    "weather": ("weather", "preset", "night"),
    "labels": ("simulation", "policy", "class", "outcome", "detail"),
    "findings": ("simulation", "rule", "verdict", "margin"),
    "attempts": ("simulation", "ego_kind", "leader_kind"),
}
_NONE = -1
_KEPT_ORDERS = 4
_HEAD_START_S = 2.0
"""Longest time that the second file waits for the list of the first to be shown."""


@dataclass(frozen=True, slots=True)
class Facet:
    """A property that each simulation has one value of.

    Attributes:
        names: Its values.
        codes: Place of each simulation's among them, -1 for none, shape (simulation,).
    """

    names: tuple[str, ...]
    codes: NDArray[np.int8]

    def among(self, wanted: tuple[str, ...], done: int) -> Mask:
        """Which of the first simulations have one of some values."""
        is_wanted = np.array([*(name in wanted for name in self.names), False])  # The last: none.
        return is_wanted[self.codes[:done]]

    def counts(self, kept: Mask) -> dict[str, int]:
        """How many simulations of a selection have each value that any has."""
        found = np.bincount(self.codes[: len(kept)][kept] + 1, minlength=len(self.names) + 1)[1:]
        return {name: int(found[place]) for place, name in enumerate(self.names) if found[place]}


class Index:
    """The columns of a data set.

    Args:
        data: The data set.
    """

    def __init__(self, data: Dataset) -> None:
        """Make room, and read nothing yet."""
        count, rules = len(data), names.RULES
        self._data, self.done, self.total = data, 0, count
        self._begun, self._told = threading.Event(), threading.Event()
        self._is_closed = threading.Event()
        # To sort a million takes longer than all the rest of a filter.
        self._orders = Kept(_KEPT_ORDERS, self._order)

        def facet(*values: str) -> Facet:
            return Facet(values, np.full(count, _NONE, np.int8))

        self.classes = {policy: facet(*names.CLASSES) for policy in names.POLICY_NAMES}
        self.weather = facet(*weather_presets(), FREE)
        self.light, self.ego, self.overtaken = (
            facet(*of) for of in (("day", "night"), names.KINDS, names.KINDS)
        )
        self.outcome, self.detail = facet(*names.OUTCOMES), facet(*names.DETAILS)
        self.duration = np.zeros(count, np.float32)
        self.num_frames = np.zeros(count, np.int32)
        self.broken = np.zeros((len(rules), count), np.bool_)
        self.margin = np.full((len(rules), count), np.nan, np.float32)

    def read(self) -> None:
        """Read all files, or until the index is closed.

        Raises:
            DatasetError: One is missing or damaged.
        """
        kept = self._data.kept_tables
        wanted = {table: of for table, of in _COLUMNS.items() if table in kept}
        for first, tables in self._data.columns(**wanted):
            if self._is_closed.is_set():
                return
            self._take(first, tables)
            self.done = first + tables["simulations"].num_rows
            if not self._begun.is_set():
                self._begun.set()
                self._told.wait(_HEAD_START_S)

    def wait(self, seconds: float) -> None:
        """Wait until something is read, but no longer than some time [s]."""
        self._begun.wait(seconds)

    def close(self) -> None:
        """Stop reading after the present file."""
        self._is_closed.set()
        self._told.set()

    def told(self) -> None:
        """Go on reading: somebody has the first rows."""
        self._told.set()

    def select(self, asked: Rows, extra: Mask | None) -> tuple[NDArray[np.integer], dict[str, Any]]:
        """The simulations that a request wants, in its order, and how many have each value.

        Args:
            asked: The request.
            extra: Further simulations to leave out, shape (simulation,); None for none.

        Returns:
            Their numbers, and counts by property and value. The counts of a property are of the
            simulations that all other properties leave.
        """
        done = self.done
        facets = self._facets(asked.policy)
        masks = {
            name: of.among(wanted, done)
            for name, of in facets.items()
            if (wanted := getattr(asked, name))
        }
        masks |= self._law_masks(asked, done)
        if extra is not None:
            masks["sql"] = extra[:done]
        every = np.ones(done, np.bool_)
        kept = _all(masks.values(), every)
        counts: dict[str, Any] = {}
        for name, of in facets.items():
            rest = [mask for other, mask in masks.items() if other != name]
            counts[name] = of.counts(_all(rest, every) if name in masks else kept)
        broken = (int(np.count_nonzero(row[:done] & kept)) for row in self.broken)
        counts["rules"] = {
            code: many for code, many in zip(names.RULES, broken, strict=True) if many
        }
        return self._ordered(kept, asked), counts

    def rows(self, numbers: NDArray[np.integer]) -> list[dict[str, Any]]:
        """What the list says of some simulations."""
        return [self._row(int(number)) for number in numbers]

    def _row(self, number: int) -> dict[str, Any]:
        outcome, detail = _at(self.outcome, number), _at(self.detail, number)
        told = wording.outcome_words({"outcome": outcome, "detail": detail})
        return {
            "number": number,
            "classes": {policy: _at(of, number) for policy, of in self.classes.items()},
            "broken": [
                code
                for code, is_so in zip(names.RULES, self.broken[:, number], strict=True)
                if is_so
            ],
            "weather": _at(self.weather, number),
            "night": _at(self.light, number) == "night",
            "outcome": told,
            "duration_s": round(float(self.duration[number]), 3),
            "num_frames": int(self.num_frames[number]),
        }

    def _facets(self, policy: str | None) -> dict[str, Facet]:
        """The properties of the filter, by the names of `Rows`."""
        classes = self.classes.get(policy or "", next(iter(self.classes.values())))
        return {
            "classes": classes,
            "weather": self.weather,
            "light": self.light,
            "ego": self.ego,
            "overtaken": self.overtaken,
        }

    def _law_masks(self, asked: Rows, done: int) -> dict[str, Mask]:
        """What the law leaves: all rules broken, and a margin within bounds."""
        masks: dict[str, Mask] = {}
        if asked.rules:
            nothing = np.zeros(done, np.bool_)
            places = [_place(code) for code in asked.rules]
            broken = [nothing if at is None else self.broken[at, :done] for at in places]
            masks["rules"] = np.logical_and.reduce(broken)
        bounds = asked.margin
        at = None if bounds is None else _place(bounds.rule)
        if bounds is not None and at is not None:
            margin = self.margin[at, :done]
            least = -np.inf if bounds.least is None else bounds.least
            most = np.inf if bounds.most is None else bounds.most
            masks["margin"] = (margin >= least) & (margin <= most)
        return masks

    def _ordered(self, kept: Mask, asked: Rows) -> NDArray[np.integer]:
        """The numbers of a selection in the wanted order."""
        rule = asked.margin and _place(asked.margin.rule)
        is_by_margin = asked.order == "margin" and rule is not None
        if not is_by_margin and asked.order != "duration":
            numbers = np.flatnonzero(kept)
            return numbers[::-1] if asked.descending else numbers
        row = rule if is_by_margin else None
        order = self._orders.get((row, asked.descending, len(kept)))
        return order[kept[order]]

    def _order(self, key: tuple[int | None, bool, int]) -> NDArray[np.int32]:
        """The first simulations in the order of a rule's margin, or of their duration."""
        rule, descending, done = key
        values = (self.duration if rule is None else self.margin[rule])[:done]
        return ordering(-values if descending else values)

    def _take(self, first: int, tables: Mapping[str, pa.Table]) -> None:
        """The rows of one file of each table."""
        rows = tables["simulations"]
        span = slice(first, first + rows.num_rows)
        interval = column_to_numpy(rows["frame_interval_ms"]) / _MS_PER_S
        self.num_frames[span] = column_to_numpy(rows["num_frames"])
        self.duration[span] = (self.num_frames[span] - 1) * interval
        self._take_weather(span, rows, tables["weather"])
        self._take_labels(tables["labels"])
        self._take_findings(tables["findings"])
        if "attempts" in tables:
            at = column_to_numpy(tables["attempts"]["simulation"])
            for of, name in ((self.ego, "ego_kind"), (self.overtaken, "leader_kind")):
                of.codes[at] = codes(tables["attempts"][name], names.KINDS)

    def _take_weather(self, span: slice, rows: pa.Table, weather: pa.Table) -> None:
        keys = column_to_numpy(weather["weather"])
        at = np.searchsorted(keys, column_to_numpy(rows["weather"]))
        known = {name: place for place, name in enumerate(self.weather.names)}
        night = weather["night"].to_pylist()  # None where the weather is not recorded.
        preset = [
            _NONE if is_night is None else known[name or FREE]
            for name, is_night in zip(weather["preset"].to_pylist(), night, strict=True)
        ]
        self.weather.codes[span] = np.array(preset, np.int8)[at]
        light = [_NONE if one is None else int(one) for one in night]
        self.light.codes[span] = np.array(light, np.int8)[at]

    def _take_labels(self, labels: pa.Table) -> None:
        at = column_to_numpy(labels["simulation"])
        policy = codes(labels["policy"], names.POLICY_NAMES)
        label = codes(labels["class"], names.CLASSES)
        for place, name in enumerate(names.POLICY_NAMES):
            here = policy == place
            self.classes[name].codes[at[here]] = label[here]
        self.outcome.codes[at] = codes(labels["outcome"], names.OUTCOMES)
        self.detail.codes[at] = codes(labels["detail"], names.DETAILS)

    def _take_findings(self, findings: pa.Table) -> None:
        at = column_to_numpy(findings["simulation"])
        rule = codes(findings["rule"], names.RULES)
        verdict = codes(findings["verdict"], names.VERDICTS)
        self.broken[rule, at] = verdict == names.VERDICTS.index(Verdict.ILLEGAL.name.lower())
        # Arrow's own `to_numpy` would import pandas, which takes half a second.
        self.margin[rule, at] = column_to_numpy(findings["margin"], missing=np.nan)


def ordering(values: NDArray[np.float32]) -> NDArray[np.int32]:
    """The places of numbers in rising order, equal ones as they come, NaN last.

    As a stable `argsort`, in a fifth of its time: each number and its place become one integer, and
    NumPy sorts integers with SIMD.

    Args:
        values: Shape (simulation,).
    """
    bits = (values + np.float32(0.0)).view(np.uint32)  # The sum makes one zero of both.
    sign = np.uint32(1 << 31)
    rank = np.where(bits & sign, ~bits, bits | sign)
    rank[np.isnan(values)] = ~np.uint32(0)
    keys = rank.astype(np.uint64) << np.uint64(32) | np.arange(len(values), dtype=np.uint64)
    keys.sort()
    return (keys & np.uint64(0xFFFFFFFF)).astype(np.int32)


def titles() -> dict[str, str]:
    """Kinds of vehicles as people call them."""
    return {kind: terms("vehicles")[kind].title for kind in names.KINDS}


def _all(masks: Any, every: Mask) -> Mask:
    """Where all masks are set."""
    kept = every
    for mask in masks:
        kept = kept & mask
    return kept


def _at(facet: Facet, number: int) -> str:
    code = int(facet.codes[number])
    return "unknown" if code < 0 else facet.names[code]


def _place(rule: str) -> int | None:
    return names.RULES.index(rule) if rule in names.RULES else None
